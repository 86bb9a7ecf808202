// Makes the manual page and the shell completion from the commands of the program, so that both are
// always complete. The commands replace %COMMANDS% in the template. Run by the build:
//
//   sixpoint_reference man TEMPLATE
//   sixpoint_reference completion TEMPLATE
#include <algorithm>
#include <fstream>
#include <iostream>
#include <sstream>

#include <CLI/App.hpp>
#include <fmt/format.h>

#include "cli/program/program.h"

namespace sixpoint {
namespace {

using Visit = std::function<void(const CLI::App& command, const std::string& path)>;

// Every command and subcommand, in the order of --help. "archive plan" is a path.
void for_each_command(const CLI::App& app, const std::string& path, const Visit& visit) {
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    const std::string name = path.empty() ? command->get_name() : path + " " + command->get_name();
    visit(*command, name);
    for_each_command(*command, name, visit);
  }
}

std::string roff(std::string_view text, bool line_start = true) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (c == '\n') {
      escaped += "\n.br\n";
    } else {
      escaped += c;
    }
  }
  if (line_start && (escaped.starts_with('.') || escaped.starts_with('\''))) {
    escaped.insert(0, "\\&");
  }
  return escaped;
}

// "--device VALUE", "PATH ..."
std::string usage_of(const CLI::Option& option) {
  const bool positional = !option.nonpositional();
  std::string text = fmt::format("\\fB{}\\fR", roff(option.get_name(positional, true), false));
  if (!positional && option.get_items_expected_max() != 0) {
    text += " \\fIVALUE\\fR";
  }
  return option.get_expected_max() > 1 ? text + " ..." : text;
}

// Without those that --help does not list: old names that are refused.
std::vector<const CLI::Option*> listed_options(const CLI::App& command) {
  return command.get_options(
      [](const CLI::Option* option) { return !option->get_group().empty(); });
}

std::string man_page(const CLI::App& app) {
  std::string text;
  for_each_command(app, "", [&](const CLI::App& command, const std::string& path) {
    text +=
        fmt::format(".SS sixpoint {}\n{}\n", roff(path, false), roff(command.get_description()));
    for (const CLI::Option* option : listed_options(command)) {
      if (option == command.get_help_ptr()) {
        continue;
      }
      text +=
          fmt::format(".TP\n{}\n{}\n", usage_of(*option),
                      option->get_description().empty() ? "\\&" : roff(option->get_description()));
    }
    if (!command.get_footer().empty()) {
      text += fmt::format(".PP\n{}\n", roff(command.get_footer()));
    }
  });
  return text;
}

std::string completion(const CLI::App& app) {
  std::string text;
  const auto entry = [&](const CLI::App& command, const std::string& path) {
    std::string words;
    for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; })) {
      words += fmt::format("{}{}", words.empty() ? "" : " ", sub->get_name());
    }
    std::string options;
    for (const CLI::Option* option : listed_options(command)) {
      for (const std::string& name : option->get_lnames()) {
        options += fmt::format("{}--{}", options.empty() ? "" : " ", name);
      }
    }
    text += fmt::format("    '{}') commands='{}' options='{}' ;;\n", path, words, options);
  };
  entry(app, "");
  for_each_command(app, "", entry);
  return text;
}

int run(const std::vector<std::string>& arguments) {
  std::ifstream file(arguments.size() == 2 ? arguments[1] : "");
  std::stringstream content;
  content << file.rdbuf();
  std::string page = content.str();
  constexpr std::string_view kPlace = "%COMMANDS%\n";
  const auto place = page.find(kPlace);
  if (!file || place == std::string::npos) {
    std::cerr << "usage: sixpoint_reference man|completion TEMPLATE\n";
    return 64;
  }
  CLI::App app("", "sixpoint");
  cli::Context context{posix_env(), std::cout, std::cerr, std::cin};
  app.set_version_flag("--version", "");
  cli::declare_commands(app, context);
  page.replace(place, kPlace.size(), arguments[0] == "man" ? man_page(app) : completion(app));
  std::cout << page;
  return std::cout.flush() ? 0 : 74;
}

}  // namespace
}  // namespace sixpoint

int main(int argc, char** argv) {
  try {
    return sixpoint::run(std::vector<std::string>(argv + 1, argv + argc));
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 70;
  }
}

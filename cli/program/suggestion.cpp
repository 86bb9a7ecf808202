#include "cli/program/suggestion.h"

#include <algorithm>
#include <cctype>

#include <CLI/App.hpp>
#include <CLI/Error.hpp>
#include <fmt/format.h>

#include "base/error.h"

namespace sixpoint::cli {

namespace {

std::size_t steps_between(const std::string& a, const std::string& b) {
  // Rows of the table for a's first i letters: i - 2, i - 1 and i.
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> above(b.size() + 1);
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before = std::exchange(above, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t other = a[i - 1] == b[j - 1] ? 0 : 1;
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + other});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
  }
  return row[b.size()];
}

std::string did_you_mean(const std::string& typed, const std::vector<std::string>& known) {
  const auto nearest = nearest_word(typed, known);
  return nearest ? fmt::format("; did you mean '{}'?", *nearest) : std::string(";");
}

// Without those that --help does not list: old names that are refused.
std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_group().empty()) {
      continue;
    }
    for (const std::string& name : option->get_lnames()) {
      names.push_back("--" + name);
    }
  }
  return names;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : commands_of(app)) {
    names.push_back(command->get_name());
  }
  return names;
}

}  // namespace

std::optional<std::string> nearest_word(const std::string& typed,
                                        const std::vector<std::string>& known) {
  const auto begins = [&](const std::string& word) { return word.starts_with(typed); };
  if (std::ranges::count_if(known, begins) == 1) {
    return *std::ranges::find_if(known, begins);
  }
  std::vector<std::string> nearest;
  std::size_t fewest = typed.size();
  for (const std::string& word : known) {
    const std::size_t steps = steps_between(typed, word);
    if (3 * steps > word.size() || steps > fewest) {
      continue;
    }
    if (steps < fewest) {
      nearest.clear();
    }
    nearest.push_back(word);
    fewest = steps;
  }
  return nearest.size() == 1 ? std::optional(nearest.front()) : std::nullopt;
}

std::string plain_words(const CLI::ParseError& refused) {
  const std::string text = printable(refused.what());
  const std::string kind = refused.get_name();
  // "NAME: rest", or the whole text.
  const std::size_t colon = text.find(": ");
  const std::string name = text.substr(0, std::min(colon, text.size()));
  const std::string rest = colon == std::string::npos ? "" : text.substr(colon + 2);
  // What stands before and behind `middle` in `of`, after `start`.
  const auto parts =
      [](const std::string& of, std::string_view start,
         std::string_view middle) -> std::optional<std::pair<std::string, std::string>> {
    const std::size_t at = of.rfind(middle);
    if (!of.starts_with(start) || at == std::string::npos || at < start.size()) {
      return std::nullopt;
    }
    return std::pair(of.substr(start.size(), at - start.size()), of.substr(at + middle.size()));
  };
  if (kind == "ArgumentMismatch") {
    if (rest.ends_with(" missing")) {
      return name + " has no value";
    }
    if (const auto many = parts(rest, "At Most ", " required but received ")) {
      return fmt::format("{} is given {} times, and is taken {}", name, many->second,
                         many->first == "1" ? "once" : many->first + " times");
    }
    if (const auto few = parts(rest, "At least ", " required but received ")) {
      return fmt::format("{}: at least {} are needed, {} is given", name, few->first, few->second);
    }
  }
  if (kind == "ValidationError") {
    if (const auto range = parts(rest, "Value ", " not in range ")) {
      return fmt::format("{}: '{}' is no number from {}", name, range->first, range->second);
    }
  }
  if (kind == "ConversionError") {
    if (const auto option = parts(text, "Could not convert: ", " = ")) {
      return fmt::format("{} cannot be '{}'", option->first, option->second);
    }
  }
  if (kind == "ExcludesError") {
    if (const auto both = parts(text, "", " excludes ")) {
      return fmt::format("{} and {} do not go together", both->first, both->second);
    }
  }
  if (name.starts_with("The following argument")) {  // its kind is the command's name
    return "more arguments than it takes: " + rest;
  }
  return text == "A subcommand is required" ? "a command is missing" : text;
}

std::optional<std::string> unknown_word(const CLI::App& app,
                                        const std::vector<std::string>& arguments) {
  const CLI::App* command = &app;
  std::string path = "sixpoint";
  for (const std::string& word : arguments) {
    if (word == "--") {
      break;
    }
    const bool is_short =
        word.size() > 1 && word[0] == '-' && std::isalpha(static_cast<unsigned char>(word[1])) != 0;
    if (is_short || word.starts_with("--")) {
      const std::string name = word.substr(0, is_short ? 2 : word.find('='));
      if (command->get_option_no_throw(name) == nullptr) {
        return fmt::format("'{}' has no option '{}'{} '{} --help' lists them", path,
                           printable(name, 60), did_you_mean(name, option_names(*command)), path);
      }
      continue;
    }
    const auto commands = commands_of(*command);
    if (word.starts_with('-') || commands.empty()) {
      continue;
    }
    const auto found = std::ranges::find(commands, word, &CLI::App::get_name);
    if (found == commands.end()) {
      return fmt::format("'{}' has no command '{}'{} '{} --help' lists them", path,
                         printable(word, 60), did_you_mean(word, command_names(*command)), path);
    }
    command = *found;
    path += " " + word;
  }
  return std::nullopt;
}

}  // namespace sixpoint::cli

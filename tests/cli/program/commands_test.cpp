// Every command of the list: its help, and options that are declared alike.
#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include "cli/command_fixture.h"
#include "cli/program/examples.h"
#include "cli/program/program.h"

namespace sixpoint::cli {
namespace {

using tests::CommandTest;

void visit(const CLI::App& app, const std::function<void(const CLI::App&)>& work) {
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    work(*command);
    visit(*command, work);
  }
}

TEST_F(CommandTest, EveryCommandHasHelpAndRefusesAnUnknownOption) {
  for (const CommandEntry& entry : commands()) {
    CLI::App app;
    std::ostringstream stream;
    std::istringstream in;
    Context context{posix_env(), stream, stream, in};
    entry.add(app, context);
    visit(app, [](const CLI::App& command) {
      EXPECT_FALSE(command.get_description().empty()) << command.get_name();
    });
    const CLI::App* command = app.get_subcommands([](const CLI::App*) { return true; }).front();
    const auto help = run({command->get_name(), "--help"});
    EXPECT_EQ(help.exit_code, 0) << command->get_name();
    EXPECT_EQ(run({command->get_name(), "--no-such-option"}).exit_code, 64) << command->get_name();
  }
}

// The same option is described by the same words, wherever one function declares it.
TEST(Commands, SharedOptionsAreDescribedAlike) {
  std::map<std::string, std::set<std::string>> descriptions;
  std::ostringstream stream;
  std::istringstream in;
  Context context{posix_env(), stream, stream, in};
  CLI::App app;
  declare_commands(app, context);
  visit(app, [&](const CLI::App& command) {
    for (const CLI::Option* option : command.get_options()) {
      for (const std::string& name : option->get_lnames()) {
        descriptions[name].insert(option->get_description());
      }
    }
  });
  for (const char* name : {"record", "wide", "undo-rotation", "allow-prior", "calibration-file"}) {
    EXPECT_EQ(descriptions[name].size(), 1U) << name;
  }
}

// tests/docs/run_examples.sh runs them.
TEST(Commands, EveryOneHasTwoExamplesOfItself) {
  std::ostringstream stream;
  std::istringstream in;
  Context context{posix_env(), stream, stream, in};
  CLI::App app;
  declare_commands(app, context);
  std::size_t with_examples = 0;
  visit(app, [&](const CLI::App& command) {
    if (!command.get_subcommands([](const CLI::App*) { return true; }).empty()) {
      return;
    }
    std::string path = command.get_name();
    for (const CLI::App* above = command.get_parent(); above != &app; above = above->get_parent()) {
      path.insert(0, above->get_name() + " ");
    }
    const auto found = std::ranges::find(command_examples(), path, &CommandExamples::command);
    ASSERT_NE(found, command_examples().end()) << path;
    for (const std::string_view line : found->lines) {
      EXPECT_TRUE((std::string(line) + " ").starts_with("sixpoint " + path + " ")) << line;
      EXPECT_NE(command.get_footer().find(line), std::string::npos) << line;
    }
    EXPECT_NE(found->lines[0], found->lines[1]);
    ++with_examples;
  });
  EXPECT_EQ(with_examples, command_examples().size());
}

}  // namespace
}  // namespace sixpoint::cli

// Every command of the list: its help, and options that are declared alike.
#include <functional>
#include <map>
#include <set>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include "cli/command_fixture.h"
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
  for (const CommandEntry& entry : commands()) {
    entry.add(app, context);
  }
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

}  // namespace
}  // namespace sixpoint::cli

#include "cli/program/program.h"

#include <sstream>

#include <gmock/gmock.h>

#include "base/memory_env.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;

struct Program {
  int operator()(const std::vector<std::string>& arguments) {
    out.str("");
    people.str("");
    return run_program(arguments, context);
  }
  MemoryEnv memory;
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{memory.env, out, people, in};
};

// Exit code 64 is EX_USAGE of sysexits.h.
TEST(ProgramRun, ACommandThatThereIsNotIsUsage) {
  Program run;
  EXPECT_EQ(run({"fix"}), 64);
  EXPECT_EQ(run.out.str(), "");
  EXPECT_THAT(run.people.str(), HasSubstr("sixpoint --help"));
  EXPECT_EQ(run({"units", "a\x1b[2Jb"}), 64);
  EXPECT_EQ(run.people.str().find('\x1b'), std::string::npos) << "a terminal is not written to";
}

// With --json a script reads why from standard output, whatever was wrong.
TEST(ProgramRun, ACommandLineThatIsNotUnderstoodIsADocumentToo) {
  Program run;
  const auto document = [&](const std::vector<std::string>& arguments) {
    EXPECT_EQ(run(arguments), 64);
    return Json::parse(run.out.str(), nullptr, /*allow_exceptions=*/false);
  };
  const Json no_device = document({"jig", "--json"});
  ASSERT_TRUE(no_device.is_object()) << run.out.str();
  EXPECT_EQ(no_device["schema"], "sixpoint/jig/1");
  EXPECT_EQ(no_device["error"]["code"], "usage");
  EXPECT_EQ(no_device["error"]["what"], "--device is required");
  EXPECT_EQ(no_device["error"]["hint"], "'sixpoint jig --help' lists what there is");
  EXPECT_THAT(run.people.str(),
              HasSubstr("--device is required; 'sixpoint jig --help' lists what there is"));
  EXPECT_THAT(document({"scan", "a.gt3x", "--hepl", "--json"})["error"]["what"].get<std::string>(),
              HasSubstr("did you mean '--help'?"));
  // The same names as a command's own errors have.
  for (const auto& [command, wrong] :
       std::vector<std::pair<std::vector<std::string>, std::vector<std::string>>>{
           {{"gap", "diagnose"}, {"none"}},
           {{"gap", "score"}, {"none.jsonl", "--labels", "none.jsonl"}},
           {{"archive", "status"}, {"none"}},
           {{"limits", "check"}, {"none.toml"}}}) {
    std::vector<std::string> arguments = command;
    arguments.insert(arguments.end(), {"--json", "--frobnicate"});
    const Json of_usage = document(arguments);
    arguments.pop_back();
    arguments.insert(arguments.end(), wrong.begin(), wrong.end());
    EXPECT_NE(run(arguments), 0);
    const Json of_command = Json::parse(run.out.str(), nullptr, /*allow_exceptions=*/false);
    ASSERT_TRUE(of_command.is_object()) << run.out.str() << run.people.str();
    EXPECT_EQ(of_usage["schema"], of_command["schema"]);
  }
  // No command, no document.
  EXPECT_EQ(run({"--json"}), 64);
  EXPECT_EQ(run.out.str(), "");
}

TEST(ProgramRun, HelpListsEveryCommandInTheOrderOfTheList) {
  Program run;
  EXPECT_EQ(run({"--help"}), 0);
  std::size_t at = 0;
  for (const char* name :
       {"inspect",      "scan",    "repair",   "export",     "compare",     "impact",
        "solve",        "jig",     "capture",  "limits",     "certificate", "check-unit",
        "station-lock", "retest",  "operator", "statistics", "gage-rr",     "units",
        "history",      "audit",   "store",    "simulate",   "session",     "devices",
        "doctor",       "virtual", "station",  "archive",    "gap"}) {
    const std::size_t next = run.out.str().find("\n  " + std::string(name) + " ", at);
    EXPECT_NE(next, std::string::npos) << name;
    at = std::min(next, run.out.str().size());
  }
  EXPECT_EQ(commands().size(), 29U);
}

TEST(ProgramRun, ARunLeavesNoCodeToTheNext) {
  Program run;
  EXPECT_EQ(run({"inspect", "none.gt3x"}), 66);
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_EQ(run({"limits", "print"}), 0);
  EXPECT_EQ(run.people.str(), "");
}

// 74 is EX_IOERR.
TEST(ProgramRun, AnOutputThatFailsIsAnError) {
  Program run;
  run.out.setstate(std::ios::badbit);
  EXPECT_EQ(run({"limits", "print"}), 74);
  EXPECT_THAT(run.people.str(), HasSubstr("standard output"));
}

}  // namespace
}  // namespace sixpoint::cli

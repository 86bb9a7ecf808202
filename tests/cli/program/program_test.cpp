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

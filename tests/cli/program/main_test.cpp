// The program as a process: arguments, both streams, exit code. Oracle: the contract's exit codes
// (sysexits.h, and 0 to 3), and the version that CMake was given.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <pty.h>
#include <termios.h>
#include <utmp.h>

#include "base/env.h"
#include "base/random.h"
#include "cli/program/interrupts.h"
#include "cli/run_child.h"
#include "expect_result.h"
#include "repair/jig_constants.h"
#include "repair/made_recording.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;

class Main : public testing::Test {
 protected:
  // By the shell, which can send streams anywhere.
  int run(const std::string& arguments) const {
    const std::string line = std::string(SIXPOINT_PROGRAM) + " " + arguments;
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string text(const std::string& name) const {
    std::ifstream in(folder_ / name);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  std::string to(const std::string& out, const std::string& people) const {
    return " >" + (folder_ / out) + " 2>" + (folder_ / people);
  }
  void expect_ended_by(int signal);
  tests::TemporaryFolder folder_;
};

TEST_F(Main, AnswersOnStandardOutputAndEndsWithItsCode) {
  EXPECT_EQ(run("--version" + to("o", "e")), 0);
  EXPECT_EQ(text("o"), "sixpoint " SIXPOINT_VERSION "\n");
  EXPECT_EQ(text("e"), "");
  EXPECT_EQ(run("inspect " + (folder_ / "none.gt3x") + to("o", "e")), 66);
  EXPECT_EQ(text("o"), "") << "stdout is for data";
  EXPECT_THAT(text("e"), testing::AllOf(testing::StartsWith("sixpoint: "), HasSubstr("none.gt3x")));
}

TEST_F(Main, ArgumentsOfTheProgramAreNotItsName) {
  EXPECT_EQ(run(to("o", "e")), 64) << "no command";
  EXPECT_EQ(run("sixpoint units" + to("o", "e")), 64);
  EXPECT_EQ(run("units ''" + to("o", "e")), 64) << "an empty argument is one";
}

TEST_F(Main, AnOutputThatTakesNothingIsAnError) {
  EXPECT_EQ(run("limits print >/dev/full 2>" + (folder_ / "e")), 74);
  EXPECT_EQ(run("scan --help >/dev/full 2>" + (folder_ / "e")), 74);
  EXPECT_THAT(text("e"), HasSubstr("standard output"));
}

// Without them the first file that is opened would get the number of a stream that is closed, and
// what is printed would be written into it.
TEST_F(Main, WhatIsPrintedOnAClosedStreamGoesIntoNoFile) {
  const std::string jig = "jig --device virtual:seed=7,jig=auto --store " + (folder_ / "j.db") +
                          " --record " + (folder_ / "r.zip");
  EXPECT_EQ(run(jig + " >" + (folder_ / "o") + " 2>&-"), 0);
  EXPECT_EQ(run("session show " + (folder_ / "r.zip") + to("o", "e")), 0) << text("e");
  EXPECT_EQ(run("audit verify --store " + (folder_ / "j.db") + to("o", "e")), 0) << text("e");

  std::ofstream(folder_ / "s.json") << R"({"schema": "sixpoint/scenario/1", "seed": 1, "unit": {},
    "motions": [{"kind": "free_living", "duration_s": 60}]})";
  ASSERT_EQ(run("simulate --scenario " + (folder_ / "s.json") + " -o " + (folder_ / "r.gt3x") +
                " <&- >" + (folder_ / "o") + " 2>&-"),
            0);
  EXPECT_EQ(run("inspect " + (folder_ / "r.gt3x") + to("o", "e")), 0) << text("e");
  for (const std::string& streams : {" >&- 2>" + (folder_ / "e"), std::string(" <&- >&- 2>&-")}) {
    SCOPED_TRACE(streams);
    std::filesystem::remove_all(folder_ / "out");
    EXPECT_EQ(run("repair " + (folder_ / "r.gt3x") + " --scan -o " + (folder_ / "out") + streams),
              74)
        << "the answer could not be written";
    EXPECT_EQ(text("out/.sixpoint-repair.lock"), "");
  }
  EXPECT_THAT(text("e"), HasSubstr("standard output"));
  EXPECT_EQ(run("inspect " + (folder_ / "r.gt3x") + to("o", "e")), 0) << text("e");
}

// As a full disk: the work ends in order, and no part of a file stays.
TEST_F(Main, AFileThatIsLargerThanItsLimitEndsAsOnAFullDisk) {
  std::ofstream(folder_ / "s.json") << R"({"schema": "sixpoint/scenario/1", "seed": 1, "unit": {},
    "motions": [{"kind": "free_living", "duration_s": 1800}]})";
  std::ofstream(folder_ / "c.json") << tests::kConstants;
  const std::string recording = folder_ / "r.gt3x";
  tests::MadeRecording made;
  Random random(1);
  for (int i = 0; i < 9000; ++i) {
    made.raw.push_back({static_cast<int>(random.below(700)) - 300,
                        static_cast<int>(random.below(700)) - 300,
                        static_cast<int>(random.below(700)) - 300});
  }
  ASSERT_OK(made.write(posix_env().files, recording));
  for (const std::string& work :
       {"export " + recording + " --csv " + (folder_ / "out/x.csv"),
        "simulate --scenario " + (folder_ / "s.json") + " -o " + (folder_ / "out/x.gt3x"),
        "repair " + recording + " --constants " + (folder_ / "c.json") + " -o " +
            (folder_ / "out")}) {
    SCOPED_TRACE(work);
    std::filesystem::remove_all(folder_ / "out");
    std::filesystem::create_directory(folder_ / "out");
    const std::string line =
        "ulimit -f 16; " + std::string(SIXPOINT_PROGRAM) + " " + work + to("o", "e");
    const int status = std::system(line.c_str());
    ASSERT_TRUE(WIFEXITED(status)) << "a signal ended it";
    EXPECT_EQ(WEXITSTATUS(status), 74);
    EXPECT_THAT(text("o") + text("e"), testing::AllOf(HasSubstr("too large"), HasSubstr("ulimit")));
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "out")) {
      EXPECT_FALSE(entry.path().filename().string().find("x.") != std::string::npos) << entry;
      EXPECT_NE(entry.path().extension(), ".tmp") << entry;
      EXPECT_NE(entry.path().extension(), ".gt3x") << entry;
    }
  }
}

// In a command that has nothing to end in order: here one that would work for a long time.
void Main::expect_ended_by(int signal) {
  std::ofstream(folder_ / "s.json") << R"({"schema": "sixpoint/scenario/1", "seed": 1, "unit": {},
    "motions": [{"kind": "free_living", "duration_s": 8640000}]})";
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // This process may ignore or block it, and so would its child.
    ::signal(signal, SIG_DFL);
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    const std::string script = "exec " + std::string(SIXPOINT_PROGRAM) + " simulate --scenario " +
                               (folder_ / "s.json") + " -o " + (folder_ / "out.gt3x") +
                               to("o", "e");
    ::execl("/bin/sh", "sh", "-c", script.c_str(), nullptr);
    ::_exit(127);
  }
  // At work once its file is begun; before it minds the signal, the signal would just end it.
  const auto begun = [&] {
    const std::filesystem::directory_iterator all(folder_.path());
    return std::any_of(begin(all), end(all), [](const auto& entry) {
      return entry.path().filename().string().starts_with(".out.gt3x");
    });
  };
  for (int tenths = 0; tenths < 600 && !begun(); ++tenths) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  EXPECT_TRUE(begun());
  ASSERT_EQ(::kill(child, signal), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 3) << text("e");
  EXPECT_EQ(text("e"), signal == SIGPIPE ? "" : "\nsixpoint: stopped; nothing was written\n");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out.gt3x"));
  EXPECT_FALSE(begun()) << "a temporary file stays";
}

TEST(StoppedText, FollowsTheTable) {
  const auto says = [](const std::vector<std::string>& line) { return text_when_stopped(line); };
  EXPECT_EQ(says({"archive", "plan", "a", "-o", "p"}), "\nsixpoint: stopped; no plan was made\n");
  for (const char* command : {"scan", "inspect", "simulate"}) {
    EXPECT_EQ(says({command, "a"}), "\nsixpoint: stopped; nothing was written\n");
  }
  EXPECT_THAT(says({"capture", "--device", "drive:d"}), HasSubstr("begin the capture again"));
  const char* again = "\nsixpoint: stopped; remove the folder 'K 1' and begin again\n";
  EXPECT_EQ(says({"gap", "challenge", "--trials", "9", "--export", "K 1"}), again);
  EXPECT_EQ(says({"gap", "challenge", "--export=K 1", "--trials", "9"}), again);
  EXPECT_THAT(says({"gap", "challenge", "--trials", "9"}), HasSubstr("this line goes on"));
  const std::string begins =
      "\nsixpoint: stopped; what is done stays, and this line begins again:\n";
  EXPECT_EQ(says({"export", "a b", "-o", "o"}), begins + "  sixpoint export --force 'a b' -o o\n");
  EXPECT_EQ(says({"export", "--output=o", "--force", "--", "a"}),
            begins + "  sixpoint export --output=o --force -- a\n");
  EXPECT_EQ(says({"store", "export", "--csv", "-o", "o"}),
            begins + "  sixpoint store export --force --csv -o o\n");
  const std::string goes_on = "\nsixpoint: stopped; what is done stays, and this line goes on:\n";
  EXPECT_EQ(says({"store", "export", "-o", "s.jsonl"}),
            goes_on + "  sixpoint store export -o s.jsonl\n");
  EXPECT_EQ(says({"export", "a b", "--csv", "o"}), goes_on + "  sixpoint export 'a b' --csv o\n");
  EXPECT_EQ(says({"repair", "-o", "o", "--", "a"}),
            goes_on + "  sixpoint repair --resume -o o -- a\n");
  EXPECT_EQ(says({"repair", "a", "-o", "o", "--resume"}),
            goes_on + "  sixpoint repair a -o o --resume\n");
  EXPECT_THAT(says({"export", "a\nb"}), HasSubstr("export $'a\\x0ab'\n")) << "one line";
  EXPECT_THAT(says({}), HasSubstr("this line goes on"));
}

TEST_F(Main, CtrlCEndsWithThreeAndSaysSo) { expect_ended_by(SIGINT); }

// As a batch system and `kill` send it.
TEST_F(Main, SigtermDoesTheSame) { expect_ended_by(SIGTERM); }

// As a terminal sends it that is closed.
TEST_F(Main, SighupDoesTheSame) { expect_ended_by(SIGHUP); }

// As a pipe sends it whose reader has gone, such as `head`.
TEST_F(Main, SigpipeDoesTheSameAndIsSilent) { expect_ended_by(SIGPIPE); }

// The pipe takes some of the document, and nobody reads: the program is in the midst of it when the
// signal comes.
TEST_F(Main, ADocumentIsWholeAlsoWhenTheProgramIsStopped) {
  std::filesystem::create_directory(folder_ / "archive");
  std::vector<std::string> scan = {"scan", "--json"};
  for (int i = 0; i < 1000; ++i) {
    scan.push_back(folder_ / ("archive/" + std::to_string(i) + ".gt3x"));
    std::ofstream(scan.back()) << "no recording";
  }
  const std::vector<std::string> plan = {"archive",        "plan",   folder_ / "archive", "-o",
                                         folder_ / "plan", "--scan", "--dry-run",         "--json"};
  for (const std::vector<std::string>& line : {scan, plan}) {
    for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
      SCOPED_TRACE(line.front() + " " + std::to_string(signal));
      tests::Child child(line);
      ASSERT_TRUE(child.fills_its_pipe());
      child.send(signal);
      const auto document = nlohmann::json::parse(child.rest(), nullptr, false);
      ASSERT_TRUE(document.is_object()) << "a half";
      EXPECT_EQ(document["files"].size(), 1000U);
      EXPECT_EQ(child.wait(), line == scan ? 65 : 0) << "the signal came too late";
    }
  }
}

// A reader that has enough, such as `head -1`, takes the answer alone: the manifest is there.
TEST_F(Main, ARepairWhoseReaderGoesLeavesItsManifest) {
  std::filesystem::create_directory(folder_ / "study");
  for (int i = 0; i < 2000; ++i) {
    std::ofstream(folder_ / ("study/" + std::to_string(i) + ".gt3x")) << "no recording";
  }
  const std::string line = "repair " + (folder_ / "study") + " --scan -o " + (folder_ / "out");
  // The shell's own exit code is that of the reader.
  const std::string keep_code = "; echo $? >" + (folder_ / "code") + "; }";
  run("--version >/dev/null; { " + std::string(SIXPOINT_PROGRAM) + " " + line + " 2>" +
      (folder_ / "e") + keep_code + " | head -1 >/dev/null");
  EXPECT_EQ(text("code"), "3\n") << text("e");
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/manifest.csv"));
  EXPECT_EQ(run(line + " --resume" + to("o", "e")), 65) << "the line that goes on: " << text("e");
}

TEST_F(Main, CtrlCAtThePromptForAPinLeavesATerminalThatShowsWhatIsTyped) {
  int program = -1;
  int terminal = -1;
  ASSERT_EQ(::openpty(&program, &terminal, nullptr, nullptr, nullptr), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::close(program);
    ::login_tty(terminal);
    ::setenv("HOME", folder_.path().c_str(), 1);
    ::unsetenv("XDG_DATA_HOME");
    ::execl(SIXPOINT_PROGRAM, "sixpoint", "operator", "add", "Ada", nullptr);
    ::_exit(127);
  }
  const auto shows = [&] {
    termios now{};
    return ::tcgetattr(terminal, &now) == 0 && (now.c_lflag & ECHO) != 0;
  };
  EXPECT_TRUE(shows());
  for (int hundredths = 0; hundredths < 6000 && shows(); ++hundredths) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_FALSE(shows()) << "it asks for the PIN";
  ASSERT_EQ(::write(program, "\x03", 1), 1);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 3);
  EXPECT_TRUE(shows());
  ::close(program);
  ::close(terminal);
}

// A bar is for a terminal, and a file is none.
TEST_F(Main, NoProgressIsDrawnIntoAFile) {
  std::ofstream(folder_ / "x.gt3x") << "no recording";
  run("scan " + folder_.path() + to("o", "e"));
  EXPECT_EQ(text("e").find('\r'), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::cli

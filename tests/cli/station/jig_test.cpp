// sixpoint jig by its contract, on the real disk.
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include <sys/wait.h>
#include <unistd.h>

#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::CommandTest;
using tests::kDevice;

std::string said_in(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// Oracle: the sensor that the device string names.
TEST_F(CommandTest, JigFindsTheSensorAndStoresIt) {
  const auto answer = run({"jig", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"),
                           "--operator", "A", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const nlohmann::json json = nlohmann::json::parse(answer.out);
  EXPECT_EQ(json.begin().key(),
            "as_found");  // nlohmann::json sorts; the document itself is ordered
  EXPECT_EQ(answer.out.find("\"schema\": \"sixpoint/jig/1\""), 4U);
  EXPECT_EQ(json["serial"], "MOS2A45130007");
  EXPECT_EQ(json["filter"], "current");
  EXPECT_EQ(json["verdict"], "pass");
  EXPECT_EQ(json["poses"].size(), 6U);
  const double sensitivity[] = {237.7, 251.8, 242.3};
  const double zero[] = {49.9, 95.8, 60.8};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(1 / json["constants"]["sensitivity_g_per_lsb"][axis].get<double>(),
                sensitivity[axis], 0.3);
    EXPECT_NEAR(json["constants"]["zero_lsb"][axis].get<double>(), zero[axis], 0.3);
  }
  EXPECT_LT(json["verification"]["residual_mg"].get<double>(), 2);
  EXPECT_TRUE(json["certificate"].is_null());
  EXPECT_FALSE(json["run"].get<std::string>().empty());

  const auto history = run({"history", "MOS2A45130007", "--store", path("s.db"), "--json"});
  EXPECT_EQ(history.exit_code, 0);
  const nlohmann::json constants = nlohmann::json::parse(history.out)["constants"];
  ASSERT_EQ(constants.size(), 1U);
  EXPECT_EQ(constants[0]["id"], json["stored_id"]);
  EXPECT_EQ(constants[0]["filter"], "current");
  EXPECT_EQ(run({"audit", "verify", "--store", path("s.db")}).exit_code, 0);
}

class ClockAhead final : public Clock {
 public:
  UtcTime now() override { return posix_env().clock.now() + std::chrono::days(1000); }
  std::chrono::nanoseconds elapsed() override { return posix_env().clock.elapsed(); }
  void sleep(std::chrono::nanoseconds duration) override { posix_env().clock.sleep(duration); }
};

// Constants that were measured under a clock that was ahead come before those that are measured now.
TEST_F(CommandTest, JigSaysWhichConstantsApplyWhereItsOwnDoNot) {
  const auto jig = [&](Clock& clock, const std::string& device) {
    Env env{clock, posix_env().files};
    return tests::run_command(
        env, {"jig", "--device", device, "--jig", "virtual", "--store", path("s.db")});
  };
  ClockAhead ahead;
  EXPECT_THAT(jig(ahead, kDevice).people, testing::Not(HasSubstr("was stored, but")));
  std::string now = kDevice;
  now.replace(now.rfind("49.9"), 4, "59.9");
  const auto answer = jig(posix_env().clock, now);
  EXPECT_EQ(answer.exit_code, 0) << "it passed, and is stored";
  const auto constants =
      run({"history", "MOS2A45130007", "--store", path("s.db"), "--json"}).json()["constants"];
  ASSERT_EQ(constants.size(), 2U);
  const std::string first = db::shown_id(constants[0]["id"].get<std::string>());
  const std::string day = constants[0]["made_at"].get<std::string>().substr(0, 10);
  EXPECT_THAT(answer.people, HasSubstr("was stored, but " + first + " of " + day + " applies"));
  EXPECT_THAT(answer.people, HasSubstr("in the future"));
  EXPECT_THAT(answer.people, HasSubstr("'sixpoint store withdraw " + first + " --why TEXT'"));
  EXPECT_EQ(
      run({"store", "withdraw", first, "--why", "a clock", "--store", path("s.db")}).exit_code, 0);
  EXPECT_THAT(jig(posix_env().clock, now).people, testing::Not(HasSubstr("was stored, but")));
}

TEST_F(CommandTest, JigRefusesByTheContractsCodes) {
  const auto code_of = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"jig", "--store", path("s.db")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments).exit_code;
  };
  EXPECT_EQ(code_of({"--device", "virtual:colour=red"}), 64);
  EXPECT_EQ(code_of({"--device", "serial:1"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "robot"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "virtual", "--filter", "new"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "virtual", "--filter", "legacy"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "manual"}), 2)
      << "the unit is never turned: inconclusive";
  EXPECT_EQ(code_of({}), 64);
  for (const char* option : {"--station", "--jig-id", "--operator"}) {
    for (const std::string& name :
         {std::string("bench \xff"), std::string(201, 'x'), std::string("Ada\nEve")}) {
      EXPECT_EQ(code_of({"--device", kDevice, "--jig", "virtual", option, name}), 64) << option;
    }
  }
}

TEST_F(CommandTest, JigSaysOnceWhyARunHasNoPapers) {
  const auto answer = run({"jig", "--store", path("s.db"), "--device", kDevice, "--jig", "manual",
                           "--write", "--certificate", path("c.pdf"), "--label", path("l.zpl")});
  EXPECT_EQ(answer.exit_code, 2);
  const std::size_t first = answer.people.find("has no result to certify");
  ASSERT_NE(first, std::string::npos) << answer.people;
  EXPECT_EQ(answer.people.find("has no result to certify", first + 1), std::string::npos)
      << answer.people;
  EXPECT_THAT(answer.people, testing::ContainsRegex("run [0-9a-f]{12} ended as 'inconclusive'"));
}

// Ctrl-C in a run by a jig: the motor stops, the run is stored as stopped, exit 3.
// The table of who_measures() (cli/station/operator.h), row by row. Oracle: the certificate.
TEST_F(CommandTest, JigAsksForThePinWhereThereAreOperators) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  int number = 0;
  const auto measured = [&](const std::string& name, const std::string& typed,
                            const std::vector<std::string>& more = {}) {
    const std::string certificate = path("c" + std::to_string(++number) + ".json");
    std::vector<std::string> words = {"jig",      "--device",   "virtual:seed=7,jig=auto",
                                      "--store",  path("p.db"), "--certificate",
                                      certificate};
    if (!name.empty()) {
      words.insert(words.end(), {"--operator", name});
    }
    words.insert(words.end(), more.begin(), more.end());
    const int exit_code = tests::run_command(posix_env(), words, typed).exit_code;
    std::ifstream in(certificate);
    const auto json = cli::Json::parse(in, nullptr, false);
    return std::pair(exit_code, json.is_object() && json["operator_authenticated"] == true);
  };
  EXPECT_EQ(measured("Ada", ""), std::pair(0, false)) << "no operators";
  ASSERT_EQ(tests::run_command(posix_env(), {"operator", "add", "Ada"}, "471100\n").exit_code, 0);
  EXPECT_EQ(measured("Ada", "471100\n"), std::pair(0, true));
  EXPECT_EQ(measured("Ada", "471101\n"), std::pair(77, false));
  EXPECT_EQ(measured("Ada", ""), std::pair(77, false));
  EXPECT_EQ(measured("Bo", "471100\n"), std::pair(77, false));
  EXPECT_EQ(measured("", "471100\n"), std::pair(77, false));
  std::ofstream(path("pin")) << "471100\r\nmore\n";
  EXPECT_EQ(measured("Ada", "", {"--pin-file", path("pin")}), std::pair(0, true));
  std::ofstream(path("wrong")) << "1234\n";
  EXPECT_EQ(measured("Ada", "471100\n", {"--pin-file", path("wrong")}), std::pair(77, false));
  EXPECT_EQ(measured("Ada", "", {"--pin-file", path("none")}), std::pair(66, false));
  // An exception for an overdue jig is an engineer's, by the engineer's PIN.
  const auto excepted = [&](const std::string& by, const std::string& typed) {
    return measured("Ada", typed,
                    {"--pin-file", path("pin"), "--jig-due", "2001-01-01", "--jig-exception",
                     "no other jig", "--jig-exception-by", by});
  };
  ASSERT_EQ(
      tests::run_command(posix_env(), {"operator", "add", "Eve", "--role", "engineer"}, "081500\n")
          .exit_code,
      0);
  EXPECT_EQ(excepted("Eve", "081500\n"), std::pair(0, true));
  EXPECT_EQ(excepted("Eve", ""), std::pair(77, false));
  EXPECT_EQ(excepted("Ada", "471100\n"), std::pair(77, false)) << "a technician";
  ::unsetenv("XDG_DATA_HOME");
}

// Starts the program with `words` in `folder`, sends SIGINT once it has said `sign`, and gives its
// JSON.
void stop_by_ctrl_c(const std::string& folder, const std::string& words, const std::string& sign,
                    nlohmann::json& json) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const std::string script = "cd " + folder + " && exec " + SIXPOINT_PROGRAM + " " + words +
                               " --store s.db --json > o 2> e";
    ::execl("/bin/sh", "sh", "-c", script.c_str(), nullptr);
    ::_exit(127);
  }
  for (int i = 0; i < 500 && said_in(folder + "/e").find(sign) == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  ASSERT_EQ(::kill(child, SIGINT), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 3) << said_in(folder + "/e");
  json = nlohmann::json::parse(said_in(folder + "/o"), nullptr, false);
  ASSERT_TRUE(json.is_object()) << said_in(folder + "/o");
  EXPECT_EQ(json["verdict"], "stopped");
}

TEST_F(CommandTest, CtrlCInAnAutomaticCaptureEndsItInOrder) {
  nlohmann::json json;
  stop_by_ctrl_c(path("."),
                 "capture --device virtual:seed=7,jig=auto,pace=real -o c.gt3x --record s.zip",
                 "side 1 of 6", json);
  EXPECT_FALSE(std::filesystem::exists(path("c.gt3x")));
  EXPECT_TRUE(std::filesystem::exists(path("s.zip"))) << "the session is whole";
  EXPECT_FALSE(std::filesystem::exists(path("s.zip.journal")));
}

TEST_F(CommandTest, CtrlCInAnAutomaticRunStoresItAsStopped) {
  nlohmann::json json;
  stop_by_ctrl_c(path("."), "jig --device virtual:seed=7,jig=auto,pace=real", "turn the unit",
                 json);
  ASSERT_TRUE(json.is_object());
  const auto history =
      run({"history", json["serial"].get<std::string>(), "--store", path("s.db"), "--json"});
  EXPECT_THAT(history.out, HasSubstr("stopped"));
}

// As `| head` does it, and a terminal that is closed while its output goes through a pipe.
TEST_F(CommandTest, AReaderThatGoesStopsAnAutomaticRunInOrder) {
  const std::string line = std::string(SIXPOINT_PROGRAM) +
                           " jig --device virtual:seed=7,serial=MOS2A45130007,jig=auto,pace=20"
                           " --store " +
                           path("s.db") + " 2>&1 | head -n 4 > " + path("o");
  ASSERT_EQ(std::system(line.c_str()), 0);
  EXPECT_FALSE(said_in(path("o")).empty());
  EXPECT_THAT(run({"history", "MOS2A45130007", "--store", path("s.db"), "--json"}).out,
              HasSubstr("stopped"));
}

// The first command that --help shows ends in a pass.
TEST_F(CommandTest, TheFirstCommandOfHelpEndsInAPass) {
  const std::string help = run({"--help"}).out;
  const std::string first = "  sixpoint jig ";
  const std::size_t begin = help.find(first);
  ASSERT_NE(begin, std::string::npos) << help;
  std::istringstream line(help.substr(begin, help.find('\n', begin) - begin));
  std::vector<std::string> words;
  for (std::string word; line >> word;) {
    words.push_back(word == "bench.db" ? path("s.db") : word);
  }
  words.erase(words.begin());
  const auto passed = run(words);
  EXPECT_EQ(passed.exit_code, 0);
  auto next = next_of(passed);
  ASSERT_EQ(next.size(), 6U) << passed.people;
  EXPECT_THAT(next[3], testing::EndsWith(".pdf"));
  next[3] = path(next[3]);
  EXPECT_EQ(run(next).exit_code, 0);
}

// The table of what_it_holds() in cli/station/jig.cpp; its row of a run that was stopped behind a
// write is in faults_test.cpp.
TEST_F(CommandTest, APassSaysWhetherTheUnitHoldsIt) {
  const std::string device = "virtual:seed=7,jig=auto";
  const auto written =
      run({"jig", "--device", device, "--store", path("s.db"), "--write", "--label", path("l.zpl"),
           "--certificate", path("c.json"), "--record", path("r.zip")});
  EXPECT_EQ(written.exit_code, 0) << written.people;
  EXPECT_THAT(written.out, HasSubstr("\n  PASS - WRITTEN: "));
  EXPECT_THAT(written.out, HasSubstr("certificate " + path("c.json")));
  EXPECT_THAT(written.out, HasSubstr("label " + path("l.zpl")));
  EXPECT_THAT(run({"jig", "--device", device, "--store", path("s.db")}).out,
              HasSubstr("\n  PASS - NOT WRITTEN: "));
  EXPECT_THAT(
      run({"jig", "--device", "replay:" + path("r.zip"), "--store", path("s.db"), "--write"}).out,
      testing::Not(HasSubstr("WRITTEN")));
}

TEST_F(CommandTest, AnOverdueJigMeasuresNothingWithoutASignedException) {
  std::vector<std::string> words = {"jig",     "--device",   kDevice,  "--jig",     "virtual",
                                    "--store", path("s.db"), "--json", "--jig-due", "2001-01-01"};
  const auto refused = run(words);
  EXPECT_EQ(refused.exit_code, 78);
  EXPECT_THAT(refused.people, HasSubstr("due for its own calibration on 2001-01-01"));
  words.insert(words.end(), {"--jig-exception", "no other jig"});
  EXPECT_EQ(run(words).exit_code, 64) << "who signs?";
  words.insert(words.end(), {"--jig-exception-by", "Eve"});
  const auto measured = run(words);
  EXPECT_EQ(measured.exit_code, 0) << measured.people;
  EXPECT_THAT(measured.out, HasSubstr("Eve signed: no other jig"));
}

// Every reader of a stored run sees the six poses and the eight that judge them.
TEST_F(CommandTest, ProductionPlusFromRunToDiagnosis) {
  const auto measured = [&](const std::string& protocol, const std::string& noise) {
    const auto answer =
        run({"jig", "--device", std::string(kDevice) + ",noise=" + noise, "--jig", "virtual",
             "--store", path("s.db"), "--protocol", protocol, "--certificate",
             path("c" + noise + ".json"), "--operator", "A", "--json"});
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    return answer;
  };
  const auto plus = measured("production+", "1");
  const nlohmann::json json = nlohmann::json::parse(plus.out);
  EXPECT_EQ(json["protocol"], "production+");
  EXPECT_EQ(json["poses"].size(), 6U);
  EXPECT_EQ(json["half_turn"].size(), 3U);
  EXPECT_THAT(plus.people, HasSubstr("half a turn about the vertical, on +x"));
  const nlohmann::json plain = nlohmann::json::parse(measured("production", "2").out);
  EXPECT_EQ(plain["protocol"], "production");
  for (const char* which : {"c1.json", "c2.json"}) {
    const auto certificate = nlohmann::json::parse(said_in(path(which)), nullptr, false);
    EXPECT_EQ(certificate["poses"].size(), 6U) << which;
  }
  const auto diagnosed = run({"gap", "diagnose", "--run", json["run"].get<std::string>(), "--store",
                              path("s.db"), "--json"});
  EXPECT_EQ(diagnosed.exit_code, 0) << diagnosed.people;
  EXPECT_EQ(nlohmann::json::parse(diagnosed.out)["verdict"], "no_gap");
  const auto trends = run({"gap", "trends", "--store", path("s.db"), "--json"});
  EXPECT_EQ(nlohmann::json::parse(trends.out)["left_out"], 0);
  EXPECT_EQ(run({"audit", "verify", "--store", path("s.db")}).exit_code, 0);
}

TEST_F(CommandTest, ProductionPlusNeedsAJigThatTurnsAboutTheVertical) {
  const auto answer = run({"jig", "--device", kDevice, "--jig", "virtual:serial=J600001", "--store",
                           path("s.db"), "--protocol", "production+"});
  EXPECT_EQ(answer.exit_code, 64);
  EXPECT_THAT(answer.people, HasSubstr("--jig manual"));
  EXPECT_EQ(answer.people.find("turn the unit to"), std::string::npos) << "nothing was asked for";
  EXPECT_EQ(run({"jig", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"),
                 "--protocol", "engineering"})
                .exit_code,
            64);
}

// A power cut between two half-turned readings.
TEST_F(CommandTest, ProductionPlusGoesOnAfterACrash) {
  const std::string device = "virtual:seed=7,jig=auto";
  const std::string rest =
      " --protocol production+ --store " + path("s.db") + " --state " + path("state");
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const std::string script = "exec " + std::string(SIXPOINT_PROGRAM) + " jig --device " + device +
                               ",pace=50" + rest + " > " + path("o") + " 2> " + path("e");
    ::execl("/bin/sh", "sh", "-c", script.c_str(), nullptr);
    ::_exit(127);
  }
  const auto saved_half_turn = [&] {
    std::error_code none;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path("state"), none)) {
      if (entry.path().filename() == "run.json" &&
          said_in(entry.path()).find("\"turned_deg\": 180") != std::string::npos) {
        return true;
      }
    }
    return false;
  };
  for (int i = 0; i < 6000 && !saved_half_turn(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_EQ(::kill(child, SIGKILL), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status)) << said_in(path("e"));
  std::istringstream more(rest);
  std::vector<std::string> words = {"jig", "--device", device, "--json"};
  for (std::string word; more >> word;) {
    words.push_back(word);
  }
  std::vector<std::string> elsewhere = words;
  elsewhere.insert(elsewhere.end(), {"--jig-id", "J-2"});
  const auto refused = run(elsewhere);
  EXPECT_EQ(refused.exit_code, 64) << "the readings that are there are of another jig";
  EXPECT_THAT(refused.people,
              HasSubstr("leave --jig-id out, as when it was begun, and the run goes on"));
  const auto answer = run(words);
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_THAT(answer.people, testing::ContainsRegex("goes on; it has 1[56] placements"));
  EXPECT_EQ(answer.people.find("turn the unit to"), std::string::npos) << "only what was left";
  EXPECT_EQ(answer.json()["half_turn"].size(), 3U);
}

}  // namespace
}  // namespace sixpoint::cli

// The tables of docs/faults.md with the program as people run it, over umockdev: what it prints,
// what it ends with, and what it keeps.
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "faults_page.h"
#include "temporary_folder.h"
#include "usb/child.h"
#include "usb/technician.h"
#include "usb/umockdev_bench.h"

namespace sixpoint::tests {
namespace {

struct ProgramFault {
  const char* name;
  const char* faults;  // of the plan
  std::vector<const char*> more;
  int exit_code;
  const char* says;  // on stderr or stdout
  int leaves = 0;    // how often it leaves the bus
  int comes_back = 0;
};

void PrintTo(const ProgramFault& fault, std::ostream* out) { *out << fault.name; }

struct Ended {  // NOLINT(bugprone-exception-escape): json's destructor asserts
  ChildAnswer answer;
  nlohmann::json document;   // the answer's
  nlohmann::json constants;  // that the store holds
};

// Runs a command with a unit of its own on the bench, under the row's plan; a technician turns it.
Ended run_under_plan(UmockdevBench& bench, const ProgramFault& fault, std::uint64_t seed, int pace,
                     std::vector<std::string> arguments, const TemporaryFolder& folder,
                     sim::UnitTruth& truth, const std::string& input) {
  Ended ended;
  auto plan = mocks::parse_fault_plan(
      std::string(R"({"schema": "sixpoint/faults/1", "faults": [)") + fault.faults + "]}");
  EXPECT_OK(plan);
  if (!plan) {
    return ended;
  }
  BenchUnit unit = make_unit(seed, *std::move(plan), pace);
  const std::string serial = unit.serial;
  truth = unit.unit->unit.truth();
  EXPECT_OK(bench.plug_in(unit));
  std::atomic<bool> over = false;
  // The cable or the hub: sees the unit leave by its plan, and it comes back into the same port.
  auto cable = std::async(std::launch::async, [&]() -> Status {
    for (int i = 0; i < fault.leaves; ++i) {
      const std::string port = unit.port;
      while (!bench.wait_until_left(unit)) {
        if (over) {
          return fail(ErrorCode::internal, "the unit did not leave the bus");
        }
      }
      if (i < fault.comes_back) {
        SIXPOINT_CHECK(bench.plug_in(unit, port));
      }
    }
    return {};
  });
  Technician technician(unit);
  const std::string store = folder / std::string(fault.name) + ".db";
  arguments.insert(arguments.end(),
                   {"--device", "hid:" + serial, "--jig", "manual", "--json", "--store", store});
  arguments.insert(arguments.end(), fault.more.begin(), fault.more.end());
  ended.answer = run_child(
      arguments, [&](const std::string& line) { technician.on_line(line); }, input);
  over = true;
  EXPECT_OK(cable.get());
  if (!unit.port.empty()) {
    bench.unplug(unit);
  }
  EXPECT_EQ(ended.answer.exit_code, fault.exit_code) << ended.answer.people << ended.answer.out;
  EXPECT_NE((ended.answer.people + ended.answer.out).find(fault.says), std::string::npos)
      << ended.answer.people << ended.answer.out;
  ended.document = nlohmann::json::parse(ended.answer.out, nullptr, false);
  const ChildAnswer history = run_child({"history", serial, "--store", store, "--json"});
  const auto stored = nlohmann::json::parse(history.out, nullptr, false);
  ended.constants = stored.is_object() && stored.contains("constants") ? stored["constants"]
                                                                       : nlohmann::json::array();
  EXPECT_EQ(ended.constants.size(), fault.exit_code == 0 ? 1U : 0U)
      << "what was judged good is stored, and nothing else";
  return ended;
}

// Oracle: what the simulated sensor really is.
void expect_constants(const nlohmann::json& constants, const sim::UnitTruth& truth, double share,
                      double zero_lsb) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(constants["sensitivity_g_per_lsb"][axis].get<double>() *
                    truth.current.sensitivity_lsb_per_g[axis],
                1, share);
    EXPECT_NEAR(constants["zero_lsb"][axis].get<double>(), truth.current.zero_lsb[axis], zero_lsb);
  }
}

const std::vector<ProgramFault>& jig_rows() {
  static const std::vector<ProgramFault> kRows = {
      // A poor cable and a poor unit, all at once: none of it reaches the constants.
      {"poor_cable",
       R"({"fault": "bad_page", "at_s": 0},
          {"fault": "full_flash", "at_s": 0},
          {"fault": "stall", "of": "replies", "at_report": 3},
          {"fault": "lost", "of": "replies", "at_report": 6},
          {"fault": "bad_crc", "of": "replies", "at_report": 9},
          {"fault": "duplicate", "at_report": 2, "every": 3},
          {"fault": "delay", "of": "samples", "at_report": 40, "seconds": 0.5},
          {"fault": "garbage", "of": "samples", "at_report": 70},
          {"fault": "bit_flip", "of": "samples", "at_report": 150, "bit": 6},
          {"fault": "short_packet", "of": "samples", "at_report": 230},
          {"fault": "wrong_sequence", "of": "samples", "at_report": 310},
          {"fault": "clock_jump", "of": "samples", "at_report": 350, "seconds": 4})",
       {"--write"},
       0,
       "unreadable"},
      // Thrice away, in three ways; each time it is found again, also under another node.
      {"away_and_back",
       R"({"fault": "reset", "of": "samples", "at_report": 60},
          {"fault": "unplug", "of": "samples", "at_report": 160, "seconds": 4},
          {"fault": "reenumerate", "of": "samples", "at_report": 260})",
       {},
       0,
       "it is back",
       2,
       2},
      {"gone",
       R"({"fault": "unplug", "of": "samples", "at_report": 60})",
       {"--patience", "2"},
       69,
       "did not come back within 2 s; plug it in",
       1},
      {"swap",
       R"({"fault": "swap", "of": "samples", "at_report": 60, "serial": "MOS2B99990009"})",
       {"--patience", "2"},
       69,
       "MOS2B99990009",
       1,
       1},
      {"frozen_sensor",
       R"({"fault": "frozen_sensor", "of": "samples", "at_report": 20})",
       {},
       1,
       "the sensor is frozen"},
      {"axis_stuck",
       R"({"fault": "axis_stuck", "of": "samples", "at_report": 20, "axis": "y"})",
       {},
       1,
       "y axis is stuck"},
      {"battery_low", R"({"fault": "battery_low", "at_s": 0})", {"--write"}, 74, "charge the unit"},
      // Power fails in the middle of the page write, and comes back.
      {"power_loss",
       R"({"fault": "power_loss", "at_s": 1, "bytes": 300, "seconds": 4})",
       {"--write"},
       0,
       "it is back",
       1,
       1},
      {"no_reply",
       R"({"fault": "lost", "of": "replies", "at_report": 4, "count": 0})",
       {},
       69,
       "does not answer"}};
  return kRows;
}

const std::vector<ProgramFault>& capture_rows() {
  // By the unit's clock the recording begins in the first minute and ends after five.
  static const std::vector<ProgramFault> kRows = {
      {"poor_cable",
       R"({"fault": "stall", "channel": "bulk", "at_report": 1},
          {"fault": "delay", "channel": "bulk", "at_report": 2, "seconds": 4},
          {"fault": "bit_flip", "channel": "bulk", "at_report": 3},
          {"fault": "garbage", "channel": "bulk", "at_report": 5},
          {"fault": "lost", "of": "replies", "at_report": 2},
          {"fault": "duplicate", "of": "replies", "at_report": 4})",
       {},
       0,
       "\"verified\""},
      {"poorer_cable",
       R"({"fault": "short_packet", "channel": "bulk", "at_report": 1, "bytes": 100},
          {"fault": "bad_crc", "channel": "bulk", "at_report": 2},
          {"fault": "lost", "channel": "bulk", "at_report": 4},
          {"fault": "duplicate", "channel": "bulk", "at_report": 5},
          {"fault": "wrong_sequence", "channel": "bulk", "at_report": 7})",
       {},
       0,
       "\"verified\""},
      {"unplug_in_download",
       R"({"fault": "unplug", "channel": "bulk", "at_report": 2, "seconds": 30})",
       {},
       0,
       "the unit came back",
       1,
       1},
      {"replug_while_recording",
       R"({"fault": "unplug", "at_s": 150, "seconds": 30})",
       {},
       0,
       "\"verified\"",
       1,
       1},
      {"gone",
       R"({"fault": "unplug", "at_s": 150})",
       {"--patience", "2"},
       69,
       "did not come back",
       1},
      {"swap",
       R"({"fault": "swap", "at_s": 150, "seconds": 30, "serial": "MOS2B99990009"})",
       {"--patience", "2"},
       69,
       "MOS2B99990009",
       1,
       1},
      {"reset", R"({"fault": "reset", "at_s": 150})", {}, 2, "had stopped recording by itself"},
      {"full_flash_before", R"({"fault": "full_flash", "at_s": 0})", {}, 74, "storage full"},
      // How much is missing, it cannot see of a unit whose clock runs so fast.
      {"full_flash", R"({"fault": "full_flash", "at_s": 150})", {}, 2, "incomplete"},
      {"battery_low", R"({"fault": "battery_low", "at_s": 0})", {}, 74, "charge the unit"},
      {"frozen_sensor",
       R"({"fault": "frozen_sensor", "at_s": 150})",
       {},
       1,
       "the sensor is frozen"},
      {"clock_jump",
       R"({"fault": "clock_jump", "at_s": 150, "seconds": 3600})",
       {},
       0,
       "jump by +3600 s"}};
  return kRows;
}

// Turns the unit of one row while the program works on it; a bus of its own for every row.
class ProgramFaultRow : public testing::TestWithParam<ProgramFault> {
 protected:
  void SetUp() override {
    auto made = mocks::UmockdevBus::make();
    ASSERT_OK(made);
    bench_ = std::make_unique<UmockdevBench>(std::move(*made));
    std::ofstream(enter_) << "\n\n\n\n\n\n";
  }
  // `judge` gets what passed.
  void run(int pace, const std::vector<std::string>& arguments,
           const std::function<void(const Ended&, const sim::UnitTruth&)>& judge) {
    constexpr std::uint64_t kSeed = 301;
    sim::UnitTruth truth;
    const Ended ended =
        run_under_plan(*bench_, GetParam(), kSeed, pace, arguments, folder_, truth, enter_);
    if (GetParam().exit_code == 0 && ended.document.is_object() && !ended.constants.empty()) {
      judge(ended, truth);
    }
  }
  const TemporaryFolder folder_;

 private:
  const std::string enter_ = folder_ / "enter";  // six times, for the prompts
  std::unique_ptr<UmockdevBench> bench_;
};
class JigFault : public ProgramFaultRow {};
class CaptureFault : public ProgramFaultRow {};

TEST_P(JigFault, EndsAsTheTableSays) {
  constexpr int kPace = 8;  // the unit's time passes so much faster than the program's
  run(kPace, {"jig", "--dwell", "0.5", "--filter", "current"},
      [](const Ended& ended, const sim::UnitTruth& truth) {
        EXPECT_EQ(ended.document["verdict"], "pass");
        // 0.7 % and 2 LSB: half a second of noise per pose.
        expect_constants(ended.document["constants"], truth, 0.007, 2);
      });
}

TEST_P(CaptureFault, EndsAsTheTableSays) {
  constexpr int kPace = 40;
  run(kPace, {"capture", "--side-seconds", "1", "--turn-seconds", "0.4", "-o", folder_ / "c.gt3x"},
      [](const Ended& ended, const sim::UnitTruth& truth) {
        EXPECT_EQ(ended.document["verified"], true) << ended.answer.out;
        // 1 % and 3 LSB: six sides of 40 s, at the paper's noise.
        expect_constants(ended.constants[0]["constants"], truth, 0.01, 3);
      });
}

const auto kNameOfRow = [](const testing::TestParamInfo<ProgramFault>& row) {
  return std::string(row.param.name);
};
INSTANTIATE_TEST_SUITE_P(Rows, JigFault, testing::ValuesIn(jig_rows()), kNameOfRow);
INSTANTIATE_TEST_SUITE_P(Rows, CaptureFault, testing::ValuesIn(capture_rows()), kNameOfRow);

// All rows at once, for they mostly wait. Each in a process of its own: programs that share a test
// bed take each other's event sockets, which umockdev names by descriptor, and a program that ends
// while another's unit is plugged in takes the test bed with it.
void run_rows(const std::string& suite, const std::vector<ProgramFault>& rows) {
  const std::string self = std::filesystem::read_symlink("/proc/self/exe");
  std::vector<ChildAnswer> answers(rows.size());
  std::vector<std::thread> programs;
  programs.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    programs.emplace_back([&, i] {
      answers[i] = run_program(
          {self, "--gtest_filter=Rows/" + suite + ".EndsAsTheTableSays/" + rows[i].name});
    });
  }
  for (std::thread& program : programs) {
    program.join();
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(answers[i].exit_code, 0) << rows[i].name << answers[i].people << answers[i].out;
    EXPECT_NE(answers[i].out.find("[  PASSED  ] 1 test."), std::string::npos) << answers[i].out;
  }
}

TEST(ProgramFaults, EndJigRunsAsInTheTable) { run_rows("JigFault", jig_rows()); }
TEST(ProgramFaults, EndCapturesAsInTheTable) { run_rows("CaptureFault", capture_rows()); }

// docs/faults.md lists where each fault is tested: its columns of this file are those of the rows
// above.
TEST(ProgramFaultsPage, ListsTheTestsOfThisFile) {
  EXPECT_EQ(faults_of_column("umockdev: `jig`"), faults_of_rows(jig_rows()));
  EXPECT_EQ(faults_of_column("umockdev: `capture`"), faults_of_rows(capture_rows()));
}

}  // namespace
}  // namespace sixpoint::tests

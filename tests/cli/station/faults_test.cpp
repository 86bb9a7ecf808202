// The table of docs/faults.md, row by row, through the program: what goes wrong in the unit or on
// its cable, what the program says, and what it keeps.
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "cli/devices/known_devices.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "faults_page.h"
#include "mocks/faults/fault_plan.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_jig.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;

constexpr const char* kUnit =
    "virtual:seed=7,serial=MOS2A45130007,true_sensitivity_lsb_per_g=237.7/251.8/242.3,"
    "true_zero_lsb=49.9/95.8/60.8,jig=auto";

struct Row {
  const char* name;
  const char* faults;  // JSON of one fault or several
  int exit_code;
  const char* says;  // in what people or scripts read
  bool writes = false;
};

void PrintTo(const Row& row, std::ostream* out) { *out << row.name; }

class Faults : public testing::TestWithParam<Row> {
 protected:
  std::string path(const std::string& name) { return folder_ / name; }
  std::string device(const std::string& faults) {
    std::ofstream(path("f.json")) << R"({"schema": "sixpoint/faults/1", "faults": [)" << faults
                                  << "]}";
    return std::string(kUnit) + ",faults=" + path("f.json");
  }
  nlohmann::json stored_constants() {
    const auto history = tests::run_command(
        posix_env(), {"history", "MOS2A45130007", "--store", path("s.db"), "--json"});
    const nlohmann::json json = nlohmann::json::parse(history.out, nullptr, false);
    return json.is_object() && json.contains("constants") ? json["constants"]
                                                          : nlohmann::json::array();
  }
  tests::TemporaryFolder folder_;
};

class JigFaults : public Faults {};

TEST_P(JigFaults, DoesWhatTheTableSays) {
  const Row& row = GetParam();
  std::vector<std::string> arguments = {"jig",     "--device",   device(row.faults),
                                        "--store", path("s.db"), "--json"};
  if (row.writes) {
    arguments.emplace_back("--write");
  }
  const auto answer = tests::run_command(posix_env(), arguments);
  EXPECT_EQ(answer.exit_code, row.exit_code) << answer.people << answer.out;
  EXPECT_THAT(answer.people + answer.out, HasSubstr(row.says));
  const nlohmann::json constants = stored_constants();
  if (row.exit_code == 0) {
    // Oracle: the sensor that the device string names.
    ASSERT_EQ(constants.size(), 1U);
    const double sensitivity[] = {237.7, 251.8, 242.3};
    const double zero[] = {49.9, 95.8, 60.8};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      EXPECT_NEAR(1 / constants[0]["constants"]["sensitivity_g_per_lsb"][axis].get<double>(),
                  sensitivity[axis], 0.3);
      EXPECT_NEAR(constants[0]["constants"]["zero_lsb"][axis].get<double>(), zero[axis], 0.3);
    }
  } else {
    EXPECT_TRUE(constants.empty()) << "nothing wrong is stored";
  }
  if (const nlohmann::json json = nlohmann::json::parse(answer.out, nullptr, false);
      json.is_object() && json.contains("run")) {
    EXPECT_FALSE(json["run"].get<std::string>().empty()) << "the run is kept, with its samples";
  }
  EXPECT_EQ(tests::run_command(posix_env(), {"audit", "verify", "--store", path("s.db")}).exit_code,
            std::ifstream(path("s.db")).good() ? 0 : 66);
}

const std::vector<Row>& jig_rows() {
  static const std::vector<Row> kRows = {
      Row{"stall", R"({"fault": "stall", "at_report": 5, "every": 40})", 0, "\"pass\""},
      Row{"stall_out", R"({"fault": "stall", "direction": "to_unit", "at_report": 2, "every": 3})",
          0, "\"pass\""},
      Row{"stall_for_good", R"({"fault": "stall", "at_s": 20, "count": 0})", 69,
          "did not come back"},
      Row{"short_delay", R"({"fault": "delay", "seconds": 0.25, "at_report": 3, "every": 50})", 0,
          "\"pass\""},
      Row{"long_delay", R"({"fault": "delay", "seconds": 1, "of": "replies", "at_report": 4})", 0,
          "\"pass\""},
      Row{"longer_delay", R"({"fault": "delay", "seconds": 2, "of": "replies", "at_report": 4})", 0,
          "does not answer"},
      Row{"short_packet", R"({"fault": "short_packet", "bytes": 20, "at_report": 3, "every": 400})",
          0, "\"pass\""},
      Row{"garbage", R"({"fault": "garbage", "at_report": 3, "every": 400})", 0, "\"pass\""},
      Row{"bit_flip", R"({"fault": "bit_flip", "at_byte": 1000, "bit": 6, "every": 400})", 0,
          "\"pass\""},
      Row{"bad_crc", R"({"fault": "bad_crc", "at_report": 2, "every": 400})", 0, "\"pass\""},
      Row{"bad_crc_before_the_run", R"({"fault": "bad_crc", "at_report": 3, "count": 0})", 69,
          "did not come back"},
      Row{"duplicate", R"({"fault": "duplicate", "at_report": 1, "every": 2})", 0, "\"pass\""},
      Row{"lost", R"({"fault": "lost", "at_report": 2, "every": 400})", 0, "\"pass\""},
      Row{"bad_cable", R"({"fault": "bad_crc", "of": "samples", "at_report": 2, "every": 60})", 2,
          "samples were lost or damaged"},
      Row{"lost_for_good", R"({"fault": "lost", "at_s": 30, "count": 0})", 69, "did not come back"},
      Row{"wrong_sequence", R"({"fault": "wrong_sequence", "at_report": 3, "every": 400})", 0,
          "\"pass\""},
      Row{"reset", R"({"fault": "reset", "at_s": 25})", 0, "it is back"},
      Row{"reenumerate", R"({"fault": "reenumerate", "at_s": 25})", 0, "it is back"},
      Row{"unplug", R"({"fault": "unplug", "at_s": 25})", 69, "did not come back"},
      Row{"replug", R"({"fault": "unplug", "at_s": 25, "seconds": 8})", 0, "it is back"},
      Row{"loose_cable",
          R"({"fault": "unplug", "of": "samples", "at_report": 100, "every": 100, "seconds": 1})",
          69, "went away 6 times"},
      Row{"swap", R"({"fault": "swap", "at_s": 25, "seconds": 2})", 69,
          "was MOS2A45130007 and is now MOS2B99990001"},
      Row{"full_flash", R"({"fault": "full_flash", "at_s": 0})", 0, "\"pass\""},
      Row{"battery_low", R"({"fault": "battery_low", "at_s": 0})", 74, "charge the unit", true},
      Row{"battery_low_later", R"({"fault": "battery_low", "at_s": 60})", 1, "battery low", true},
      Row{"bad_page_and_battery_low",
          R"({"fault": "bad_page", "at_s": 0}, {"fault": "battery_low", "at_s": 60})", 1,
          "battery low", true},
      Row{"frozen_sensor", R"({"fault": "frozen_sensor", "at_s": 40})", 1, "the sensor is frozen"},
      Row{"axis_stuck", R"({"fault": "axis_stuck", "axis": "y", "at_s": 40})", 1,
          "y axis is stuck"},
      Row{"bad_page", R"({"fault": "bad_page", "at_s": 0})", 0, "were unreadable"},
      Row{"bad_page_written", R"({"fault": "bad_page", "at_s": 0})", 0, "were unreadable", true},
      Row{"clock_jump", R"({"fault": "clock_jump", "at_s": 33, "seconds": -5})", 0,
          "clock jumped by -5.000 s"},
      // An hour back from some 40 s: device time begins again at 0, once.
      Row{"clock_jump_to_zero", R"({"fault": "clock_jump", "at_s": 40, "seconds": -3600})", 0,
          "s in mid-run (1 times)"},
      Row{"power_loss", R"({"fault": "power_loss", "at_s": 1, "bytes": 300, "seconds": 2})", 0,
          "it is back", true},
      Row{"power_loss_for_good",
          R"({"fault": "power_loss", "at_s": 1, "bytes": 300, "seconds": 3600})", 69,
          "the old ones or the new", true}};
  return kRows;
}

// No constants were read and no sample was asked for: there is no run.
TEST_F(JigFaults, BeforeARunHasBegunThereIsNoneToBeStored) {
  const auto jig = [&](const char* faults) {
    tests::run_command(posix_env(), {"jig", "--device", device(faults), "--store", path("s.db")});
    return tests::run_command(posix_env(),
                              {"history", "MOS2A45130007", "--store", path("s.db"), "--json"});
  };
  EXPECT_EQ(jig(R"({"fault": "bad_crc", "at_report": 3, "count": 0})").exit_code, 66);
  const auto later = nlohmann::json::parse(jig(R"({"fault": "unplug", "at_s": 25})").out);
  ASSERT_EQ(later["runs"].size(), 1U);
  EXPECT_EQ(later["runs"][0]["verdict"], "inconclusive");
}

// Pulled out behind the write, for good: whether the unit holds what was measured is said plainly.
TEST_F(JigFaults, AUnitThatWasWrittenAndNotCheckedIsSaidToBe) {
  const auto answer = tests::run_command(
      posix_env(), {"jig", "--device", device(R"({"fault": "unplug", "at_s": 138})"), "--store",
                    path("s.db"), "--patience", "0", "--write"});
  EXPECT_EQ(answer.exit_code, 69) << answer.people << answer.out;
  EXPECT_THAT(answer.out, HasSubstr("THE UNIT NOW HOLDS THE NEW CONSTANTS"));
  EXPECT_THAT(answer.out, HasSubstr("measure it again with --write"));
}

INSTANTIATE_TEST_SUITE_P(Table, JigFaults, testing::ValuesIn(jig_rows()),
                         [](const auto& row) { return std::string(row.param.name); });

class CaptureFaults : public Faults {};

TEST_P(CaptureFaults, DoesWhatTheTableSays) {
  const Row& row = GetParam();
  const auto answer =
      tests::run_command(posix_env(), {"capture", "--device", device(row.faults), "--store",
                                       path("s.db"), "-o", path("c.gt3x"), "--json"});
  EXPECT_EQ(answer.exit_code, row.exit_code) << answer.people << answer.out;
  EXPECT_THAT(answer.people + answer.out, HasSubstr(row.says));
  EXPECT_EQ(stored_constants().size(), row.exit_code == 0 ? 1U : 0U);
  if (row.exit_code == 0) {
    const auto alone = tests::run_command(posix_env(), {"solve", path("c.gt3x")});
    // Who watched knows that there was no hour between two sides; the file does not.
    const bool jumped = std::string_view(row.faults).find("clock_jump") != std::string_view::npos;
    EXPECT_EQ(alone.exit_code, jumped ? 1 : 0) << alone.out;
    EXPECT_THAT(alone.out, HasSubstr(jumped ? "zeros drifted" : "verified"));
  }
}

const std::vector<Row>& capture_rows() {
  static const std::vector<Row> kRows = {
      Row{"bulk_stall", R"({"fault": "stall", "channel": "bulk", "at_report": 1})", 0, ""},
      Row{"bulk_short",
          R"({"fault": "short_packet", "bytes": 100, "channel": "bulk", "at_report": 2})", 0, ""},
      Row{"bulk_garbage", R"({"fault": "garbage", "channel": "bulk", "at_report": 1})", 0, ""},
      Row{"bulk_bit_flip", R"({"fault": "bit_flip", "channel": "bulk", "at_byte": 5000})", 0, ""},
      Row{"bulk_bad_crc", R"({"fault": "bad_crc", "channel": "bulk", "at_report": 2})", 0, ""},
      Row{"bulk_lost", R"({"fault": "lost", "channel": "bulk", "at_report": 1})", 0, ""},
      Row{"bulk_duplicate", R"({"fault": "duplicate", "channel": "bulk", "at_report": 1})", 0, ""},
      Row{"bulk_wrong_offset", R"({"fault": "wrong_sequence", "channel": "bulk", "at_report": 1})",
          0, ""},
      Row{"bulk_delay", R"({"fault": "delay", "seconds": 0.8, "channel": "bulk", "at_report": 1})",
          0, ""},
      Row{"bulk_dead", R"({"fault": "lost", "channel": "bulk", "at_report": 1, "count": 0})", 69,
          "the download stopped"},
      Row{"unplug_in_download",
          R"({"fault": "unplug", "channel": "bulk", "at_report": 2, "seconds": 3})", 0,
          "the unit came back"},
      // Customers unplug a unit to turn it.
      Row{"replug_while_recording", R"({"fault": "unplug", "at_s": 60, "seconds": 20})", 0, ""},
      Row{"unplug", R"({"fault": "unplug", "at_s": 60})", 69, "did not come back"},
      Row{"swap", R"({"fault": "swap", "at_s": 60})", 69,
          "was MOS2A45130007 and is now MOS2B99990001"},
      Row{"reset", R"({"fault": "reset", "at_s": 100})", 2, "had stopped recording by itself"},
      Row{"full_flash_before", R"({"fault": "full_flash", "at_s": 0})", 74, "storage full"},
      Row{"full_flash", R"({"fault": "full_flash", "at_s": 100})", 2, "memory full"},
      Row{"battery_low", R"({"fault": "battery_low", "at_s": 0})", 74, "charge the unit"},
      Row{"frozen_sensor", R"({"fault": "frozen_sensor", "at_s": 100})", 1,
          "axis x repeated one reading"},
      // Six sides are there all the same.
      Row{"frozen_at_the_end", R"({"fault": "frozen_sensor", "at_s": 232})", 1,
          "axis z repeated one reading"},
      Row{"axis_stuck", R"({"fault": "axis_stuck", "axis": "y", "at_s": 231.5})", 1,
          "axis y repeated one reading"},
      Row{"clock_jump", R"({"fault": "clock_jump", "at_s": 100, "seconds": 3600})", 0,
          "jump by +3600 s"}};
  return kRows;
}

INSTANTIATE_TEST_SUITE_P(Table, CaptureFaults, testing::ValuesIn(capture_rows()),
                         [](const auto& row) { return std::string(row.param.name); });

// Power fails before every single byte of the page write in turn, in mid-run: the run ends with the
// new page, known and measured again, or with nothing that is wrong.
TEST_F(Faults, PowerLossAtAnyByteOfAWriteEndsWithAWholePage) {
  for (std::uint64_t byte = 0; byte <= device::kPageBytes + 8; byte += byte < 500 ? 16 : 1) {
    MemoryEnv env;
    mocks::FaultPlan plan;
    mocks::Fault fault;
    fault.kind = mocks::FaultKind::power_loss;
    fault.at.time_s = 1;
    fault.bytes = byte;
    fault.seconds = 2;
    plan.faults.push_back(fault);
    mocks::VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    const auto plugged =
        std::make_shared<mocks::PluggedUnit>(options, plan, std::make_shared<ManualClock>());
    const auto unit = *device::WireUnit::open(mocks::link_to(plugged, true));
    station::JigSessionOptions session;
    session.run.write = true;
    station::JigHooks hooks;
    hooks.reopen = station::wait_for_unit(*unit, *unit->jig(), [](const std::string&) {});
    const auto report = station::run_jig({unit.get(), unit->jig()}, env.env, session, hooks);
    ASSERT_OK(report);
    EXPECT_EQ(report->verdict, station::JigVerdict::pass) << byte << ": " << report->brief();
    const auto page = unit->read_calibration();
    ASSERT_OK(page) << byte;
    EXPECT_EQ(page->constants, report->six->best().stored) << byte;
    EXPECT_EQ(report->as_left->constants, page->constants) << byte;
  }
}

TEST_F(Faults, PlansThatAreWrongAreRefused) {
  const auto run = [&](const std::string& plan) {
    std::ofstream(path("bad.json")) << plan;
    return tests::run_command(
        posix_env(), {"jig", "--device", std::string(kUnit) + ",faults=" + path("bad.json"),
                      "--store", path("s.db")});
  };
  EXPECT_EQ(run("{}").exit_code, 78);
  EXPECT_EQ(run("[").exit_code, 78);
  const auto unknown =
      run(R"({"schema": "sixpoint/faults/1", "faults": [{"fault": "fire", "at_s": 1}]})");
  EXPECT_EQ(unknown.exit_code, 78);
  EXPECT_THAT(unknown.people, HasSubstr("/faults/0/fault"));
  EXPECT_EQ(tests::run_command(posix_env(), {"jig", "--device",
                                             std::string(kUnit) + ",faults=" + path("none.json"),
                                             "--store", path("s.db")})
                .exit_code,
            66);
}

// docs/faults.md speaks of every fault that there is, and its last table of where each is tested:
// every column is what the plans there hold (those over umockdev: usb/program_faults_test.cpp).
TEST(FaultsPage, SaysOfEveryFaultWhereItIsTested) {
  const std::string page = tests::source_text("docs/faults.md");
  const std::size_t carriers = page.find("## With the installed program");
  ASSERT_NE(carriers, std::string::npos);
  const auto jig = tests::faults_of_rows(jig_rows());
  const auto capture = tests::faults_of_rows(capture_rows());
  const auto unit = tests::faults_in(tests::source_text("tests/usb/fault_bodies.cpp"));
  EXPECT_EQ(tests::faults_of_column("in-process: `jig`"), jig);
  EXPECT_EQ(tests::faults_of_column("in-process: `capture`"), capture);
  EXPECT_EQ(tests::faults_of_column("umockdev and qemu: unit"), unit);
  const auto in_guest = [](const char* script) {
    return tests::faults_in(tests::source_text(std::string("tests/system/") + script));
  };
  EXPECT_EQ(tests::faults_of_column("qemu: `jig`"), in_guest("program_jig.sh"));
  EXPECT_EQ(tests::faults_of_column("qemu: `capture`"), in_guest("program_capture.sh"));
  for (int kind = 0; kind <= static_cast<int>(mocks::FaultKind::power_loss); ++kind) {
    const std::string name(mocks::to_string(static_cast<mocks::FaultKind>(kind)));
    ASSERT_FALSE(name.empty());
    EXPECT_LT(page.find("`" + name + "`"), carriers) << name;
    const std::string shown = name == "unplug" ? "`unplug` and back" : "`" + name + "`";
    EXPECT_EQ(jig.count(shown), 1U) << shown;
    EXPECT_EQ(unit.count(shown), 1U) << shown;
  }
}

}  // namespace
}  // namespace sixpoint::cli

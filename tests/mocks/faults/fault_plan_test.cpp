#include "mocks/faults/fault_plan.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

using testing::HasSubstr;

std::string plan(const std::string& faults) {
  return R"({"schema": "sixpoint/faults/1", "seed": 5, "faults": [)" + faults + "]}";
}

// The example of fault_plan.h and the keys of docs/faults.md.
TEST(FaultPlan, KeysAreRead) {
  const auto read = parse_fault_plan(plan(R"({"fault": "unplug", "at_s": 20, "seconds": 2},
              {"fault": "bit_flip", "of": "samples", "at_report": 100, "every": 50, "bit": 3},
              {"fault": "lost", "channel": "bulk", "at_byte": 7, "count": 0},
              {"fault": "axis_stuck", "axis": "z", "at_s": 1.5})"));
  ASSERT_OK(read);
  EXPECT_EQ(read->seed, 5U);
  ASSERT_EQ(read->faults.size(), 4U);
  EXPECT_EQ(read->faults[0].kind, FaultKind::unplug);
  EXPECT_EQ(read->faults[0].at.time_s, 20);
  EXPECT_EQ(read->faults[0].seconds, 2);
  EXPECT_EQ(read->faults[1].subject, FaultSubject::samples);
  EXPECT_EQ(read->faults[1].at.report, 100U);
  EXPECT_EQ(read->faults[1].every, 50U);
  EXPECT_EQ(read->faults[1].bit, 3);
  EXPECT_EQ(read->faults[2].channel, FaultChannel::bulk);
  EXPECT_EQ(read->faults[2].at.byte, 7U);
  EXPECT_EQ(read->faults[2].count, 0U);
  EXPECT_EQ(read->faults[3].axis, 2U);
}

TEST(FaultPlan, AWrongPlanNamesThePath) {
  const std::vector<std::pair<std::string, std::string>> rows = {
      {"7", "/faults/0"},
      {R"({"at_s": 1})", "needs the key 'fault'"},
      {R"({"fault": "fire", "at_s": 1})", "/faults/0/fault"},
      {R"({"fault": "lost"})", "exactly one of"},
      {R"({"fault": "lost", "at_s": 1, "at_report": 1})", "exactly one of"},
      {R"({"fault": "lost", "at_report": 0})", "from 1 to"},
      {R"({"fault": "lost", "at_s": -1})", "/faults/0/at_s"},
      {R"({"fault": "lost", "at_s": 1, "speed": 1})", "/faults/0/speed"},
      {R"({"fault": "lost", "at_s": 1, "channel": "bulk", "of": "samples"})", "bulk channel"},
      {R"({"fault": "lost", "at_s": 1, "channel": "bulk", "direction": "to_unit"})",
       "bulk channel"},
      {R"({"fault": "lost", "at_s": 1, "direction": "to_unit", "of": "replies"})", "/faults/0/of"},
      {R"({"fault": "delay", "at_s": 1})", "needs the key 'seconds'"},
      {R"({"fault": "lost", "at_s": 1, "every": 3})", "/faults/0/every"},
      {R"({"fault": "lost", "at_report": 1, "every": 3, "count": 3})", "/faults/0/every"},
      {R"({"fault": "unplug", "at_s": 1, "count": 2})", "/faults/0/count"},
      {R"({"fault": "swap", "at_s": 1, "serial": ""})", "/faults/0/serial"},
      {R"({"fault": "swap", "at_s": 1, "serial": 7})", "/faults/0/serial"},
      {R"({"fault": "swap", "at_s": 1, "serial": "MOS2A451300071234"})", "/faults/0/serial"},
      {R"({"fault": "bit_flip", "at_s": 1, "bit": 8})", "/faults/0/bit"},
      {R"({"fault": "axis_stuck", "at_s": 1, "axis": "w"})", "/faults/0/axis"},
  };
  for (const auto& [fault, wanted] : rows) {
    const auto read = parse_fault_plan(plan(fault));
    EXPECT_FAILS(read, ErrorCode::configuration);
    EXPECT_THAT(read.error().what + " " + read.error().where, HasSubstr(wanted)) << fault;
  }
  for (const char* text : {"", "[]", "{}", R"({"schema": "sixpoint/faults/2", "faults": []})",
                           R"({"schema": "sixpoint/faults/1"})",
                           R"({"schema": "sixpoint/faults/1", "faults": [], "x": 1})"}) {
    EXPECT_FAILS(parse_fault_plan(text), ErrorCode::configuration);
  }
}

TEST(FaultPlan, WhatIsNoJsonIsNamedWithItsPlace) {
  const auto read = parse_fault_plan("{\"schema\": \"sixpoint/faults/1\",\n\"faults\": [1e400]}");
  EXPECT_FAILS(read, ErrorCode::configuration);
  EXPECT_EQ(read.error().what, "this is not JSON: line 2 at '1e400'");
}

// A parser would keep the last of the two, without a word about the other.
TEST(FaultPlan, AKeyThatStandsTwiceIsRefused) {
  const std::vector<std::pair<std::string, std::string>> rows = {
      {R"({"schema": "sixpoint/faults/1", "faults": [{"fault": "lost", "at_s": 1}], "faults": []})",
       "fault plan: /faults"},
      {plan(R"({"fault": "reset", "at_s": 1}, {"fault": "lost", "at_s": 1, "at_s": 2})"),
       "fault plan: /faults/1/at_s"},
  };
  for (const auto& [text, where] : rows) {
    const auto read = parse_fault_plan(text);
    EXPECT_FAILS(read, ErrorCode::configuration);
    EXPECT_EQ(read.error().where, where);
    EXPECT_THAT(read.error().what, HasSubstr("twice"));
  }
}

TEST(FaultPlan, AFileIsNamedInItsErrors) {
  MemoryFiles files;
  EXPECT_FAILS(read_fault_plan(files, "F.json"), ErrorCode::no_input);
  ASSERT_OK(write_file(files, "F.json", "{}"));
  const auto read = read_fault_plan(files, "F.json");
  EXPECT_FAILS(read, ErrorCode::configuration);
  EXPECT_THAT(read.error().where, HasSubstr("F.json: "));
}

TEST(FaultPlan, FaultsOfTransfersAreTheFirstNine) {
  EXPECT_TRUE(is_of_transfer(FaultKind::stall));
  EXPECT_TRUE(is_of_transfer(FaultKind::wrong_sequence));
  EXPECT_FALSE(is_of_transfer(FaultKind::reset));
  EXPECT_EQ(to_string(FaultKind::power_loss), "power_loss");
}

}  // namespace
}  // namespace sixpoint::mocks

#include "mocks/in_process/virtual_hid_jig.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

using device::JigFault;
using device::JigMotion;
using std::chrono::seconds;

// The settings of docs/devices/motorised-jig.md.
TEST(VirtualHidJig, SettingsAreRead) {
  const auto options = parse_virtual_hid_jig(
      "serial=J7,fault=obstructed,fault_at=2,lie_deg=3,wrong_pose_at=4,uncertainty_deg=0.2,"
      "stop_at=5,stopped=1,lean_deg=-0.2,worn=-y,worn_deg=0.7");
  ASSERT_OK(options);
  EXPECT_EQ(options->serial, "J7");
  EXPECT_EQ(options->fault, JigFault::obstructed);
  EXPECT_EQ(options->fault_at, 2);
  EXPECT_EQ(options->lie_deg, 3);
  EXPECT_EQ(options->wrong_pose_at, 4);
  EXPECT_EQ(options->uncertainty_deg, 0.2);
  EXPECT_EQ(options->stop_at, 5);
  EXPECT_TRUE(options->stopped);
  EXPECT_EQ(options->lean_deg, -0.2);
  EXPECT_EQ(options->worn, device::Pose::minus_y);
  EXPECT_EQ(options->worn_deg, 0.7);
  EXPECT_EQ(parse_virtual_hid_jig("fault=overcurrent")->fault, JigFault::overcurrent);
  EXPECT_EQ(parse_virtual_hid_jig("fault=supply_low")->fault, JigFault::supply_low);
  EXPECT_EQ(parse_virtual_hid_jig("")->serial, "J600001");
  for (const char* text :
       {"x=1", "serial", "serial=", "serial=a b", "serial=12345678901234567", "fault=none",
        "fault=", "fault_at=0", "fault_at=x", "lie_deg=91", "lie_deg=nan", "uncertainty_deg=-1",
        "lean_deg=11", "worn=", "worn=up", "worn_deg=nan"}) {
    EXPECT_FAILS(parse_virtual_hid_jig(text), ErrorCode::usage);
  }
}

std::unique_ptr<device::HidJig> open(const std::shared_ptr<VirtualHidJig>& jig,
                                     const std::shared_ptr<Clock>& clock) {
  return *device::HidJig::open(link_to_jig(jig, clock));
}

// Without a unit a turn takes two seconds.
TEST(VirtualHidJig, TurnsByTimeAlone) {
  const auto clock = std::make_shared<ManualClock>();
  const auto virtual_jig = std::make_shared<VirtualHidJig>(VirtualHidJigOptions{}, nullptr);
  const auto jig = open(virtual_jig, clock);
  EXPECT_EQ(jig->identity().serial, "J600001");
  ASSERT_OK(jig->go_to(device::Pose::minus_y));
  EXPECT_EQ(virtual_jig->state(clock->elapsed()).motion, JigMotion::turning);
  clock->sleep(seconds(2));
  EXPECT_EQ(jig->position()->pose, device::Pose::minus_y);
  ASSERT_OK(jig->stop());
  EXPECT_EQ(virtual_jig->state(clock->elapsed()).motion, JigMotion::stopped);
}

TEST(VirtualHidJig, ItsButtonIsPressedBeforeOrAtATurn) {
  const auto clock = std::make_shared<ManualClock>();
  const auto jig =
      open(std::make_shared<VirtualHidJig>(*parse_virtual_hid_jig("stop_at=1"), nullptr), clock);
  EXPECT_EQ(jig->position()->fault, "");
  ASSERT_OK(jig->go_to(device::Pose::plus_x));
  EXPECT_EQ(jig->position()->fault, "emergency stop");
  VirtualHidJig stopped(*parse_virtual_hid_jig("stopped=1"), nullptr);
  EXPECT_EQ(stopped.state(clock->elapsed()).motion, JigMotion::stopped);
}

TEST(VirtualHidJig, AFaultComesAtItsTurn) {
  const auto clock = std::make_shared<ManualClock>();
  VirtualHidJigOptions options;
  options.fault = JigFault::door_open;
  options.fault_at = 2;
  const auto jig = open(std::make_shared<VirtualHidJig>(options, nullptr), clock);
  ASSERT_OK(jig->go_to(device::Pose::plus_x));
  clock->sleep(seconds(2));
  EXPECT_EQ(jig->position()->fault, "");
  ASSERT_OK(jig->go_to(device::Pose::plus_y));
  EXPECT_EQ(jig->position()->fault, "the door is open");
  EXPECT_FAILS(jig->go_to(device::Pose::plus_z), ErrorCode::device_unavailable);
}

TEST(VirtualHidJig, AHostThatNeverReadsGetsTheNewestReplies) {
  VirtualHidJig jig({}, nullptr);
  device::Message request;
  for (request.sequence = 1; request.sequence <= 1000; ++request.sequence) {
    jig.take_report(device::encode(request), std::chrono::nanoseconds(0));
  }
  std::size_t replies = 0;
  std::optional<device::Report> last;
  for (auto reply = jig.next_report(); reply; reply = jig.next_report()) {
    ++replies;
    last = reply;
  }
  EXPECT_EQ(replies, 64U);
  EXPECT_EQ(device::decode(last.value())->sequence, 1000);
}

}  // namespace
}  // namespace sixpoint::mocks

#include "device/jigs/hid_jig.h"

#include <thread>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_hid_jig.h"
#include "mocks/inert/inert.h"

namespace sixpoint::device {
namespace {

using mocks::VirtualHidJig;
using mocks::VirtualHidJigOptions;
using testing::HasSubstr;

struct HidJigBench {
  explicit HidJigBench(const VirtualHidJigOptions& options = {}) {
    mocks::VirtualUnitOptions unit;
    unit.truth = sim::draw_unit(7);
    clock = std::make_shared<ManualClock>();
    plugged = std::make_shared<mocks::PluggedUnit>(unit, clock);
    physics = std::make_unique<mocks::VirtualJig>(plugged);
    twin = std::make_shared<VirtualHidJig>(options, physics.get());
    jig = *HidJig::open(mocks::link_to_jig(twin, clock));
  }
  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<mocks::PluggedUnit> plugged;
  std::unique_ptr<mocks::VirtualJig> physics;
  std::shared_ptr<VirtualHidJig> twin;
  std::unique_ptr<HidJig> jig;
};

TEST(HidJig, TurnsSettlesAndReports) {
  HidJigBench bench;
  EXPECT_EQ(bench.jig->name(), "SixJig J600001");
  EXPECT_FALSE(bench.jig->position()->pose) << "it has not been sent anywhere";
  for (const Pose pose : kPoses) {
    ASSERT_OK(bench.jig->go_to(pose));
    EXPECT_FALSE(bench.jig->position()->pose) << "it turns";
    EXPECT_TRUE(bench.plugged->unit.is_turning(bench.clock->elapsed()));
    bench.clock->sleep(std::chrono::seconds(2));
    const auto report = bench.jig->position();
    ASSERT_OK(report);
    EXPECT_EQ(report->pose, pose);
    EXPECT_EQ(report->angle_uncertainty_deg, 0.05);
    EXPECT_TRUE(report->fault.empty());
  }
}

// The unit stands still within 100 ms of the call, on the jig's own clock.
TEST(HidJig, AnEmergencyStopIsAtTheMotorWithin100Ms) {
  HidJigBench bench;
  ASSERT_OK(bench.jig->go_to(Pose::minus_z));
  bench.clock->sleep(std::chrono::milliseconds(500));
  ASSERT_TRUE(bench.plugged->unit.is_turning(bench.clock->elapsed()));
  const auto called = bench.clock->elapsed();
  ASSERT_OK(bench.jig->stop());
  EXPECT_LE(bench.clock->elapsed() - called, std::chrono::milliseconds(100));
  EXPECT_FALSE(bench.plugged->unit.is_turning(bench.clock->elapsed()));
  EXPECT_EQ(bench.jig->position()->fault, "emergency stop");
}

// The table of device/jig.h. `hands_out`: the operator took his hands out of the jig; the jig's
// messages know nothing of that, so the count of movements is an oracle of its own.
TEST(HidJig, AStopHoldsUntilTheOperatorReleasesIt) {
  HidJigBench bench;
  const auto expect_held = [&](const char* when) {
    SCOPED_TRACE(when);
    EXPECT_FAILS(bench.jig->go_to(Pose::plus_x), ErrorCode::device_unavailable);
    EXPECT_EQ(bench.jig->position()->fault, "emergency stop");
    EXPECT_EQ(bench.plugged->motor.movements_after_stop, 0);
  };
  ASSERT_OK(bench.jig->go_to(Pose::minus_z));
  ASSERT_OK(bench.jig->stop());
  expect_held("after a stop by the program");
  bench.clock->sleep(std::chrono::seconds(60));
  expect_held("a minute later");
  bench.jig = *HidJig::open(mocks::link_to_jig(bench.twin, bench.clock));
  expect_held("opened anew");
  bench.plugged->motor.hands_out();
  ASSERT_OK(bench.jig->release());
  ASSERT_OK(bench.jig->go_to(Pose::plus_x));
  EXPECT_EQ(bench.plugged->motor.movements, 2);
  bench.twin->press_stop();
  expect_held("after its own button");
  // Without power the firmware forgets the stop; the station does not.
  const auto restarted = std::make_shared<VirtualHidJig>(VirtualHidJigOptions{}, nullptr);
  const auto jig = *HidJig::open(mocks::link_to_jig(restarted, bench.clock));
  ASSERT_OK(jig->stop());
  *restarted = VirtualHidJig({}, nullptr);
  EXPECT_FAILS(jig->go_to(Pose::plus_x), ErrorCode::device_unavailable);
  EXPECT_EQ(jig->position()->fault, "emergency stop");
  ASSERT_OK(jig->release());
  EXPECT_OK(jig->go_to(Pose::plus_x));
}

TEST(HidJig, AFaultIsReleasedOnlyWhenItIsGone) {
  VirtualHidJigOptions options;
  options.fault = JigFault::door_open;
  options.fault_at = 1;
  HidJigBench bench(options);
  ASSERT_OK(bench.jig->go_to(Pose::plus_x));
  EXPECT_EQ(bench.jig->position()->fault, "the door is open");
  EXPECT_FAILS(bench.jig->release(), ErrorCode::device_unavailable);
  // Switched off and on, the door closed.
  *bench.twin = VirtualHidJig({}, bench.physics.get());
  EXPECT_EQ(bench.jig->position()->fault, "the door is open") << "no one said that it is free";
  EXPECT_FAILS(bench.jig->go_to(Pose::plus_x), ErrorCode::device_unavailable);
  ASSERT_OK(bench.jig->release());
  EXPECT_OK(bench.jig->go_to(Pose::plus_x));
}

// A silent jig does not delay a stop: reads are cut into slices, and a request that waits ends.
class SilentTransport final : public Transport {
 public:
  Status write(std::span<const std::uint8_t> bytes, std::chrono::nanoseconds) override {
    const std::lock_guard lock(mutex);
    commands.push_back(bytes[4]);
    return {};
  }
  Result<std::size_t> read(std::span<std::uint8_t> out,
                           std::chrono::nanoseconds time_out) override {
    {
      const std::lock_guard lock(mutex);
      longest = std::max(longest, time_out);
      if (!commands.empty() && commands.back() != static_cast<std::uint8_t>(JigCommand::go_to) &&
          commands.size() != answered) {
        answered = commands.size();
        const Report reply =
            encode({ReportKind::reply, static_cast<std::uint16_t>(answered),
                    static_cast<Command>(commands.back()), ReplyCode::ok,
                    commands.back() == static_cast<std::uint8_t>(JigCommand::identify)
                        ? encode_jig_identity({{"J1", "1.0", "SixJig"}, 1})
                    : commands.back() == static_cast<std::uint8_t>(JigCommand::state)
                        ? encode_jig_state({})
                        : Bytes{}});
        std::copy(reply.begin(), reply.end(), out.begin());
        return reply.size();
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return 0;
  }
  void cancel() override {}
  bool has(JigCommand command) {
    const std::lock_guard lock(mutex);
    return std::find(commands.begin(), commands.end(), static_cast<std::uint8_t>(command)) !=
           commands.end();
  }
  std::mutex mutex;
  std::vector<std::uint8_t> commands;
  std::size_t answered = 0;
  std::chrono::nanoseconds longest{0};
};

TEST(HidJig, AStopGoesBeforeARequestThatWaits) {
  auto transport = std::make_unique<SilentTransport>();
  SilentTransport* silent = transport.get();
  Link link;
  link.clock = borrow_clock(posix_env().clock);
  link.reports = std::move(transport);
  HidJigOptions options;
  options.reply_time_out = std::chrono::hours(1);
  const auto jig = HidJig::open(std::move(link), options);
  ASSERT_OK(jig);
  Status turned;
  std::thread other([&] { turned = (*jig)->go_to(Pose::plus_x); });
  while (!silent->has(JigCommand::go_to)) {
    std::this_thread::yield();
  }
  EXPECT_OK((*jig)->stop());
  other.join();
  EXPECT_FAILS(turned, ErrorCode::device_unavailable);
  EXPECT_TRUE(silent->has(JigCommand::stop));
  EXPECT_LE(silent->longest, std::chrono::milliseconds(20)) << "nothing waits longer than a slice";
}

TEST(HidJig, FaultsHaveTheirReasons) {
  VirtualHidJigOptions options;
  options.fault = JigFault::obstructed;
  options.fault_at = 2;
  HidJigBench bench(options);
  ASSERT_OK(bench.jig->go_to(Pose::plus_x));
  bench.clock->sleep(std::chrono::seconds(3));
  ASSERT_OK(bench.jig->go_to(Pose::plus_y));
  EXPECT_EQ(bench.jig->position()->fault, "something is in the way");
  const auto refused = bench.jig->go_to(Pose::plus_z);
  EXPECT_FAILS(refused, ErrorCode::device_unavailable);
}

TEST(HidJig, ASilentOrHostileJigIsRefused) {
  const auto clock = std::make_shared<ManualClock>();
  const auto open_with = [&](const std::function<Bytes(const Message&)>& reply) {
    auto transport = std::make_unique<mocks::InertTransport>(clock);
    auto* inert = transport.get();
    inert->on_write = [inert, reply](std::span<const std::uint8_t> bytes) {
      if (const auto request = decode(bytes)) {
        inert->to_read.emplace_back(reply(*request));
      }
    };
    Link link;
    link.clock = clock;
    link.reports = std::move(transport);
    return HidJig::open(std::move(link));
  };
  const auto answer = [](const Message& request, Bytes payload) {
    const Report report = encode(
        {ReportKind::reply, request.sequence, request.command, ReplyCode::ok, std::move(payload)});
    return Bytes(report.begin(), report.end());
  };
  EXPECT_FAILS(open_with([](const Message&) { return Bytes(64, 0xFF); }),
               ErrorCode::device_unavailable);
  EXPECT_FAILS(open_with([&](const Message& m) { return answer(m, {}); }), ErrorCode::bad_data);
  EXPECT_FAILS(open_with([&](const Message& m) { return answer(m, Bytes(54, 1)); }),
               ErrorCode::bad_data);
  EXPECT_FAILS(decode_jig_state(Bytes{9, 0, 0, 0, 0, 0, 0, 0, 0}), ErrorCode::bad_data);
  EXPECT_FAILS(decode_jig_state(Bytes{1, 7, 0, 0, 0, 0, 0, 0, 0}), ErrorCode::bad_data);
  EXPECT_FAILS(decode_jig_state(Bytes{1, 255, 0, 0, 0, 0, 0, 0, 0}), ErrorCode::bad_data);
  JigState state;
  state.motion = JigMotion::standing;
  state.pose = Pose::minus_y;
  state.angle_off_deg = -0.031;
  const auto back = decode_jig_state(encode_jig_state(state));
  ASSERT_OK(back);
  EXPECT_EQ(back->pose, state.pose);
  EXPECT_NEAR(back->angle_off_deg, -0.031, 1e-9);
}

}  // namespace
}  // namespace sixpoint::device

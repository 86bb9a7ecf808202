#include "device/jigs/hid_jig.h"

#include <functional>
#include <limits>
#include <thread>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "device/made_links.h"
#include "device/made_units.h"
#include "device/wire/payload.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_hid_jig.h"
#include "mocks/inert/inert.h"

namespace sixpoint::device {
namespace {

using mocks::VirtualHidJig;
using mocks::VirtualHidJigOptions;
using testing::HasSubstr;
using tests::Break;
using tests::breaking;

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
  Link changed(const tests::Change& request, const tests::Change& reply) const {
    return tests::changed(mocks::link_to_jig(twin, clock), request, reply);
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
}

// The limits of docs/devices/motorised-jig.md, each by one field of a message that holds.
TEST(HidJig, AnImpossibleStateOrIdentityIsRefused) {
  const auto state_of = [](int motion, int pose, std::int32_t angle_mdeg) {
    return payload_of(static_cast<std::uint8_t>(motion), static_cast<std::uint8_t>(pose),
                      angle_mdeg, std::uint16_t{50}, std::uint8_t{0});
  };
  EXPECT_OK(decode_jig_state(state_of(1, 5, 180'000)));
  EXPECT_OK(decode_jig_state(state_of(2, 255, -180'000)));
  for (const Bytes& payload :
       {Bytes{}, Bytes{1, 0, 0, 0, 0, 0, 0, 0}, state_of(5, 0, 0), state_of(1, 6, 0),
        state_of(1, 254, 0), state_of(1, 0, 180'001), state_of(1, 0, -180'001),
        state_of(1, 0, std::numeric_limits<std::int32_t>::min()), state_of(1, 255, 0)}) {
    SCOPED_TRACE(to_hex(payload));
    EXPECT_FAILS(decode_jig_state(payload), ErrorCode::bad_data);
  }
  const JigIdentity whole{{"J1", "1.0", "SixJig"}, 1};
  EXPECT_EQ(*decode_jig_identity(encode_jig_identity(whole)), whole);
  Bytes short_one = encode_jig_identity(whole);
  short_one.pop_back();
  EXPECT_FAILS(decode_jig_identity(short_one), ErrorCode::bad_data);
  for (const JigIdentity& wrong :
       {JigIdentity{{"J1", "1.0", "SixJig"}, 0}, JigIdentity{{"", "1.0", "SixJig"}, 1},
        JigIdentity{{"J\x1b", "1.0", "SixJig"}, 1}, JigIdentity{{"J1", "", "SixJig"}, 1},
        JigIdentity{{"J1", "1 0", "SixJig"}, 1}, JigIdentity{{"J1", "1.0", ""}, 1},
        JigIdentity{{"J1", "1.0", "Six Jig"}, 1}}) {
    SCOPED_TRACE(wrong.serial + "," + wrong.firmware + "," + wrong.model);
    EXPECT_FAILS(decode_jig_identity(encode_jig_identity(wrong)), ErrorCode::bad_data);
  }
  JigState state;
  state.motion = JigMotion::standing;
  state.pose = Pose::minus_y;
  state.angle_off_deg = -0.031;
  const auto back = decode_jig_state(encode_jig_state(state));
  ASSERT_OK(back);
  EXPECT_EQ(back->pose, state.pose);
  EXPECT_NEAR(back->angle_off_deg, -0.031, 1e-9);
}

// A cable that is pulled at any transfer is said; a transfer that failed once is repeated.
TEST(HidJig, EachTransferMayFail) {
  struct Row {
    const char* name;
    std::function<Status(HidJig&)> operation;
  };
  const std::vector<Row> rows = {
      {"position",
       [](HidJig& jig) -> Status {
         SIXPOINT_CHECK(jig.position());
         return {};
       }},
      {"go to", [](HidJig& jig) { return jig.go_to(Pose::plus_x); }},
      {"stop", [](HidJig& jig) { return jig.stop(); }},
      {"release", [](HidJig& jig) { return jig.release(); }},
  };
  for (const Row& row : rows) {
    for (const ErrorCode code : {ErrorCode::device_unavailable, ErrorCode::io}) {
      for (std::size_t call = 0;; ++call) {
        SCOPED_TRACE(row.name + (", call " + std::to_string(call)));
        HidJigBench bench;
        const auto broken = std::make_shared<Break>();
        broken->code = code;
        const auto jig =
            *HidJig::open(breaking(mocks::link_to_jig(bench.twin, bench.clock), broken));
        broken->left = call;
        const Status result = row.operation(*jig);
        if (!broken->happened) {
          EXPECT_OK(result);
          EXPECT_GT(call, 1U);
          break;
        }
        EXPECT_EQ(result.has_value(), code == ErrorCode::io);
        EXPECT_TRUE(result || result.error().code == code) << result.error().brief();
        EXPECT_OK(jig->position()) << "the next one is as if nothing had been";
      }
    }
  }
  HidJigBench bench;
  for (const std::size_t call : {0U, 1U}) {
    const auto broken = std::make_shared<Break>(Break{call});
    EXPECT_FAILS(HidJig::open(breaking(mocks::link_to_jig(bench.twin, bench.clock), broken)),
                 ErrorCode::device_unavailable);
  }
}

// The jig is held by the program also where the jig did not hear of it.
TEST(HidJig, AStopOrAReleaseThatTheJigDidNotHearHolds) {
  HidJigBench bench;
  const auto broken = std::make_shared<Break>();
  const auto jig = *HidJig::open(breaking(mocks::link_to_jig(bench.twin, bench.clock), broken));
  broken->left = 0;
  EXPECT_FAILS(jig->stop(), ErrorCode::device_unavailable);
  for (std::size_t call = 0;; ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    const Status turned = jig->go_to(Pose::plus_x);
    EXPECT_FAILS(turned, ErrorCode::device_unavailable);
    EXPECT_THAT(turned.error().what, HasSubstr("emergency stop"));
    EXPECT_EQ(bench.plugged->motor.movements, 0);
    broken->left = call;
    broken->happened = false;
    if (const Status released = jig->release(); released) {
      EXPECT_FALSE(broken->happened);
      EXPECT_GT(call, 1U);
      break;
    }
  }
  broken->left.reset();
  EXPECT_OK(jig->go_to(Pose::plus_x));
}

// Its button is pressed between the look at it and the command.
TEST(HidJig, ARefusalIsSaidWithItsReason) {
  HidJigBench bench;
  const auto press = [&](Message& request) {
    if (request.command == static_cast<Command>(JigCommand::go_to)) {
      bench.twin->press_stop();
    }
  };
  const auto jig = *HidJig::open(bench.changed(press, {}));
  const Status refused = jig->go_to(Pose::plus_x);
  EXPECT_FAILS(refused, ErrorCode::device_unavailable);
  EXPECT_EQ(refused.error().what, "the jig refused: busy");
  EXPECT_EQ(bench.plugged->motor.movements, 0);
}

// Oracle: the state of the jig. A reply that belongs to nothing that was asked says another one.
TEST(HidJig, RepliesToSomethingElseAreDropped) {
  const std::vector<tests::Change> rows = {
      [](Message& reply) { reply.kind = ReportKind::samples; },
      [](Message& reply) { reply.kind = ReportKind::request; },
      [](Message& reply) { ++reply.sequence; },
      [](Message& reply) { reply.command = static_cast<Command>(JigCommand::identify); },
  };
  for (std::size_t row = 0; row < rows.size(); ++row) {
    SCOPED_TRACE(row);
    HidJigBench bench;
    ASSERT_OK(bench.jig->go_to(Pose::plus_x));
    bench.clock->sleep(std::chrono::seconds(3));
    bool lies = false;
    const auto jig = *HidJig::open(bench.changed({}, [&](Message& reply) {
      if (lies) {
        lies = false;
        JigState state;
        state.motion = JigMotion::standing;
        state.pose = Pose::minus_x;
        reply.payload = encode_jig_state(state);
        rows[row](reply);
      }
    }));
    lies = true;
    const auto position = jig->position();
    ASSERT_OK(position);
    EXPECT_FALSE(lies);
    EXPECT_EQ(position->pose, Pose::plus_x);
  }
}

// What the jig says can not be: nothing moves, and the operation says it.
TEST(HidJig, AStateThatCanNotBeEndsEachOperation) {
  HidJigBench bench;
  const auto jig = *HidJig::open(bench.changed({}, [](Message& reply) {
    if (reply.command == static_cast<Command>(JigCommand::state)) {
      reply.payload = Bytes(9, 0xFE);
    }
  }));
  EXPECT_FAILS(jig->position(), ErrorCode::bad_data);
  EXPECT_FAILS(jig->go_to(Pose::plus_x), ErrorCode::bad_data);
  EXPECT_FAILS(jig->release(), ErrorCode::bad_data);
  EXPECT_EQ(bench.plugged->motor.movements, 0);
}

// A later firmware has more faults than this program knows.
TEST(HidJig, AFaultOfNoKnownCodeHoldsTheJig) {
  HidJigBench bench;
  const auto jig = *HidJig::open(bench.changed({}, [](Message& reply) {
    if (reply.command == static_cast<Command>(JigCommand::state)) {
      JigState state;
      state.motion = JigMotion::fault;
      state.fault = static_cast<JigFault>(77);
      reply.payload = encode_jig_state(state);
    }
  }));
  EXPECT_EQ(jig->position()->fault, "a fault of no known code");
  EXPECT_FAILS(jig->go_to(Pose::plus_x), ErrorCode::device_unavailable);
  const Status released = jig->release();
  EXPECT_FAILS(released, ErrorCode::device_unavailable);
  EXPECT_EQ(released.error().what, "the jig is not free yet: a fault of no known code");
}

// docs/protocol.md: 1, 2, 3 ... 65535, 1 ...
TEST(HidJig, After65535RequestsTheSequenceIs1Again) {
  HidJigBench bench;
  std::uint16_t last = 0;
  const auto jig =
      *HidJig::open(bench.changed([&](Message& request) { last = request.sequence; }, {}));
  EXPECT_EQ(last, 1);
  for (int request = 2; request <= 65'535; ++request) {
    ASSERT_OK(jig->position());
    ASSERT_EQ(last, request);
  }
  EXPECT_OK(jig->position());
  EXPECT_EQ(last, 1);
}

TEST(HidJig, AnAddressThatNoJigHasIsUnavailable) {
  MemoryEnv memory;
  const auto unit = *tests::virtual_units().open("virtual:seed=7", memory.env);
  JigRegistry jigs;
  register_hid_jig(jigs);
  const auto none = jigs.open("hid:NO-SUCH-JIG", memory.env, *unit);
  EXPECT_FAILS(none, ErrorCode::device_unavailable);
  EXPECT_THAT(none.error().what, HasSubstr("NO-SUCH-JIG"));
}

}  // namespace
}  // namespace sixpoint::device

#include "cli/devices/known_devices.h"

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/in_process/virtual_bench.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// The schemes that docs/virtual.md, docs/devices and docs/sessions.md name.
TEST(KnownDevices, EverySchemeOfTheManualIsThere) {
  EXPECT_THAT(known_devices().examples(),
              testing::UnorderedElementsAre(StartsWith("virtual:"), StartsWith("hid:"),
                                            StartsWith("usb:"), StartsWith("replay:")));
  EXPECT_THAT(
      known_units().examples(),
      testing::UnorderedElementsAre(StartsWith("virtual:"), StartsWith("hid:"), StartsWith("usb:"),
                                    StartsWith("replay:"), StartsWith("drive:")));
  MemoryEnv memory;
  EXPECT_FAILS(known_devices().open("serial:1", memory.env), ErrorCode::usage);
  // A folder is a unit, but no link.
  EXPECT_FAILS(known_devices().open("drive:media/UNIT", memory.env), ErrorCode::usage);
  EXPECT_FAILS(known_units().open("drive:media/UNIT", memory.env), ErrorCode::no_input);
  EXPECT_FAILS(known_units().open("replay:none.zip", memory.env), ErrorCode::no_input);
}

TEST(KnownDevices, AnAddressIsCheckedWithoutItsUnit) {
  MemoryEnv memory;
  for (const char* device : {"virtual:seed=7,jig=auto", "virtual:", "hid:MOS2A1", "usb:MOS2A1",
                             "hid:", "replay:none.zip"}) {
    EXPECT_OK(check_address(device, memory.env)) << device;
  }
  for (const char* device : {"nonsense", "", "serial:1", "drive:media/UNIT", "virtual:foo=1",
                             "virtual:seed=-1", "virtual:interfaces=storage"}) {
    SCOPED_TRACE(device);
    EXPECT_FAILS(check_address(device, memory.env), ErrorCode::usage);
  }
}

// The table above choose_jig(); the name of a motorised jig is docs/devices/motorised-jig.md's.
TEST(KnownDevices, AJigIsChosenByItsName) {
  MemoryEnv memory;
  const auto alone = known_units().open("virtual:seed=7", memory.env);
  const auto in_jig = known_units().open("virtual:seed=7,jig=auto", memory.env);
  ASSERT_OK(alone);
  ASSERT_OK(in_jig);
  for (const char* name : {"", "virtual"}) {
    std::unique_ptr<device::Jig> own;
    const auto jig = choose_jig(name, **in_jig, memory.env, own);
    ASSERT_OK(jig);
    EXPECT_EQ(*jig, (*in_jig)->jig()) << "the one that is part of the unit";
    EXPECT_EQ(own, nullptr);
  }
  for (const char* name : {"", "manual"}) {
    std::unique_ptr<device::Jig> own;
    const auto jig = choose_jig(name, **alone, memory.env, own);
    ASSERT_OK(jig);
    EXPECT_EQ(*jig, own.get());
    EXPECT_EQ((*jig)->name(), "manual");
    EXPECT_FALSE((*jig)->turns_by_itself());
  }
  std::unique_ptr<device::Jig> own;
  const auto motorised = choose_jig("virtual:serial=J600042", **in_jig, memory.env, own);
  ASSERT_OK(motorised);
  EXPECT_EQ(*motorised, own.get());
  EXPECT_EQ((*motorised)->name(), "SixJig J600042");
  EXPECT_TRUE((*motorised)->turns_by_itself());
  const auto by_hand = choose_jig("manual", **in_jig, memory.env, own);
  ASSERT_OK(by_hand);
  EXPECT_EQ((*by_hand)->name(), "manual") << "also where the unit has a jig";
  EXPECT_FAILS(choose_jig("robot", **alone, memory.env, own), ErrorCode::usage);
}

// The table above with_jig(), row by row.
TEST(KnownDevices, TheJigGoesIntoTheAddressOfAVirtualUnit) {
  EXPECT_EQ(with_jig("virtual:seed=7", "virtual"), "virtual:seed=7,jig=auto");
  EXPECT_EQ(with_jig("virtual:seed=7", "virtual:lie_deg=3"), "virtual:seed=7,jig=auto");
  EXPECT_EQ(with_jig("virtual:seed=7,jig=auto", "manual"), "virtual:seed=7,jig=none");
  EXPECT_EQ(with_jig("virtual:jig=auto,seed=7", "hid:J1"), "virtual:seed=7,jig=none");
  EXPECT_EQ(with_jig("virtual:seed=7,jig=auto", "virtual"), "virtual:seed=7,jig=auto");
  EXPECT_EQ(with_jig("virtual:", "virtual"), "virtual:jig=auto");
  EXPECT_EQ(with_jig("virtual:seed=7", ""), "virtual:seed=7");
  EXPECT_EQ(with_jig("virtual:seed=7,jig=auto", ""), "virtual:seed=7,jig=auto");
  EXPECT_EQ(with_jig("hid:MOS2A1", "virtual"), "hid:MOS2A1");
  EXPECT_EQ(with_jig("drive:media/virtual", "manual"), "drive:media/virtual");
}

struct OnBench {
  OnBench() {
    bench.register_in(links);
    unit = *device::UnitRegistry(links, [](device::Link link) {
              return device::WireUnit::open(std::move(link));
            }).open(kAddress, memory.env);
    hook = wait_for_unit(
        *unit, jig, [this](const std::string& line) { said.push_back(line); },
        std::chrono::seconds(30));
  }
  static constexpr const char* kAddress = "virtual:seed=7";
  MemoryEnv memory;
  mocks::VirtualBench bench;
  device::TransportRegistry links;
  std::unique_ptr<device::Unit> unit;
  device::ManualJig jig;
  std::vector<std::string> said;
  UnitWait hook;
};

const Error kGone{ErrorCode::device_unavailable, "the unit was unplugged", "virtual unit", ""};

// docs/faults.md: "a loose cable: away six times in a run ends the run with this reason".
TEST(KnownDevices, AUnitMayComeBackFiveTimes) {
  OnBench on;
  for (int i = 0; i < 5; ++i) {
    const auto back = on.hook(kGone, {});
    ASSERT_OK(back) << i;
    EXPECT_EQ(back->unit, on.unit.get());
    EXPECT_EQ(back->jig, &on.jig);
    ASSERT_EQ(on.said.size(), 2U * static_cast<std::size_t>(i + 1));
    EXPECT_THAT(on.said[on.said.size() - 2],
                testing::AllOf(StartsWith("the unit was unplugged"), HasSubstr("30 s")));
  }
  const auto sixth = on.hook(kGone, {});
  EXPECT_FAILS(sixth, ErrorCode::device_unavailable);
  EXPECT_THAT(sixth.error().what, HasSubstr("6 times"));
}

// docs/faults.md: "`unplug` for good ends the run after 30 s". Half a second: the requests that are
// under way, and the interval between two attempts.
TEST(KnownDevices, AUnitThatStaysAwayIsGivenUpAfterThePatience) {
  OnBench on;
  ASSERT_OK(on.bench.set_plugged(OnBench::kAddress, false));
  Clock& clock = on.unit->clock();
  const auto before = clock.elapsed();
  EXPECT_FAILS(on.hook(kGone, {}), ErrorCode::device_unavailable);
  const double waited_s = std::chrono::duration<double>(clock.elapsed() - before).count();
  EXPECT_GE(waited_s, 30);
  EXPECT_LE(waited_s, 30.5);
  ASSERT_OK(on.bench.set_plugged(OnBench::kAddress, true));
  EXPECT_OK(on.hook(kGone, {})) << "it is one of the five";
}

}  // namespace
}  // namespace sixpoint::station

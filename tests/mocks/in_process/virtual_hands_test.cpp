#include "mocks/in_process/virtual_hands.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

// The words of the header, one by one. Oracle: the unit's own answers on the wire.
TEST(VirtualHands, ObeyTheirWords) {
  const auto clock = std::make_shared<ManualClock>();
  VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  const auto plugged = std::make_shared<PluggedUnit>(options, clock);
  VirtualHands hands(plugged);
  for (const char* word : {"-x", "knock"}) {
    EXPECT_FALSE(plugged->unit.is_turning(clock->elapsed())) << word;
    EXPECT_OK(hands.obey(word));
    EXPECT_TRUE(plugged->unit.is_turning(clock->elapsed())) << word;
    clock->sleep(std::chrono::seconds(3));
  }
  for (const char* word : {"", "x", "+w", "swop"}) {
    EXPECT_FAILS(hands.obey(word), ErrorCode::usage);
  }
  const auto serial = [&] {
    plugged->faults.advance(plugged->unit, clock->elapsed());  // as a link that is opened anew does
    const auto unit = device::WireUnit::open(link_to(plugged, false));
    return unit ? (*unit)->identity().serial : std::string();
  };
  const std::string own = serial();
  EXPECT_EQ(own, options.truth.serial);
  EXPECT_OK(hands.obey("swap"));
  EXPECT_EQ(serial(), "") << "pulled out";
  clock->sleep(std::chrono::seconds(2));
  EXPECT_EQ(serial(), "MOS2B99990001");
  clock->sleep(std::chrono::seconds(10));
  EXPECT_EQ(serial(), "MOS2B99990001");
}

}  // namespace
}  // namespace sixpoint::mocks

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
  for (const char* word : {"-x", "knock", "+x turned", "knock", "+x-y-z", "knock"}) {
    EXPECT_FALSE(plugged->unit.is_turning(clock->elapsed())) << word;
    EXPECT_OK(hands.obey(word));
    EXPECT_TRUE(plugged->unit.is_turning(clock->elapsed())) << word;
    clock->sleep(std::chrono::seconds(3));
  }
  for (const char* word :
       {"", "x", "+w", "swop", " turned", "+w turned", "+x  turned", "+x+y", "+x+y+z turned"}) {
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

// Oracle: the base tilts by 3 degrees; the level axis shows it with the other sign. A knock leaves
// it.
TEST(VirtualHands, TurnAboutTheVertical) {
  const auto clock = std::make_shared<ManualClock>();
  VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  options.jig_tilt_deg = {3, 0, 0};
  const auto plugged = std::make_shared<PluggedUnit>(options, clock);
  VirtualHands hands(plugged);
  const auto unit = *device::WireUnit::open(link_to(plugged, false));
  ASSERT_OK(unit->set_filter(sim::FilterConfiguration::current));
  const auto y_lsb = [&](const char* word) {
    EXPECT_OK(hands.obey(word));
    clock->sleep(std::chrono::seconds(3));
    EXPECT_OK(unit->start_stream(100));
    const auto block = unit->next_samples(std::chrono::seconds(1));
    EXPECT_OK(unit->stop_stream());
    return block && *block ? (*block)->counts.front()[1] - options.truth.current.zero_lsb[1] : 0;
  };
  EXPECT_LT(y_lsb("+z"), -8);
  EXPECT_GT(y_lsb("+z turned"), 8);
  EXPECT_GT(y_lsb("knock"), 8);
}

}  // namespace
}  // namespace sixpoint::mocks

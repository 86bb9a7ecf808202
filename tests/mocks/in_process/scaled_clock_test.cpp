#include "mocks/in_process/scaled_clock.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "mocks/firmware/virtual_settings.h"

namespace sixpoint::mocks {
namespace {

using std::chrono::seconds;

TEST(ScaledClock, RunsTheFactorFaster) {
  ManualClock base;
  base.sleep(seconds(100));
  ScaledClock clock(base, 10);
  const auto begin = clock.elapsed();
  const UtcTime date = clock.now();
  base.sleep(seconds(2));
  EXPECT_EQ(clock.elapsed() - begin, seconds(20));
  EXPECT_EQ(clock.now() - date, seconds(20));
  clock.sleep(seconds(30));
  EXPECT_EQ(base.elapsed(), seconds(105)) << "30 s on the fast clock are 3 s";
}

// The setting `pace` of docs/virtual.md.
TEST(ScaledClock, PaceChoosesTheClock) {
  ManualClock machine;
  VirtualSettings settings;
  const auto fast = clock_of(settings, machine);
  fast->sleep(seconds(60));
  EXPECT_EQ(machine.elapsed(), seconds(0)) << "fast: a clock of its own";
  settings.real_time = true;
  clock_of(settings, machine)->sleep(seconds(1));
  EXPECT_EQ(machine.elapsed(), seconds(1));
  settings.pace = 4;
  clock_of(settings, machine)->sleep(seconds(4));
  EXPECT_EQ(machine.elapsed(), seconds(2));
}

}  // namespace
}  // namespace sixpoint::mocks

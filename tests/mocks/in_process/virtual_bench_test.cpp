#include "mocks/in_process/virtual_bench.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

constexpr const char* kAddress = "virtual:seed=7";

struct TestBench {
  TestBench() { bench.register_in(links); }
  Result<std::unique_ptr<device::Unit>> open() {
    SIXPOINT_ASSIGN(device::Link link, links.open(kAddress, memory.env));
    return device::WireUnit::open(std::move(link));
  }

  MemoryEnv memory;
  VirtualBench bench;
  device::TransportRegistry links;
};

// The mean reading of one second, in counts.
PerAxis<double> mean_lsb(device::Unit& unit) {
  PerAxis<double> sum{};
  double count = 0;
  EXPECT_OK(unit.start_stream(100));
  while (count < 100) {
    const auto block = unit.next_samples(std::chrono::seconds(1));
    if (!block || !*block) {
      ADD_FAILURE() << "the stream ended";
      break;
    }
    for (const device::RawCounts& counts : (*block)->counts) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        sum[axis] += counts[axis];
      }
      ++count;
    }
  }
  EXPECT_OK(unit.stop_stream());
  return {sum[0] / count, sum[1] / count, sum[2] / count};
}

TEST(VirtualBench, KeepsAUnitBetweenOpenings) {
  TestBench bench;
  EXPECT_FALSE(bench.bench.has(kAddress));
  EXPECT_FAILS(bench.bench.turn(kAddress, device::Pose::plus_x), ErrorCode::usage);
  auto unit = *bench.open();
  EXPECT_TRUE(bench.bench.has(kAddress));
  auto page = *unit->read_calibration();
  page.constants.zero_lsb[0] += 1;
  ASSERT_OK(unit->write_calibration(page));
  unit.reset();
  EXPECT_EQ((*bench.open())->read_calibration()->constants, page.constants);
}

TEST(VirtualBench, TurnsTheUnit) {
  TestBench bench;
  const auto unit = *bench.open();
  unit->clock().sleep(std::chrono::seconds(3));
  const PerAxis<double> before = mean_lsb(*unit);
  ASSERT_OK(bench.bench.turn(kAddress, device::Pose::plus_x));
  unit->clock().sleep(std::chrono::seconds(3));
  const PerAxis<double> after = mean_lsb(*unit);
  EXPECT_GT(after[0] - before[0], 150) << "x goes from 0 to 1 g, more than 200 counts";
  EXPECT_LT(after[2] - before[2], -150) << "z goes from 1 g to 0";
}

TEST(VirtualBench, UnplugsAndSwaps) {
  TestBench bench;
  const auto unit = *bench.open();
  const std::string serial = unit->identity().serial;
  ASSERT_OK(bench.bench.set_plugged(kAddress, false));
  EXPECT_FAILS(unit->identify(), ErrorCode::device_unavailable);
  EXPECT_FAILS(bench.open(), ErrorCode::device_unavailable);
  ASSERT_OK(bench.bench.set_plugged(kAddress, true));
  EXPECT_EQ((*bench.open())->identity().serial, serial);
  ASSERT_OK(bench.bench.swap(kAddress, 9, "MOS2B99990001"));
  EXPECT_EQ((*bench.open())->identity().serial, "MOS2B99990001");
}

}  // namespace
}  // namespace sixpoint::mocks

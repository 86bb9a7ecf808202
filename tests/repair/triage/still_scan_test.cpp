#include "repair/triage/still_scan.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::repair {
namespace {

using gt3x::Counts;

// Firmware 1.6.0 stored x' = -y, y' = x.
TEST(StillScan, UndoesTheRotation) {
  std::vector<Counts> samples = {{-20, 10, 30}, {2047, 5, 0}, {-2048, 5, 0}};
  undo_rotation(samples, calib::RecordWidth::bits12);
  EXPECT_EQ(samples[0], (Counts{10, 20, 30}));
  EXPECT_EQ(samples[1], (Counts{5, -2048, 0})) << "at the limit it stays at the limit";
  EXPECT_EQ(samples[2], (Counts{5, 2047, 0}));
}

TEST(StillScan, RotationKeepsCountsOfSixteenBits) {
  std::vector<Counts> samples = {{2047, 5, 0}, {-2048, 5, 0}, {-3000, 9, 1}, {-32768, 0, 0}};
  undo_rotation(samples, calib::RecordWidth::bits16);
  EXPECT_EQ(samples,
            (std::vector<Counts>{{5, -2047, 0}, {5, 2048, 0}, {9, 3000, 1}, {0, 32767, 0}}));
}

TEST(StillScan, MagnitudeErrorsByHand) {
  EXPECT_EQ(magnitude_error({}).blocks, 0U);
  std::vector<calib::StillBlock> blocks(3);
  blocks[0].mean_g = {0.6, 0.8, 0};  // 1 g
  blocks[1].mean_g = {0, 0, -1.01};  // 10 mg
  blocks[2].mean_g = {0.98, 0, 0};   // 20 mg
  const MagnitudeError error = magnitude_error(blocks);
  EXPECT_EQ(error.blocks, 3U);
  EXPECT_NEAR(error.mean_mg, 10, 1e-9);
  EXPECT_NEAR(error.p95_mg, 20, 1e-9);
  EXPECT_NEAR(error.worst_mg, 20, 1e-9);
}

// The rows of push(): seconds twice, in pairs that changed places, with others missing, leaping.
// Oracle: a unit at rest for 40 seconds has ten windows of 4 s, whatever the order of its records.
TEST(StillScan, SecondsThatAreTwiceOrOutOfOrderAreStillAllTheSame) {
  const auto blocks_of = [](const std::vector<std::uint32_t>& times) {
    StillScan scan = StillScan::make(30, 256).value();
    std::vector<Counts> second(30, Counts{0, 0, 256});
    for (std::size_t i = 0; i < second.size(); i += 2) {
      second[i][2] = 257;
    }
    for (const std::uint32_t time : times) {
      scan.push(time, second);
    }
    return scan.finish().size();
  };
  std::vector<std::uint32_t> in_order;
  std::vector<std::uint32_t> twice;
  std::vector<std::uint32_t> swapped;
  std::vector<std::uint32_t> every_other;
  std::vector<std::uint32_t> leaping;
  for (std::uint32_t i = 0; i < 40; ++i) {
    in_order.push_back(1000 + i);
    twice.insert(twice.end(), {1000 + i, 1000 + i});
    swapped.push_back(1000 + (i ^ 1U));
    every_other.push_back(1000 + 2 * i);
    leaping.push_back(i % 2 == 0 ? 1000 + i : 9000 - i);
  }
  EXPECT_EQ(blocks_of(in_order), 10U);
  EXPECT_EQ(blocks_of(twice), 20U);
  EXPECT_EQ(blocks_of(swapped), 10U);
  EXPECT_EQ(blocks_of(every_other), 0U) << "seconds are missing, and the unit may have moved";
  EXPECT_EQ(blocks_of(leaping), 0U);
}

TEST(StillScan, RefusesWhatCannotBe) {
  EXPECT_FALSE(StillScan::make(0, 256));
  EXPECT_FALSE(StillScan::make(30, 0));
  auto scan = StillScan::make(30, 256);
  ASSERT_OK(scan);
  EXPECT_FALSE(scan->set_constants({{10, 300, 300}, {10, -300, -300}, {0, 0, 0}}));
}

TEST(StillScan, MoreSetsOfConstantsThanARecordingHasAreRefused) {
  auto scan = StillScan::make(30, 256);
  ASSERT_OK(scan);
  StoredConstants constants = {{326, 287, 303}, {-201, -268, -192}, {61, 4, 61}};
  for (int round = 0; round < 2; ++round) {  // the second time they are known
    for (std::size_t i = 0; i < kMaxSetsOfConstants; ++i) {
      constants.zero_lsb[0] = static_cast<int>(i);
      EXPECT_OK(scan->set_constants(constants)) << i;
    }
  }
  constants.zero_lsb[0] = -1;
  EXPECT_FAILS(scan->set_constants(constants), ErrorCode::bad_data);
}

// Two sets of constants that take turns: as many blocks as are allowed, evenly taken, and each by
// the constants that it came by. Oracle: both sets by hand. By the narrow one every stored count is
// 1.7 raw ones, so that many have none behind them and the straight line is taken.
TEST(StillScan, MemoryIsBoundedWhateverTheConstantsDo) {
  const StoredConstants wide = {{300, 300, 300}, {-300, -300, -300}, {0, 0, 0}};
  const StoredConstants narrow = {{150, 150, 150}, {-150, -150, -150}, {0, 0, 0}};
  calib::StillBlockOptions options;
  options.max_blocks = 16;
  StillScan scan = StillScan::make(30, 256, options).value();
  std::vector<Counts> second(30, Counts{0, 0, 256});
  for (std::size_t i = 0; i < second.size(); i += 2) {
    second[i][2] = 257;
  }
  std::uint32_t time = 1000;
  for (int stretch = 0; stretch < 101; ++stretch) {
    EXPECT_OK(scan.set_constants(stretch % 2 == 0 ? wide : narrow));
    for (int i = 0; i < 5; ++i) {
      scan.push(time++, second);
    }
  }
  const auto blocks = scan.finish();
  EXPECT_LE(blocks.size(), 16U);
  EXPECT_GE(blocks.size(), 8U);
  EXPECT_EQ(scan.tally().blocks, 101U);
  EXPECT_GE(scan.tally().thinned, 4U);
  EXPECT_FALSE(scan.plausibility().plausible());
  for (const calib::StillBlock& block : blocks) {
    const bool in_wide = static_cast<int>((block.start_time_s - 1000) / 5) % 2 == 0;
    EXPECT_NEAR(block.mean_lsb[2], 256.5 / 256 * (in_wide ? 300 : 150), 1e-9) << block.start_time_s;
    EXPECT_NEAR(static_cast<double>(block.first_sample), 30 * (block.start_time_s - 1000), 1e-6);
  }
}

// Twenty seconds at rest, in one run and with two seconds missing in the middle.
TEST(StillScan, AGapEndsARun) {
  const std::vector<Counts> second(30, Counts{0, 0, 256});
  const auto blocks_with = [&](std::uint32_t gap_s) {
    StillScan scan = StillScan::make(30, 256).value();
    for (std::uint32_t t = 0; t < 20; ++t) {
      scan.push(1000 + t + (t < 10 ? 0 : gap_s), second);
    }
    return scan.finish();
  };
  const auto whole = blocks_with(0);
  ASSERT_FALSE(whole.empty());
  EXPECT_NEAR(whole[0].mean_g[2], 1, 1e-12) << "raw counts over 256";
  EXPECT_NEAR(whole[0].mean_lsb[2], 256, 1e-9);
  const auto split = blocks_with(2);
  EXPECT_GE(split.size(), whole.size() == 1 ? 2U : 1U);
  for (const calib::StillBlock& block : split) {
    const double gap_s = block.start_time_s < 1010 ? 0 : 2;
    EXPECT_NEAR(static_cast<double>(block.first_sample), 30 * (block.start_time_s - 1000 - gap_s),
                1e-6);
  }
}

}  // namespace
}  // namespace sixpoint::repair

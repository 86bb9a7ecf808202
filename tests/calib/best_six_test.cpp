#include "calib/best_six.h"

#include <cmath>
#include <cstdio>
#include <random>

#include <gtest/gtest.h>

#include "calib/solve.h"
#include "calib/verify.h"
#include "exact_blocks.h"
#include "expect_result.h"
#include "free_living.h"
#include "shared_data.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;
using tests::Vector;

// A direction and how many blocks the unit lies in it.
struct RestDirection {
  Vector up{};
  int blocks = 1;
};

SyntheticUnit crossed_unit() {
  SyntheticUnit unit;
  unit.cross_axis = {0.02, -0.002, 0.006};
  return unit;
}

std::vector<RestDirection> anywhere(int directions, int blocks, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<RestDirection> rests;
  for (int i = 0; i < directions; ++i) {
    rests.push_back({tests::random_direction(random), blocks});
  }
  return rests;
}

// A wrist: mostly where x and y have one sign, so that a term between them looks like sensitivity.
std::vector<RestDirection> worn(int directions, unsigned seed, bool by_time) {
  std::mt19937_64 random(seed);
  std::vector<RestDirection> rests;
  while (static_cast<int>(rests.size()) < directions) {
    const Vector up = tests::random_direction(random);
    const bool often = up[0] * up[1] > 0.1;
    if (by_time) {
      rests.push_back({up, often ? 30 : 1});
    } else if (often || rests.size() % 8 == 0) {
      rests.push_back({up, 3});
    }
  }
  return rests;
}

BlockFit fit_of(const SyntheticUnit& unit, const std::vector<RestDirection>& rests) {
  std::vector<StillBlock> blocks;
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0, 0.0005);
  for (const RestDirection& rest : rests) {
    for (int i = 0; i < rest.blocks; ++i) {
      Vector g = rest.up;
      for (double& value : g) {
        value += noise(random);
      }
      blocks.push_back(tests::exact_block(unit, g, 4.0 * static_cast<double>(blocks.size())));
    }
  }
  auto fit = fit_blocks(blocks, tests::file_constants(unit));
  EXPECT_OK(fit);
  return *fit;
}

// Root mean square error of the magnitude over the rests, by the generator's own readings.
double error_mg(const SyntheticUnit& unit, const Calibration& six,
                const std::vector<RestDirection>& rests) {
  double square = 0;
  double weights = 0;
  for (const RestDirection& rest : rests) {
    const StillBlock block = tests::exact_block(unit, rest.up);
    const double off = 1000 * (magnitude_g(six, block.mean_lsb, {}) - 1);
    square += rest.blocks * off * off;
    weights += rest.blocks;
  }
  return std::sqrt(square / weights);
}

// The table of best_six.h, row by row.
TEST(BestSix, WithoutCrossAxisTheSixAreTheTrueSix) {
  const SyntheticUnit unit;
  const BlockFit fit = fit_of(unit, worn(80, 3, true));
  const BestSix six = best_six(fit, 1);
  EXPECT_EQ(six.from, SixFrom::of_fit);
  EXPECT_FALSE(six.unseen_mg);
  EXPECT_EQ(six.calibration, fit.best().calibration);
  EXPECT_LT(difference_over_sphere(tests::truth(unit), six.calibration).worst_mg, 1);
  EXPECT_FALSE(cross_axis_map(fit, six, 0));
}

TEST(BestSix, FewDirectionsAreNoWear) {
  const BlockFit fit = fit_of(crossed_unit(), worn(22, 5, true));
  ASSERT_TRUE(fit.richer);
  const BestSix six = best_six(fit, 1);
  ASSERT_TRUE(six.unseen_mg);
  EXPECT_LT(six.unseen_mg->directions, 30);
  EXPECT_EQ(six.from, SixFrom::of_sensor);
  EXPECT_EQ(six.calibration, fit.best().calibration);
}

TEST(BestSix, AllOverTheSphereTheSensorsOwnAreTheBest) {
  const SyntheticUnit unit = crossed_unit();
  const BlockFit fit = fit_of(unit, anywhere(300, 2, 11));
  const BestSix six = best_six(fit, 1);
  EXPECT_EQ(six.from, SixFrom::of_sensor);
  EXPECT_LT(difference_over_sphere(tests::truth(unit), six.calibration).worst_mg, 1);
}

// Oracle: the generator's readings in directions of the same wear that no fit was given.
TEST(BestSix, ManyDirectionsOnOneSideAreFittedEqually) {
  const SyntheticUnit unit = crossed_unit();
  const BlockFit fit = fit_of(unit, worn(120, 13, false));
  const BestSix six = best_six(fit, 1);
  EXPECT_TRUE(six.from == SixFrom::of_directions || six.from == SixFrom::of_time);
  const auto others = worn(400, 14, false);
  EXPECT_LT(error_mg(unit, six.calibration, others),
            0.9 * error_mg(unit, fit.best().calibration, others));
}

TEST(BestSix, TheTimeAtRestDecidesWhereItIsUneven) {
  const SyntheticUnit unit = crossed_unit();
  const BlockFit fit = fit_of(unit, worn(120, 17, true));
  const BestSix six = best_six(fit, 1);
  EXPECT_EQ(six.from, SixFrom::of_time);
  const auto others = worn(400, 18, true);
  EXPECT_LT(error_mg(unit, six.calibration, others),
            0.9 * error_mg(unit, fit.best().calibration, others));
  EXPECT_LT(error_mg(unit, six.calibration, others), error_mg(unit, fit.fit.calibration, others));
  // Where the unit hardly was they are worse than the sensor's own, and that is known.
  EXPECT_GT(six.elsewhere_mg, 10);
  const auto map = cross_axis_map(fit, six, 0);
  ASSERT_TRUE(map);
  EXPECT_LT(map->unseen_mg, 0.5 * map->six_unseen_mg);
  for (std::size_t k = 0; k < kAxes; ++k) {
    // The fit goes from readings to g, the sensor from g to readings.
    EXPECT_NEAR(map->cross_axis[k], -unit.cross_axis[k], 1e-3);
  }
}

// Terms so large that six constants for the time at rest leave more than the limit elsewhere.
TEST(BestSix, SixThatLeaveTooMuchElsewhereAreNotTried) {
  SyntheticUnit unit = crossed_unit();
  unit.cross_axis = {0.03, 0, 0.01};
  const BlockFit fit = fit_of(unit, worn(120, 19, true));
  const BestSix six = best_six(fit, 1);
  ASSERT_TRUE(six.unseen_mg);
  EXPECT_LT(six.unseen_mg->of_time, 0.9 * six.unseen_mg->of_sensor);
  EXPECT_LT(six.unseen_mg->of_time, six.unseen_mg->of_directions);
  EXPECT_NE(six.from, SixFrom::of_time);
}

// Oracle: GGIR's constants and its measure (mean distance from 1 g over windows of 10 s), on the
// only free-living day there is. The windows are not the blocks that were fitted.
TEST(BestSix, OnARealDayAsGoodAsGgirAndTheMatrixBetter) {
  SIXPOINT_NEED_SHARED("data/autocalibration/agcounts_20h_30hz.csv.gz");
  const auto samples = tests::free_living_counts();
  ASSERT_GT(samples.size(), 2'000'000U);
  const auto reversal = Reversal::of_raw_counts(256, RecordWidth::bits12);
  ASSERT_OK(reversal);
  auto finder = StillBlockFinder::make(*reversal, 30);
  ASSERT_OK(finder);
  finder->push(0, samples);
  const auto report = solve_from_still_blocks(finder->finish(), reversal->calibration());
  ASSERT_OK(report);
  EXPECT_TRUE(report->usable()) << report->brief();
  ASSERT_TRUE(report->cross_axis);
  EXPECT_TRUE(report->cross_axis->verified);
  const auto windows = tests::ggir_windows(samples);
  const auto error = [&](const auto& map) {
    return tests::mean_error_mg(windows,
                                [&](const Vector& mean_lsb) { return map.to_g(mean_lsb); });
  };
  const double ggir_mg = error(tests::ggir_constants());
  const double six_mg = error(*report->calibration);
  const double matrix_mg = error(*report->cross_axis);
  std::printf(
      "real day, %zu GGIR windows, mean error: GGIR %.2f mg, six %.2f mg, matrix %.2f mg; unseen "
      "directions over the time at rest: six %.2f mg, sensor's own six %.2f mg, matrix %.2f mg; "
      "every unseen direction equal: matrix %.2f mg; elsewhere %.0f mg\n",
      windows.size(), ggir_mg, six_mg, matrix_mg, report->six->unseen_chosen_mg(),
      report->six->unseen_mg->of_sensor, report->six->unseen_mg->matrix,
      *report->verification.held_out_rms_mg, report->six->elsewhere_mg);
  EXPECT_NEAR(ggir_mg, 3.94, 0.1);
  EXPECT_LE(six_mg, 4.0);
  EXPECT_LE(matrix_mg, 3.4);
  EXPECT_LE(*report->verification.held_out_rms_mg, 3.6);
  EXPECT_LT(report->six->unseen_mg->matrix, 0.7 * report->six->unseen_chosen_mg());
  EXPECT_LT(report->six->unseen_chosen_mg(), 0.7 * report->six->unseen_mg->of_sensor);
}

}  // namespace
}  // namespace sixpoint::calib

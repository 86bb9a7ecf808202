// Oracle: recordings by tests/gap/made_bundle.h, which shares no code with sim/.
#include "gap/adopt/resimulation.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

std::vector<sim::EffectSpec> one(const char* name, const sim::ParameterSet& given = {}) {
  const auto kind = sim::find_effect(name);
  EXPECT_OK(kind);
  const auto values = sim::complete_parameters(**kind, given);
  EXPECT_OK(values);
  return {{*kind, *values}};
}

// f becomes (1 + S) f, S symmetric with yz, xz, xy.
tests::MadeForce crossed(double yz, double xz, double xy) {
  return [=](const Segment& segment, double) {
    const Eigen::Vector3d f = segment.rotation.col(2);
    return Eigen::Vector3d(f[0] + xy * f[1] + xz * f[2], f[1] + xy * f[0] + yz * f[2],
                           f[2] + xz * f[0] + yz * f[1]);
  };
}

RecordedBundle recorded(const tests::MadeForce& force = {}) {
  auto bundle = recorded_bundle(tests::made_production({.seed = 5}, force), {});
  EXPECT_OK(bundle);
  return *std::move(bundle);
}

TEST(Resimulation, TheTrueEffectClosesTheGap) {
  const RecordedBundle bundle = recorded(crossed(0.006, -0.004, 0.005));
  const auto nominal = gap_with(bundle, {});
  const auto learnt =
      gap_with(bundle, one("non_orthogonality", {{"yz_xz_xy", {0.006, -0.004, 0.005}}}));
  const auto wrong =
      gap_with(bundle, one("non_orthogonality", {{"yz_xz_xy", {-0.006, 0.004, -0.005}}}));
  ASSERT_OK(nominal);
  ASSERT_OK(learnt);
  ASSERT_OK(wrong);
  EXPECT_GT(nominal->gap_mg, 2);
  EXPECT_LT(learnt->gap_mg, 1.5 * learnt->floor_mg);
  EXPECT_NEAR(wrong->gap_mg, 2 * nominal->gap_mg, 0.1 * nominal->gap_mg)
      << "with the wrong sign it doubles";
  EXPECT_EQ(nominal->by_size_mg, 0);
}

// A line does not move the means: its size is compared. 2 mg along each axis are 2 / sqrt(2) mg
// root mean square.
TEST(Resimulation, LinesAreComparedBySize) {
  const auto force = [](const Segment& segment, double t) {
    const double line_g = 0.002 * std::sin(2 * M_PI * 14 * (segment.host_start_s + t) + 0.7);
    return Eigen::Vector3d(segment.rotation.col(2) +
                           segment.rotation * Eigen::Vector3d::Constant(line_g));
  };
  const RecordedBundle bundle = recorded(force);
  const auto nominal = gap_with(bundle, {});
  const auto learnt =
      gap_with(bundle, one("floor_vibration", {{"vector_mg", {2, 2, 2}}, {"frequency_hz", {14}}}));
  ASSERT_OK(nominal);
  ASSERT_OK(learnt);
  EXPECT_NEAR(nominal->by_size_mg, 2 / std::sqrt(2.0), 0.15);
  EXPECT_LT(learnt->by_size_mg, 0.15);
  EXPECT_NEAR(learnt->means_mg, nominal->means_mg, 0.05);
}

TEST(Resimulation, ScatterClosesNothing) {
  const RecordedBundle bundle = recorded();
  const auto nominal = gap_with(bundle, {});
  const auto seated = gap_with(bundle, one("seating"));
  ASSERT_OK(nominal);
  ASSERT_OK(seated);
  EXPECT_EQ(seated->gap_mg, nominal->gap_mg);
  EXPECT_TRUE(is_scatter("flicker"));
  EXPECT_FALSE(is_scatter("drift"));
}

// An effect that the unit does not have makes the gap: nothing is closed by adding.
TEST(Resimulation, AnEffectThatIsNotThereMakesAGap) {
  const RecordedBundle bundle = recorded();
  const auto nominal = gap_with(bundle, {});
  const auto more = gap_with(bundle, one("non_orthogonality", {{"yz_xz_xy", {.005, .005, .005}}}));
  const auto line = gap_with(bundle, one("floor_vibration", {{"vector_mg", {2, 2, 2}}}));
  ASSERT_OK(nominal);
  ASSERT_OK(more);
  ASSERT_OK(line);
  EXPECT_LT(nominal->gap_mg, 1.5 * nominal->floor_mg);
  EXPECT_GT(more->gap_mg, 2);
  EXPECT_GT(line->by_size_mg, 1);
}

// A wrong acquisition mode: gain 0.88 and offsets of 0.12 g, and what is left of them.
TEST(Resimulation, AFilterMismatchCountsWithGainAndOffsets) {
  tests::MadeUnit unit{.gain = {0.88, 0.885, 0.875}, .offset_g = {0.12, -0.13, 0.11}, .seed = 8};
  auto bundle = recorded_bundle(tests::made_production(unit), {});
  ASSERT_OK(bundle);
  ASSERT_FALSE(bundle->diagnosis.effects.empty());
  ASSERT_EQ(bundle->diagnosis.effects[0].name, "filter_mismatch");
  const auto nominal = gap_with(*bundle, {});
  const auto learnt = gap_with(
      *bundle, one("filter_mismatch", {{"gain", {0.88}}, {"offset_g", {0.12, -0.12, 0.12}}}));
  ASSERT_OK(nominal);
  ASSERT_OK(learnt);
  EXPECT_GT(nominal->by_size_mg, 100);
  EXPECT_LT(learnt->by_size_mg, 20) << "offsets of the unit itself";
}

// The temperatures of a run before the host's zero are simulated, too. Oracle: the same run later.
TEST(Resimulation, TheHostsClockMayBeginAnywhere) {
  Bundle later = tests::made_production({.seed = 5});
  for (int second = 0; second < 400; ++second) {
    later.temperature.host_time_s.push_back(second);
    later.temperature.temperature_c.push_back(20 + 0.05 * second);
  }
  Bundle earlier = later;
  constexpr double kEarlier_s = 10'000;
  for (Segment& segment : earlier.segments) {
    segment.host_start_s -= kEarlier_s;
  }
  for (double& time_s : earlier.temperature.host_time_s) {
    time_s -= kEarlier_s;
  }
  for (double& time_s : earlier.host_clock.host_time_s) {
    time_s -= kEarlier_s;
  }
  const auto gap_of = [](const Bundle& bundle) {
    const auto made = recorded_bundle(bundle, {});
    EXPECT_OK(made);
    const auto gap = gap_with(*made, one("offset_tempco", {{"mg_per_c", {1, 1, 1}}}));
    EXPECT_OK(gap);
    return gap->gap_mg;
  };
  const double gap_mg = gap_of(later);
  EXPECT_GT(gap_mg, 1);
  EXPECT_NEAR(gap_of(earlier), gap_mg, 0.01 * gap_mg);
}

}  // namespace
}  // namespace sixpoint::gap

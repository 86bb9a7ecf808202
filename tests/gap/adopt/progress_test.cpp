#include "gap/adopt/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

using testing::HasSubstr;

tests::MadeForce one_cross(double xy) {
  return [xy](const Segment& segment, double) {
    const Eigen::Vector3d f = segment.rotation.col(2);
    return Eigen::Vector3d(f[0] + xy * f[1], f[1] + xy * f[0], f[2]);
  };
}

RecordedBundle unit_with(const char* serial, unsigned seed, double xy) {
  Bundle bundle = tests::made_production({.seed = seed}, one_cross(xy));
  bundle.protocol_serial = serial;
  auto made = recorded_bundle(std::move(bundle), {});
  EXPECT_OK(made);
  return *std::move(made);
}

sim::PopulationEffect cross_population(double xy) {
  const auto kind = sim::find_effect("non_orthogonality");
  EXPECT_OK(kind);
  return {*kind, {{"yz_xz_xy", {0, 0, xy}}}, {{"yz_xz_xy", {0, 0, 0}}}, 1};
}

TEST(GapProgressReport, SaysWhatEachAdoptionClosed) {
  const RecordedBundle known = unit_with("A", 2, 0.008);
  const RecordedBundle fresh = unit_with("B", 3, 0.008);
  ScenarioHistory history;
  history.states = {{1, "2026-01-01T00:00:00Z", 1, {cross_population(0.004)}},
                    {2, "2026-02-01T00:00:00.123456789Z", 2, {cross_population(0.008)}}};
  history.documents = {evidence_of(known.diagnosis).id};
  ProgressRecorder recorder(history);
  ASSERT_OK(recorder.add("a", known));
  ASSERT_OK(recorder.add("b <b>", fresh));
  const GapProgress progress = recorder.finish();
  ASSERT_EQ(progress.bundles.size(), 2U);
  EXPECT_TRUE(progress.bundles[0].learnt_from);
  EXPECT_FALSE(progress.bundles[1].learnt_from);
  EXPECT_EQ(progress.new_ones.bundles, 1U);
  // Oracle: half of the effect leaves half of the gap, all of it leaves the floor.
  const ProgressSum& sum = progress.new_ones;
  EXPECT_NEAR(sum.after_mg[0], sum.before_mg / 2, 0.05 * sum.before_mg);
  EXPECT_LT(sum.after_mg[1], 1.5 * sum.floor_mg);
  ASSERT_TRUE(sum.closed.fraction.has_value());
  EXPECT_GT(*sum.closed.fraction, 0.97);
  EXPECT_LE(*sum.closed.fraction, 1) << "also where less than the floor is left";
  ASSERT_EQ(progress.effects.size(), 1U);
  EXPECT_NEAR(progress.effects[0].without_mg, progress.all.before_mg, 1e-9)
      << "without its only effect nothing was learnt";
  EXPECT_NEAR(progress.effects[0].closed.fraction.value(), progress.all.closed.fraction.value(),
              1e-9);
  EXPECT_THAT(progress.brief(), HasSubstr("did not learn"));
  EXPECT_TRUE(progress.usable());

  const auto json = progress.to_json();
  EXPECT_EQ(json["adoptions"][1]["effects"][0], "non_orthogonality");
  EXPECT_EQ(json["new"]["bundles"], 1);
  EXPECT_EQ(json["bundles"][0]["learnt_from"], true);
  const std::string page = progress_html(progress);
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("b &lt;b&gt;"));
  EXPECT_THAT(page, HasSubstr("after adoption 2 (2026-02-01 00:00:00 UTC)"));
  EXPECT_THAT(page, testing::Not(
                        testing::AnyOf(HasSubstr("http"), HasSubstr("src="), HasSubstr("<script"))))
      << "one page without other files";
}

TEST(Closed, FollowsTheTable) {
  EXPECT_EQ(closed_of(0.26, 5.87, 0.26, 0.21).text(), "wider by 5.61 mg");
  EXPECT_FALSE(closed_of(0.26, 5.87, 0.26, 0.21).fraction.has_value());
  EXPECT_EQ(closed_of(9, 10, 20, 1).text(), "wider by 1.00 mg") << "an effect that does harm";
  EXPECT_EQ(closed_of(1.5, 1.2, 1.5, 1).text(), "next to nothing was open");
  EXPECT_FALSE(closed_of(1.5, 1.2, 1.5, 1).fraction.has_value());
  EXPECT_EQ(closed_of(5, 3, 5, 0).fraction, 16.0 / 25);
  EXPECT_EQ(closed_of(5, 3, 5, 0).text(), "64.0 %");
  EXPECT_EQ(closed_of(5, 0.9, 5, 1).fraction, 1.0) << "below the floor is chance";
}

// A scenario that does not suit the unit: no share in the JSON, and words for people.
TEST(GapProgressReport, WhereTheGapBecomesWiderThereIsNoShare) {
  ScenarioHistory history;
  history.states = {{1, "2026-01-01T00:00:00Z", 1, {cross_population(0.02)}}};
  ProgressRecorder recorder(history);
  ASSERT_OK(recorder.add("a", unit_with("A", 2, 0)));
  const GapProgress progress = recorder.finish();
  ASSERT_GT(progress.all.after_mg.back(), progress.all.before_mg);
  EXPECT_THAT(progress.brief(), HasSubstr("): wider by "));
  const auto json = progress.to_json();
  EXPECT_TRUE(json["all"]["closed_fraction"].is_null());
  EXPECT_TRUE(json["effects"][0]["closed_fraction"].is_null());
  EXPECT_THAT(progress_html(progress), HasSubstr("<td>wider by "));
}

TEST(GapProgressReport, WithoutAdoptionsOrRecordingsItSaysSo) {
  ProgressRecorder nothing({});
  EXPECT_FALSE(nothing.finish().usable());
  EXPECT_THAT(nothing.finish().brief(), HasSubstr("no recording"));
  EXPECT_THAT(progress_html(nothing.finish()), HasSubstr("no recording"));
  ASSERT_OK(nothing.add("a", unit_with("A", 2, 0.008)));
  EXPECT_THAT(nothing.finish().brief(), HasSubstr("learnt nothing"));
  EXPECT_FALSE(nothing.finish().usable());
  Bundle empty = tests::made_production({});
  empty.samples.assign(empty.samples.size(), {});
  const auto inconclusive = recorded_bundle(std::move(empty), {});
  ASSERT_OK(inconclusive);
  ProgressRecorder lost({});
  ASSERT_OK(lost.add("c", *inconclusive));
  EXPECT_EQ(lost.finish().losses.size(), 1U);
}

}  // namespace
}  // namespace sixpoint::gap

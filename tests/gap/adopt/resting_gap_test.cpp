// The loop on a real day of free living (../shared/data/autocalibration, 20 hours of a GT9X): the
// first half is diagnosed and adopted, the second half, which nothing was fitted to, is measured.
#include "gap/adopt/resting_gap.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/adopt/adopted_scenario.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

std::string unzipped(const std::string& path) {
  std::string text;
  const gzFile file = gzopen(path.c_str(), "rb");
  EXPECT_NE(file, nullptr);
  std::string piece(1 << 20, '\0');
  for (int count = 1; count > 0;) {
    count = gzread(file, piece.data(), static_cast<unsigned>(piece.size()));
    text.append(piece, 0, static_cast<std::size_t>(std::max(0, count)));
  }
  gzclose(file);
  return text;
}

TEST(RestingGap, ARealDaysSecondHalfIsCloserAfterAdoptingTheFirst) {
  SIXPOINT_NEED_SHARED("data/autocalibration/agcounts_20h_30hz.csv.gz");
  const std::string text =
      unzipped(tests::shared_file("data/autocalibration/agcounts_20h_30hz.csv.gz"));
  const std::size_t head = text.find('\n') + 1;
  const std::size_t middle = text.find('\n', text.size() / 2) + 1;
  MemoryEnv memory;
  ASSERT_OK(write_file(memory.files, "first.csv", text.substr(0, middle)));
  ASSERT_OK(write_file(memory.files, "second.csv", text.substr(0, head) + text.substr(middle)));
  const ReadingsTableOptions rate{.rate_hz = 30};

  const auto diagnosis = diagnose_table(memory.files, "first.csv", {}, rate);
  ASSERT_OK(diagnosis);
  const auto learnt = adopt("", {evidence_of(*diagnosis)}, from_unix_seconds(1'400'000'000));
  ASSERT_OK(learnt);
  const auto history = adoption_history(learnt->text);
  ASSERT_OK(history);
  ASSERT_EQ(history->states[0].population.size(), 1U);
  EXPECT_EQ(history->states[0].population[0].kind->name, "non_orthogonality");

  const auto second = read_readings_table(memory.files, "second.csv", rate);
  ASSERT_OK(second);
  const auto before = resting_gap(second->rests, {});
  const auto after = resting_gap(second->rests, sim::mean_effects(history->states[0].population));
  ASSERT_OK(before);
  ASSERT_OK(after);
  RecordProperty("before_ug", static_cast<int>(1000 * before->gap_mg));
  RecordProperty("after_ug", static_cast<int>(1000 * after->gap_mg));
  EXPECT_EQ(before->rests, after->rests);
  // Oracle: the cross-axis terms that the second half itself has. The first half's close nine
  // tenths of what those close.
  const auto own_diagnosis = diagnose_table(memory.files, "second.csv", {}, rate);
  ASSERT_OK(own_diagnosis);
  const auto own_scenario = adopt("", {evidence_of(*own_diagnosis)}, from_unix_seconds(0));
  ASSERT_OK(own_scenario);
  const auto own_history = adoption_history(own_scenario->text);
  ASSERT_OK(own_history);
  const auto own = resting_gap(second->rests, sim::mean_effects(own_history->states[0].population));
  ASSERT_OK(own);
  const auto closed = [&](const RestingGap& gap) {
    return before->gap_mg * before->gap_mg - gap.gap_mg * gap.gap_mg;
  };
  EXPECT_GT(closed(*after), 0.9 * closed(*own));
  EXPECT_LT(after->gap_mg, 0.7 * before->gap_mg);
}

// Closed form: directions all round with a cross-axis term, and the simulator with the same one.
TEST(RestingGap, TheTrueEffectLeavesNothing) {
  const double xy = 0.01;
  std::vector<RestingReading> rests;
  for (int i = 0; i < 60; ++i) {
    const double z = -1 + (2.0 * i + 1) / 60;
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d up(r * std::cos(2.4 * i), r * std::sin(2.4 * i), z);
    RestingReading rest;
    rest.mean = Eigen::Vector3d(250 * (up[0] + xy * up[1]) + 10, 255 * (up[1] + xy * up[0]) - 20,
                                260 * up[2] + 5);
    rests.push_back(rest);
  }
  const auto kind = sim::find_effect("non_orthogonality");
  ASSERT_OK(kind);
  const auto before = resting_gap(rests, {});
  const auto after = resting_gap(rests, {{*kind, {{"yz_xz_xy", {0, 0, xy}}}}});
  ASSERT_OK(before);
  ASSERT_OK(after);
  EXPECT_GT(before->gap_mg, 3);
  EXPECT_LT(after->gap_mg, 0.05 * before->gap_mg);
  EXPECT_FAILS(resting_gap({}, {}), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gap

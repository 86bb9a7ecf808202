#include "calib/verify.h"

#include <gmock/gmock.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using testing::Contains;
using testing::HasSubstr;
using tests::SyntheticUnit;

Verification verify_blocks(const std::vector<StillBlock>& blocks, const Calibration& file,
                           const std::optional<Calibration>& chosen = {}) {
  const auto fit = fit_blocks(blocks, file);
  EXPECT_OK(fit);
  return verify(blocks, file, chosen.value_or(fit->best().calibration), *fit, {}, {});
}

// The table of verify.h, row by row.
TEST(Verify, ADirectionIsMissing) {
  const SyntheticUnit unit;
  auto directions = tests::cube_directions();
  std::erase_if(directions, [](const tests::Vector& n) { return n[2] < -0.1; });
  const auto v = verify_blocks(tests::exact_blocks(unit, directions, 4), tests::truth(unit));
  EXPECT_EQ(v.verdict, Verdict::incomplete);
  EXPECT_EQ(v.missing_directions, std::vector<std::string>{"-z"});
  EXPECT_FALSE(v.usable());
}

TEST(Verify, HeldOutDirectionsAgree) {
  const SyntheticUnit unit;
  const auto v = verify_blocks(tests::exact_blocks(unit, tests::cube_directions(), 4),
                               tests::file_constants(unit));
  EXPECT_EQ(v.verdict, Verdict::verified) << v.brief();
  EXPECT_EQ(v.directions, 26);
  EXPECT_EQ(v.held_out_directions, 26);
}

TEST(Verify, SixSidesThatRepeat) {
  const SyntheticUnit unit;
  const auto v =
      verify_blocks(tests::exact_blocks(unit, tests::kSixSides, 10), tests::file_constants(unit));
  EXPECT_EQ(v.verdict, Verdict::verified_by_repeatability) << v.brief();
  ASSERT_TRUE(v.halves_mg);
  EXPECT_NEAR(*v.halves_mg, 0, 1e-6);  // both halves are the same readings
  EXPECT_TRUE(v.usable());
}

TEST(Verify, SixSidesWithTooFewBlocks) {
  const SyntheticUnit unit;
  const auto v =
      verify_blocks(tests::exact_blocks(unit, tests::kSixSides, 2), tests::file_constants(unit));
  EXPECT_EQ(v.verdict, Verdict::not_verified);
  EXPECT_THAT(v.reasons, Contains(HasSubstr("(needed: 3)")));
}

// Constants 2 % too large read 20 mg too much everywhere (limit 16).
TEST(Verify, ConstantsThatDoNotFitTheBlocks) {
  const SyntheticUnit unit;
  Calibration wrong = tests::truth(unit);
  for (double& sensitivity : wrong.sensitivity_g_per_lsb) {
    sensitivity *= 1.02;
  }
  const auto v = verify_blocks(tests::exact_blocks(unit, tests::cube_directions(), 4),
                               tests::file_constants(unit), wrong);
  EXPECT_EQ(v.verdict, Verdict::not_verified);
  EXPECT_NEAR(v.applied_rms_mg, 20, 1e-6);
  EXPECT_THAT(v.reasons, Contains(HasSubstr("20.0 mg from 1 g")));
}

TEST(Verify, ConstantsOfNoWorkingSensor) {
  SyntheticUnit unit;
  unit.counts_per_g = {255.0 * 0.6, 255, 255};  // the file's constants have 255
  const auto v = verify_blocks(tests::exact_blocks(unit, tests::cube_directions(), 4),
                               tests::file_constants(unit));
  EXPECT_EQ(v.verdict, Verdict::not_verified);
  EXPECT_THAT(v.reasons, Contains(HasSubstr("not that of a working sensor")));
}

TEST(Verify, NamesOfTheVerdicts) {
  EXPECT_EQ(to_string(Verdict::verified), "verified");
  EXPECT_EQ(to_string(Verdict::verified_by_repeatability), "verified_by_repeatability");
  EXPECT_EQ(to_string(Verdict::incomplete), "incomplete");
  EXPECT_EQ(to_string(Verdict::not_verified), "not_verified");
  EXPECT_EQ(to_string(Verdict::rests_on_prior), "rests_on_prior");
}

}  // namespace
}  // namespace sixpoint::calib

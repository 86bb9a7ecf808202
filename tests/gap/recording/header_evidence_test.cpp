// The table of header_evidence.h, row by row, on a unit of exactly 256 LSB/g at 100 Hz.
#include "gap/recording/header_evidence.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

// A unit without error: gravity at rest has the length 256 LSB, the stamps say 100 Hz.
Bundle exact_unit() {
  tests::MadeUnit unit;
  unit.gain = Eigen::Vector3d::Ones();
  unit.offset_g = Eigen::Vector3d::Zero();
  return tests::made_production(unit);
}

HeaderClaims scale_claim(double lsb_per_g, const char* source = "info.txt") {
  HeaderClaims claims;
  claims.scales = {{source, lsb_per_g}};
  return claims;
}

void multiply_samples(Bundle& bundle, double by) {
  for (gt3x::Counts& counts : bundle.samples) {
    for (std::int16_t& x : counts) {
      x = static_cast<std::int16_t>(std::lround(by * x));
    }
  }
}

bool says(const std::string& text, const char* words) {
  return text.find(words) != std::string::npos;
}

TEST(HeaderEvidence, ClaimsThatAgreeLeaveNoLineInTheLosses) {
  Bundle bundle = exact_unit();
  HeaderClaims claims = scale_claim(256);
  claims.scales.push_back({"PARAMETERS", 256.4});  // digits that were cut
  claims.rate_hz = 100.4;
  claims.samples_per_record = 100;
  EXPECT_OK(check_header(claims, bundle));
  EXPECT_OK(check_header({}, bundle));
  EXPECT_TRUE(bundle.losses.empty()) << bundle.losses.front();
}

TEST(HeaderEvidence, ScaleOfTheHeaderIsSetAsideWhenTheSamplesAgreeWithTheProtocol) {
  for (const double header : {200.0, 290.0, 341.0, 512.0}) {
    Bundle bundle = exact_unit();
    EXPECT_OK(check_header(scale_claim(header), bundle));
    ASSERT_EQ(bundle.losses.size(), 1U) << header;
    EXPECT_TRUE(says(bundle.losses[0], "set aside")) << bundle.losses[0];
    EXPECT_TRUE(says(bundle.losses[0], "1.000 g by the protocol's")) << bundle.losses[0];
    EXPECT_EQ(bundle.accel_scale_lsb_per_g, 256);
  }
}

TEST(HeaderEvidence, EachContradictingSourceHasALineWithItsName) {
  Bundle bundle = exact_unit();
  HeaderClaims claims = scale_claim(341);
  claims.scales.push_back({"PARAMETERS", 200});
  EXPECT_OK(check_header(claims, bundle));
  ASSERT_EQ(bundle.losses.size(), 2U);
  EXPECT_TRUE(says(bundle.losses[0], "info.txt says 341")) << bundle.losses[0];
  EXPECT_TRUE(says(bundle.losses[1], "PARAMETERS says 200")) << bundle.losses[1];
}

TEST(HeaderEvidence, ScaleOfTheProtocolIsRefusedWhenTheSamplesAgreeWithTheHeader) {
  Bundle bundle = exact_unit();
  bundle.accel_scale_lsb_per_g = 341;
  const Status status = check_header(scale_claim(256), bundle);
  EXPECT_FAILS(status, ErrorCode::bad_data);
  EXPECT_EQ(status.error().where, "made/protocol.json: accel_scale_lsb_per_g");
  EXPECT_TRUE(says(status.error().what, "256")) << status.error().what;
  EXPECT_TRUE(says(status.error().what, "0.751 g by the protocol's"))  // 256 / 341
      << status.error().what;
  EXPECT_TRUE(says(status.error().hint, "agree with the header")) << status.error().hint;
}

TEST(HeaderEvidence, ScaleIsRefusedWhenTheSamplesAgreeWithNeither) {
  Bundle bundle = exact_unit();
  bundle.accel_scale_lsb_per_g = 200;
  const Status status = check_header(scale_claim(310), bundle);
  EXPECT_FAILS(status, ErrorCode::bad_data);
  EXPECT_TRUE(says(status.error().hint, "neither")) << status.error().hint;
}

// gap.md: a filter mismatch makes 0.80 to 0.95 g of 1 g. By the header's 341 LSB/g it would be
// 0.64 g, which no mismatch is.
TEST(HeaderEvidence, LengthThatAFilterMismatchExplainsAgreesWithTheProtocol) {
  Bundle bundle = exact_unit();
  multiply_samples(bundle, 0.85);
  EXPECT_OK(check_header(scale_claim(341), bundle));
  ASSERT_EQ(bundle.losses.size(), 1U);
  EXPECT_TRUE(says(bundle.losses[0], "set aside")) << bundle.losses[0];
  EXPECT_TRUE(says(bundle.losses[0], "0.850 g")) << bundle.losses[0];
}

// Units differ by 2 % themselves: 250 and 256 LSB/g are 2.4 % apart.
TEST(HeaderEvidence, SmallDifferenceOfScalesIsALossOfItsSize) {
  Bundle bundle = exact_unit();
  bundle.accel_scale_lsb_per_g = 250;
  EXPECT_OK(check_header(scale_claim(256), bundle));
  ASSERT_EQ(bundle.losses.size(), 1U);
  EXPECT_TRUE(says(bundle.losses[0], "in doubt by 2.4 %")) << bundle.losses[0];
}

TEST(HeaderEvidence, ScaleCannotBeDecidedFromZerosOrClippedSamples) {
  for (const gt3x::Counts& value : {gt3x::Counts{}, gt3x::Counts{2047, 0, 0}}) {
    Bundle bundle = exact_unit();
    std::fill(bundle.samples.begin(), bundle.samples.end(), value);
    EXPECT_OK(check_header(scale_claim(341), bundle));
    ASSERT_EQ(bundle.losses.size(), 1U);
    EXPECT_TRUE(says(bundle.losses[0], "can't say")) << bundle.losses[0];
    EXPECT_TRUE(says(bundle.losses[0], "in doubt by 33.2 %")) << bundle.losses[0];
  }
}

// An offset of 0.3 g along Z makes 1.3 g and 0.7 g of two opposite faces, whose mean is 1 g. One of
// them recorded twenty times more must not pull the mean.
TEST(HeaderEvidence, OppositeFacesCancelOffsetsHoweverOftenOneWasRecorded) {
  tests::MadeUnit unit;
  unit.gain = Eigen::Vector3d::Ones();
  unit.offset_g = {0, 0, 0.3};
  Bundle bundle = tests::made_production(unit);
  std::erase_if(bundle.segments, [](const Segment& s) { return std::abs(s.rotation(2, 2)) < 0.5; });
  const auto up = std::find_if(bundle.segments.begin(), bundle.segments.end(),
                               [](const Segment& s) { return s.rotation(2, 2) > 0.5; });
  ASSERT_NE(up, bundle.segments.end());
  const Segment often = *up;
  bundle.segments.insert(bundle.segments.end(), 20, often);
  EXPECT_OK(check_header(scale_claim(341), bundle));
  ASSERT_EQ(bundle.losses.size(), 1U);
  EXPECT_TRUE(says(bundle.losses[0], "1.000 g by the protocol's")) << bundle.losses[0];
}

HeaderClaims rate_claim(std::optional<double> rate_hz, std::optional<double> per_record = {}) {
  HeaderClaims claims;
  claims.rate_hz = rate_hz;
  claims.samples_per_record = per_record;
  return claims;
}

TEST(HeaderEvidence, RateOfTheHeaderIsSetAsideWhenTheStampsAgreeWithTheProtocol) {
  Bundle bundle = exact_unit();
  EXPECT_OK(check_header(rate_claim(30), bundle));
  ASSERT_EQ(bundle.losses.size(), 1U);
  EXPECT_TRUE(says(bundle.losses[0], "stamps bear out")) << bundle.losses[0];
}

TEST(HeaderEvidence, RecordsLengthDecidesOnTheRateWithoutStamps) {
  Bundle bundle = exact_unit();
  bundle.host_clock = {};
  EXPECT_OK(check_header(rate_claim(30, 100), bundle));
  ASSERT_EQ(bundle.losses.size(), 1U);
  EXPECT_TRUE(says(bundle.losses[0], "records' lengths bear out")) << bundle.losses[0];
}

TEST(HeaderEvidence, RateOfTheProtocolIsRefusedWhenTheStampsDisagree) {
  // The header agrees with the stamps, says nothing, or is as wrong as the protocol.
  for (const std::optional<double> header : {std::optional(100.0), {}, std::optional(30.0)}) {
    Bundle bundle = exact_unit();
    bundle.rate_hz = 30;
    const Status status = check_header(rate_claim(header), bundle);
    EXPECT_FAILS(status, ErrorCode::bad_data);
    EXPECT_EQ(status.error().where, "made/protocol.json: sample_rate_hz");
    EXPECT_TRUE(says(status.error().what, "stamps 100.0 Hz")) << status.error().what;
  }
}

TEST(HeaderEvidence, OfTwoNearRatesTheNearerToTheStampsIsRight) {
  Bundle wrong = exact_unit();
  wrong.rate_hz = 101;
  EXPECT_FAILS(check_header(rate_claim(100, 100), wrong), ErrorCode::bad_data);
  Bundle right = exact_unit();
  EXPECT_OK(check_header(rate_claim(101, 100), right));
  EXPECT_EQ(right.losses.size(), 1U);
}

TEST(HeaderEvidence, RatesThatContradictWithNothingToDecideAreRefused) {
  Bundle bundle = exact_unit();
  bundle.host_clock = {};
  EXPECT_FAILS(check_header(rate_claim(30), bundle), ErrorCode::bad_data);
}

// A sample clock may be off by 5000 ppm, and samples are lost: no contradiction.
TEST(HeaderEvidence, ClockErrorOfAPercentIsNoContradiction) {
  Bundle bundle = exact_unit();
  for (const Segment& segment : bundle.segments) {
    for (std::size_t i = 0; i < bundle.host_clock.sample_index.size(); ++i) {
      const std::size_t at = bundle.host_clock.sample_index[i];
      if (at >= segment.first_sample && at < segment.first_sample + segment.samples) {
        bundle.host_clock.host_time_s[i] =
            segment.host_start_s + static_cast<double>(at - segment.first_sample) / 99;
      }
    }
  }
  EXPECT_OK(check_header(rate_claim(100), bundle));
  EXPECT_TRUE(bundle.losses.empty()) << bundle.losses.front();
}

}  // namespace
}  // namespace sixpoint::gap

#include "repair/compare/compare.h"

#include <cmath>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "expect_result.h"
#include "repair/compare/made_trace.h"
#include "shared_data.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;
using tests::recorded;

// Oracle: the lag that was built in, to a fiftieth of a sample and to the uncertainty stated.
TEST(Compare, FindsTheLagToAFractionOfASample) {
  for (const double lag_s : {0.0, 0.0123, -0.517, 3.3333, -41.77}) {
    const Trace a = recorded("a", {}, 900);
    const Trace b = recorded("b", {.lag_s = lag_s, .seed = 2}, 900);
    const auto result = compare(a, b);
    ASSERT_OK(result);
    EXPECT_TRUE(result->aligned) << lag_s;
    EXPECT_NEAR(result->lag_s, lag_s, 0.0007) << lag_s;
    // What is left is the noise of two units (cubic interpolation keeps about 0.8 of B's).
    EXPECT_NEAR(result->rms_mg, 2.6, 0.4) << lag_s;
  }
}

TEST(Compare, FindsTheDriftOfAClock) {
  const Trace a = recorded("a", {}, 7200);
  const Trace b = recorded("b", {.rate_hz = 100, .lag_s = 1.25, .drift_ppm = 30, .seed = 2}, 7200);
  const auto result = compare(a, b);
  ASSERT_OK(result);
  EXPECT_NEAR(result->drift_ppm, 30, 1);
  const double middle_s = result->lag_at_s - a.start_s();
  EXPECT_NEAR(result->lag_s, 1.25 + 30e-6 * middle_s, 0.001);
  EXPECT_LT(result->rms_mg, 4);
}

// Oracle: an offset of 100 mg is one in every envelope, and moves the whole histogram.
TEST(Compare, EnvelopesShowAnOffset) {
  const Trace a = recorded("a", {}, 900);
  const Trace b = recorded("b", {.lag_s = 0.2, .offset_g = 0.1, .seed = 2}, 900);
  const auto result = compare(a, b);
  ASSERT_OK(result);
  EXPECT_NEAR(result->envelope.mean_mg, 100, 1);
  EXPECT_NEAR(result->rms_mg, 100, 1);
  EXPECT_LT(result->envelope.sd_mg, 10);
  const Histogram& histogram = result->histogram;
  ASSERT_EQ(histogram.edges_mg.size(), histogram.counts.size() + 1);
  std::uint64_t all = 0;
  std::uint64_t near = 0;
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    all += histogram.counts[i];
    if (histogram.edges_mg[i + 1] > 80 && histogram.edges_mg[i] < 120) {
      near += histogram.counts[i];
    }
  }
  EXPECT_EQ(all, result->envelope.errors);
  EXPECT_GT(near, all * 9 / 10);
}

TEST(Compare, GapsAreLeftOut) {
  Trace a = recorded("a", {}, 600);
  std::vector<float> holes;
  const Trace whole = recorded("b", {.lag_s = 0.1, .seed = 2}, 600);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    holes.push_back(i > 6000 && i < 9000 ? std::nanf("") : whole.magnitude_g(i));
  }
  const Trace b = Trace::from_magnitudes("b", whole.start_s(), 30, std::move(holes));
  const auto result = compare(a, b);
  ASSERT_OK(result);
  EXPECT_NEAR(result->lag_s, 0.1, 0.001);
  EXPECT_NEAR(result->overlap_s, 500, 1);
  EXPECT_LT(result->rms_mg, 4);
}

TEST(Compare, SaysWhenItCannotAlign) {
  const auto rest = [](const std::string& name, std::uint64_t seed) {
    Random random(seed);
    std::vector<float> values(std::size_t{30} * 300);
    for (float& value : values) {
      value = static_cast<float>(1 + 0.002 * random.normal());
    }
    return Trace::from_magnitudes(name, 1e9, 30, std::move(values));
  };
  const auto still = compare(rest("a", 1), rest("b", 2));
  ASSERT_OK(still);
  EXPECT_FALSE(still->aligned);
  EXPECT_FALSE(still->usable());
  ASSERT_FALSE(still->remarks.empty());
  EXPECT_THAT(still->remarks[0], HasSubstr("nothing moved"));
  const Trace elsewhere = Trace::from_magnitudes("c", 2e9, 30, std::vector<float>(3000, 1.0F));
  EXPECT_FAILS(compare(rest("a", 1), elsewhere), ErrorCode::bad_data);
}

// The two affected units ran on one shaker at the same time. Oracle: 2.0, 3.0 and 4.0 Hz give lags
// modulo different periods; the one that they have in common lies between -0.5 and -0.65 s.
TEST(Compare, RealUnitsOnOneShaker) {
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected/MOS2A45130450.gt3x");
  const std::string folder = tests::shared_file("data/wgt3x-bt-affected/");
  auto& files = posix_env().files;
  const auto a = Trace::load(files, folder + "MOS2A45130450.gt3x");
  const auto b = Trace::load(files, folder + "MOS2A45130451.gt3x");
  ASSERT_OK(a);
  ASSERT_OK(b);
  const auto result = compare(*a, *b);
  ASSERT_OK(result);
  EXPECT_TRUE(result->aligned);
  EXPECT_GT(result->minutes_used, 10U);
  EXPECT_NEAR(result->lag_s, -0.57, 0.06);
  EXPECT_LT(result->lag_uncertainty_s, 0.5) << "one period of 2 Hz";
  EXPECT_LT(std::abs(result->drift_ppm), 60);
  EXPECT_GT(result->overlap_s, 2000);
  // The other way round is the same with the sign turned.
  const auto turned = compare(*b, *a);
  ASSERT_OK(turned);
  EXPECT_NEAR(turned->lag_s, -result->lag_s, 0.05);
}

}  // namespace
}  // namespace sixpoint::repair

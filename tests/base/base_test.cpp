#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/random.h"
#include "base/sha256.h"
#include "base/time.h"
#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Error, BriefIsOneSafeLine) {
  const Error error{ErrorCode::bad_data, "no\nlog.bin", "a\x1b[2J.gt3x", "download it again"};
  EXPECT_EQ(error.brief(), "a\\x1b[2J.gt3x: no\\x0alog.bin; download it again");
  EXPECT_EQ(printable(std::string(10'000, 'a')).size(), 403U);
}

TEST(Time, SpellsAndReads) {
  EXPECT_EQ(to_iso8601(from_unix_seconds(1'395'619'200)), "2014-03-24T00:00:00Z");
  EXPECT_EQ(to_iso8601(from_unix_seconds(0) + std::chrono::milliseconds(125)),
            "1970-01-01T00:00:00.125Z");
  EXPECT_EQ(to_iso8601(from_unix_seconds(-1)), "1969-12-31T23:59:59Z");
  EXPECT_EQ(to_unix_seconds(*parse_iso8601("2014-03-24")), 1'395'619'200);
  EXPECT_EQ(to_unix_seconds(*parse_iso8601("2013-11-12T14:32:13Z")), 1'384'266'733);
  for (const std::int64_t ns : {0LL, 125'000'000LL, 783'353'223LL, 999'999'999LL}) {
    const UtcTime time = from_unix_seconds(1'395'619'200) + std::chrono::nanoseconds(ns);
    EXPECT_EQ(parse_iso8601(to_iso8601(time)).value(), time);
  }
  for (const char* wrong :
       {"", "2014", "2014-03-24T00:00:00.", "2014-03-24.5", "2014-03-24T00:00:00.1x",
        "2014-03-24T00:00:00.1234567890", "2014-02-30", "2014-3-24", "2014-03-24T25:00:00",
        "20a4-03-24", "9999-01-01", "2014-03-24 00:00:00"}) {
    EXPECT_FAILS(parse_iso8601(wrong), ErrorCode::bad_data);
  }
}

// Oracle: the examples of FIPS 180-4 ("abc", empty).
TEST(Sha256, PublishedVectors) {
  EXPECT_EQ(to_hex(sha256({})), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 hash;
  hash.update("a");
  hash.update("bc");
  EXPECT_EQ(to_hex(hash.finish()),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// Oracle: closed-form moments, with bounds of five standard errors.
TEST(Random, MomentsOfUniformAndNormal) {
  Random random(7);
  constexpr int kCount = 200'000;
  double sum = 0;
  double sum2 = 0;
  double sum4 = 0;
  double uniform_sum = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    sum += x;
    sum2 += x * x;
    sum4 += x * x * x * x;
    const double u = random.uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    uniform_sum += u;
  }
  EXPECT_NEAR(sum / kCount, 0, 5 / std::sqrt(kCount));
  EXPECT_NEAR(sum2 / kCount, 1, 5 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(sum4 / kCount, 3, 5 * std::sqrt(96.0 / kCount));
  EXPECT_NEAR(uniform_sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
}

TEST(Random, SameSeedSameNumbersOtherStreamOthers) {
  Random a(5, 1);
  Random b(5, 1);
  Random c(5, 2);
  bool differ = false;
  for (int i = 0; i < 100; ++i) {
    const auto bits = a.bits();
    EXPECT_EQ(bits, b.bits());
    differ = differ || bits != c.bits();
    EXPECT_LT(a.below(7), 7U);
    b.below(7);
  }
  EXPECT_TRUE(differ);
}

}  // namespace
}  // namespace sixpoint

#include "calib/trust.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sixpoint::calib {
namespace {

TEST(Trust, FollowsTheTable) {
  struct Row {
    TrustEvidence evidence;
    Trusted trusted;
    const char* said;
  };
  const Row rows[] = {
      {{false, false, 0.1, 1, 1}, Trusted::neither, "converge"},
      {{false, true, 0.1, 1, 1}, Trusted::genetic, "least squares did not converge"},
      {{true, false, 0.1, 1, 1}, Trusted::least_squares, "did not settle"},
      {{true, true, 1.0, 2, 1}, Trusted::both, "agree to 1.00 mg"},
      {{true, true, 1.1, 2, 1.7}, Trusted::genetic, "trust the genetic algorithm"},
      {{true, true, 1.1, 2, 1.9}, Trusted::least_squares, "trust least squares"},
      {{true, true, 3.0, 1, 2}, Trusted::least_squares, "differ by 3.0 mg"},
  };
  for (const Row& row : rows) {
    const Trust trust = whom_to_trust(row.evidence);
    EXPECT_EQ(trust.trusted, row.trusted) << row.said;
    EXPECT_EQ(trust.apart_mg, row.evidence.apart_mg);
    EXPECT_THAT(trust.why, testing::HasSubstr(row.said));
  }
}

TEST(Trust, NamesAreThoseOfTheAnswer) {
  EXPECT_EQ(to_string(Trusted::both), "both");
  EXPECT_EQ(to_string(Trusted::least_squares), "least_squares");
  EXPECT_EQ(to_string(Trusted::genetic), "genetic");
  EXPECT_EQ(to_string(Trusted::neither), "neither");
}

}  // namespace
}  // namespace sixpoint::calib

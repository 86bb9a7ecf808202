#include "station/records/jig_due.h"

#include <gmock/gmock.h>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

// The table of the header, row by row.
TEST(JigDueRule, FollowsTheTable) {
  const UtcTime now = *parse_iso8601("2027-04-01");
  const UtcTime over = *parse_iso8601("2027-03-31");
  const UtcTime later = *parse_iso8601("2027-04-02");
  EXPECT_OK(check_jig_due({}, now));
  EXPECT_OK(check_jig_due({later, "", ""}, now));
  // The day itself, to its end.
  EXPECT_OK(check_jig_due({now, "", ""}, now));
  EXPECT_OK(check_jig_due({over, "", ""}, *parse_iso8601("2027-03-31T23:59:59")));
  EXPECT_OK(check_jig_due({*parse_iso8601("2027-03-31T08:00:00"), "", ""},
                          *parse_iso8601("2027-03-31T23:59:59")));
  const auto refused = check_jig_due({over, "", "Eve"}, now);
  EXPECT_FAILS(refused, ErrorCode::configuration);
  EXPECT_THAT(refused.error().what, testing::HasSubstr("2027-03-31"));
  for (const char* due : {"", "2027-03-31", "2027-04-02"}) {
    EXPECT_FAILS(parse_jig_due(due, "laboratory closed", ""), ErrorCode::usage);
    EXPECT_OK(parse_jig_due(due, "laboratory closed", "Eve"));
    EXPECT_OK(parse_jig_due(due, "", ""));
  }
  EXPECT_OK(check_jig_due({over, "laboratory closed", "Eve"}, now));
  EXPECT_EQ(jig_due_note({over, "laboratory closed", "Eve"}, now),
            "the jig was due for its own calibration on 2027-03-31; Eve signed: laboratory closed");
  EXPECT_EQ(jig_due_note({later, "laboratory closed", "Eve"}, now), "");
  EXPECT_EQ(jig_due_note({over, "", ""}, now), "") << "it started in time, and nobody signed";
}

}  // namespace
}  // namespace sixpoint::station

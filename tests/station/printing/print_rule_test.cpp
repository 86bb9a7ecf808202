#include "station/printing/print_rule.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "station/certificate/certificate_record.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

// The table of the header, row by row.
TEST(PrintRule, FollowsTheTable) {
  const db::RunRecord written = record_of(7, writing());
  ASSERT_EQ(written.verdict, "pass");
  for (const char* verdict : {"pass", "conditional_pass"}) {
    db::RunRecord run = written;
    run.verdict = verdict;
    EXPECT_EQ(why_no_label(run, true), "");
    EXPECT_THAT(why_no_label(run, false), HasSubstr("does not have this run yet"));

    auto document = nlohmann::ordered_json::parse(run.document);
    document["as_left"]["zero_lsb"][0] = document["as_left"]["zero_lsb"][0].get<int>() + 1;
    run.document = document.dump();
    EXPECT_THAT(why_no_label(run, true), HasSubstr("not what was written"));
    document.erase("as_left");
    run.document = document.dump();
    EXPECT_NE(why_no_label(run, true), "");
  }
  auto only_measured = writing();
  only_measured.run.write = false;
  EXPECT_THAT(why_no_label(record_of(7, only_measured), true), HasSubstr("nothing was written"));
  for (const char* verdict : {"fail", "conditional_fail", "stopped", "inconclusive"}) {
    db::RunRecord run = written;
    run.verdict = verdict;
    EXPECT_NE(why_no_label(run, true), "") << verdict;
  }
}

}  // namespace
}  // namespace sixpoint::station

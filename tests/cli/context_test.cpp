// What all commands have in common: exit codes, error documents, numbers in JSON.
#include "cli/context.h"

#include <functional>
#include <limits>
#include <map>
#include <set>

#include <CLI/Option.hpp>
#include <gmock/gmock.h>

#include "base/memory_env.h"

namespace sixpoint::cli {
namespace {

// Oracle: the order of the contract, 0 < 2 < 1 < 3 < 64 and above.
TEST(Context, TheWorseExitCodeIsKept) {
  const std::vector<int> order = {0, 2, 1, 3, 64, 65, 66, 69, 70, 73, 74, 77, 78};
  std::ostringstream stream;
  std::istringstream in;
  for (std::size_t first = 0; first < order.size(); ++first) {
    for (std::size_t second = 0; second < order.size(); ++second) {
      Context context{posix_env(), stream, stream, in};
      context.worsen(order[first]);
      context.worsen(order[second]);
      EXPECT_EQ(context.exit_code, order[std::max(first, second)]);
    }
  }
}

// Oracle: the table of Context::worsen_as_incomplete().
TEST(Context, APartIsNeverDone) {
  std::ostringstream stream;
  std::istringstream in;
  for (const auto& [before, after] :
       std::map<int, int>{{0, 2}, {1, 2}, {2, 2}, {3, 3}, {64, 64}, {65, 65}, {78, 78}}) {
    Context context{posix_env(), stream, stream, in};
    context.worsen(before);
    context.worsen_as_incomplete();
    EXPECT_EQ(context.exit_code, after);
  }
}

TEST(Context, AnErrorIsOneLineForPeopleAndADocumentWithJson) {
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{posix_env(), out, people, in};
  const Error error{ErrorCode::no_input, "it is not there", "a.gt3x", "name another file"};
  report_error(context, "scan", error, false);
  EXPECT_EQ(out.str(), "");
  EXPECT_EQ(people.str(), "sixpoint: a.gt3x: it is not there; name another file\n");
  EXPECT_EQ(context.exit_code, 66);
  report_error(context, "scan", error, true);
  EXPECT_EQ(Json::parse(out.str()), Json::parse(R"({"schema": "sixpoint/scan/1", "error": {
      "code": "no_input", "what": "it is not there", "where": "a.gt3x",
      "hint": "name another file"}})"));
}

TEST(Context, ProgressIsALineAMinuteInALog) {
  MemoryEnv memory;
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{memory.env, out, people, in};
  Progress progress(context, "repairing", 100);
  progress.at(1);
  memory.clock.sleep(std::chrono::seconds(30));
  progress.at(10);
  EXPECT_EQ(people.str(), "");
  memory.clock.sleep(std::chrono::seconds(30));
  progress.at(30);
  progress.at(31);
  EXPECT_EQ(people.str(), "repairing: 30 of 100 (30 %), 0.5 a second, 3 min left\n");
  memory.clock.sleep(std::chrono::minutes(1));
  progress.at(60);
  EXPECT_THAT(people.str(),
              testing::EndsWith("repairing: 60 of 100 (60 %), 0.5 a second, 2 min left\n"));
  EXPECT_EQ(out.str(), "");
}

TEST(Context, ProgressSaysBytesAndFailures) {
  MemoryEnv memory;
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{memory.env, out, people, in};
  {
    Progress log(context, "repairing", 100);
    memory.clock.sleep(std::chrono::minutes(1));
    log.at(30, 1'234'567'890, 2);
    EXPECT_EQ(people.str(),
              "repairing: 30 of 100 (30 %), 1.2 GB, 2 failed, 0.5 a second, 3 min left\n");
  }
  people.str("");
  context.people_at_terminal = true;
  Progress bar(context, "repairing", 100);
  memory.clock.sleep(std::chrono::minutes(1));
  bar.at(30, 45'000'000, 0);
  EXPECT_THAT(people.str(), testing::EndsWith(" 30 %  45 MB  0.5 a second  02:20 left"));
  bar.at(30, 45'000'000, 1);
  EXPECT_THAT(people.str(), testing::EndsWith(" 30 %  45 MB  1 failed  0.5 a second  02:20 left"))
      << "a failure is said at once";
}

TEST(Context, BytesInThreeDigits) {
  EXPECT_EQ(bytes_text(0), "0 bytes");
  EXPECT_EQ(bytes_text(999), "999 bytes");
  EXPECT_EQ(bytes_text(1000), "1.0 kB");
  EXPECT_EQ(bytes_text(12'345), "12 kB");
  EXPECT_EQ(bytes_text(999'600), "1.0 MB");
  EXPECT_EQ(bytes_text(4'000'000'000), "4.0 GB");
  EXPECT_EQ(bytes_text(123'000'000'000'000), "123 TB");
}

TEST(Context, JsonHasNoNumberThatItCannotWrite) {
  EXPECT_EQ(number(1.5), 1.5);
  EXPECT_TRUE(number(std::numeric_limits<double>::quiet_NaN()).is_null());
  EXPECT_TRUE(number(-std::numeric_limits<double>::infinity()).is_null());
  EXPECT_TRUE(text_or_null("").is_null());
  EXPECT_EQ(text_or_null("a"), "a");
  EXPECT_TRUE(value_or_null(std::optional<int>()).is_null());
  EXPECT_EQ(value_or_null(std::optional(7)), 7);
  EXPECT_EQ(value_or_null(std::optional(UtcTime{})), "1970-01-01T00:00:00Z");
}

}  // namespace
}  // namespace sixpoint::cli

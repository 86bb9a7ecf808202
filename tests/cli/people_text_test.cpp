#include "cli/people_text.h"

#include <cstdlib>
#include <ctime>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sixpoint::cli {
namespace {

// The time zone of the process, for one test.
class ZoneOf {
 public:
  explicit ZoneOf(const char* zone) {
    if (const char* before = std::getenv("TZ")) {
      before_ = before;
    }
    setenv("TZ", zone, 1);
    tzset();
  }
  ~ZoneOf() {
    before_.empty() ? unsetenv("TZ") : setenv("TZ", before_.c_str(), 1);
    tzset();
  }
  ZoneOf(const ZoneOf&) = delete;
  ZoneOf& operator=(const ZoneOf&) = delete;

 private:
  std::string before_;
};

// Oracle: the POSIX form of TZ states the offset itself ("AAA-1" is one hour east; a name has three letters).
TEST(LocalTime, HasTheOffsetAndNoFraction) {
  const UtcTime time = from_unix_seconds(1'395'619'200) + std::chrono::nanoseconds(193'496'967);
  const ZoneOf east("AAA-1");
  EXPECT_EQ(local_time(time), "2014-03-24 01:00:00 +01:00");
  const ZoneOf west("AAA3:30");
  EXPECT_EQ(local_time(time), "2014-03-23 20:30:00 -03:30");
  const ZoneOf utc("UTC0");
  EXPECT_EQ(local_time(time), "2014-03-24 00:00:00 +00:00");
  EXPECT_EQ(local_time(from_unix_seconds(-1)), "1969-12-31 23:59:59 +00:00");
}

TEST(Columns, AreAsWideAsTheirWidestText) {
  Columns list({"when", "unit", "why"});
  EXPECT_EQ(list.text(), "") << "names alone say nothing";
  list.row({"now", "MOS2A1", "\u0141ukasz said so"});
  list.row({"later on", "\u0141", ""});
  list.row({"then"});
  EXPECT_EQ(list.text(),
            "when      unit    why\n"
            "now       MOS2A1  \u0141ukasz said so\n"
            "later on  \u0141\n"
            "then\n");
}

TEST(ConstantsText, IsOneLineAndEmptyForAnythingElse) {
  const Json constants = {{"sensitivity_g_per_lsb", {0.004, 0.005, 0.0025}},
                          {"zero_lsb", {1.5, -2.125, 3}}};
  EXPECT_EQ(constants_text(constants),
            "sensitivity 250.000 200.000 400.000 LSB/g, zero 1.50 -2.12 3.00 LSB");
  Json other = constants;
  other["zero_lsb"] = {1, 2};
  EXPECT_EQ(constants_text(other), "");
  other = constants;
  other["sensitivity_g_per_lsb"][1] = 0;
  EXPECT_EQ(constants_text(other), "");
  EXPECT_EQ(constants_text(nullptr), "");
  EXPECT_EQ(constants_text("text"), "");
}

TEST(WithoutPassword, LeavesAllButThePasswords) {
  const std::vector<std::pair<std::string, std::string>> rows = {
      {"postgresql://ada:s3cret@host:5432/plant", "postgresql://ada@host:5432/plant"},
      {"postgres://ada:s3:cr@et@host/plant", "postgres://ada@host/plant"},
      {"--store=postgresql://ada:s3cret@/plant", "--store=postgresql://ada@/plant"},
      {"postgresql://host:5432/plant", "postgresql://host:5432/plant"},
      {"postgresql://ada@host/plant?options=-csearch_path%3Dlab&sslmode=verify-full",
       "postgresql://ada@host/plant?options=-csearch_path%3Dlab&sslmode=verify-full"},
      {"postgresql:///plant?password=s3cret&host=/run/pg&sslpassword=s3cret",
       "postgresql:///plant?host=/run/pg"},
      {"postgresql:///plant?host=h&password=s3cret&port=1", "postgresql:///plant?host=h&port=1"},
      {"postgresql:///plant?password=s3cret", "postgresql:///plant"},
      {"https://ada:word@host", "https://ada:word@host"},  // no store
      {"a:b@c.gt3x", "a:b@c.gt3x"},
      {"", ""},
  };
  for (const auto& [given, left] : rows) {
    EXPECT_EQ(without_password(given), left);
    EXPECT_THAT(bash_word(given), testing::Not(testing::HasSubstr("s3cret")));
  }
}

TEST(NextStep, IsOneLineThatAShellTakes) {
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{posix_env(), out, people, in};
  next_step(context, true, {"scan"});
  EXPECT_EQ(people.str(), "") << "with --json nothing";
  next_step(context, false, {"repair", "a b.gt3x", "it's.gt3x", "-o", "repaired"});
  EXPECT_EQ(people.str(), "next: sixpoint repair 'a b.gt3x' 'it'\\''s.gt3x' -o repaired\n");
  people.str("");
  next_step(context, false, {"scan", "it's\n\xff\\.gt3x"});
  EXPECT_EQ(people.str(), "next: sixpoint scan $'it\\'s\\x0a\\xff\\\\.gt3x'\n");
  EXPECT_EQ(out.str(), "");
  EXPECT_THAT(some_paths({"-a", "./b"}), testing::ElementsAre("./-a", "./b"));
  EXPECT_THAT(some_paths({"a", "b", "c"}), testing::ElementsAre("a", "b", "c"));
  EXPECT_THAT(some_paths({"a", "b", "c", "d"}), testing::ElementsAre("a", "b", "c", "..."));
}

}  // namespace
}  // namespace sixpoint::cli

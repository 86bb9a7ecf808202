// Oracle: the table in the header; 64 is EX_USAGE of sysexits.h.
#include "cli/program/option_values.h"

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "run_command.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::Answer;

TEST(OptionValues, FollowTheTable) {
  for (const char* type : {"TEXT", "FLOAT", "INT", "UINT"}) {
    EXPECT_NE(why_no_value(type, ""), "") << type;
    EXPECT_EQ(why_no_value(type, "7"), "") << type;
  }
  for (const char* value : {"nan", "-NaN", "inf", "-inf", "1e999"}) {
    EXPECT_NE(why_no_value("FLOAT", value), "") << value;
    EXPECT_EQ(why_no_value("TEXT", value), "") << value;
  }
  for (const char* value : {"-1", " -1", "18446744073709551616", "36893488147419103232"}) {
    EXPECT_NE(why_no_value("UINT", value), "") << value;
    EXPECT_EQ(why_no_value("TEXT", value), "") << value;
  }
  EXPECT_EQ(why_no_value("UINT", "18446744073709551615"), "");
  EXPECT_EQ(why_no_value("FLOAT", "-1.5"), "");
  EXPECT_EQ(why_no_value("INT", "-9223372036854775808"), "");
  EXPECT_NE(why_no_value("INT", "-9223372036854775809"), "");
}

void expect_usage(const std::vector<std::string>& arguments, const std::string& why) {
  MemoryEnv memory;
  const Answer answer = tests::run_command(memory.env, arguments);
  const std::string line = testing::PrintToString(arguments);
  EXPECT_EQ(answer.exit_code, 64) << line;
  EXPECT_EQ(answer.out, "") << line;
  EXPECT_THAT(answer.people, HasSubstr(why)) << line;
}

// Not with a number of 309 digits, which is the largest one that there is.
TEST(OptionValues, ANumberThatMustBeGreaterThanZeroSaysSo) {
  const std::vector<std::string> plan = {"archive", "plan", "a", "-o", "p", "--shard-bytes"};
  const std::vector<std::string> gage = {"gage-rr", "g.csv", "--tolerance"};
  const auto with = [](std::vector<std::string> line, const char* value) {
    line.emplace_back(value);
    return line;
  };
  expect_usage(with(plan, "0"), "--shard-bytes: 0 is not greater than 0; ");
  expect_usage(with(plan, "0kB"), "--shard-bytes: 0 is not greater than 0; ");
  expect_usage(with(gage, "0"), "--tolerance: 0 is not greater than 0; ");
  expect_usage(with(gage, "-1.5"), "--tolerance: -1.5 is not greater than 0; ");
  expect_usage(with(gage, "abc"), "--tolerance: ");
  MemoryEnv memory;
  for (const auto& line : {with(plan, "1"), with(gage, "1e-6")}) {
    EXPECT_EQ(tests::run_command(memory.env, line).exit_code, 66) << "the input is not there";
  }
}

TEST(OptionValues, AnEmptyValueIsNotTakenForAnOptionThatIsMissing) {
  for (const std::vector<std::string>& arguments : {
           std::vector<std::string>{"repair", "a.gt3x", "-o", "out", "--constants", ""},
           {"repair", "a.gt3x", "-o", ""},
           {"repair", "", "-o", "out"},
           {"audit", "verify", "--head", ""},
           {"jig", "--device", "virtual:seed=7", "--jig-due", ""},
           {"jig", "--device", "virtual:seed=7", "--limits", ""},
           {"jig", "--device", ""},
           {"export", "a.gt3x", "--csv", "a.csv", "--records", ""},
           {"certificate", "01234567", "-o", ""},
           {"solve", "a.gt3x", "--method", "ga", "--seed", ""},
           {"solve", "a.gt3x", "--gravity", ""},
           {"station", "--device", "virtual:seed=7", "--device", ""},
           {"units", "--store", ""},
           {"store", "export", "--store", "", "-o", "a.jsonl"},
       }) {
    expect_usage(arguments, "has no value");
  }
}

TEST(OptionValues, NotANumberIsInNoRange) {
  for (const std::vector<std::string>& arguments : {
           std::vector<std::string>{"jig", "--device", "virtual:seed=7", "--dwell", "nan"},
           {"capture", "--device", "virtual:seed=7", "--side-seconds", "nan"},
           {"capture", "--device", "virtual:seed=7", "--turn-seconds", "nan"},
           {"compare", "a.gt3x", "b.gt3x", "--max-lag", "nan"},
           {"devices", "--watch", "--for", "nan"},
           {"gage-rr", "a.csv", "--tolerance", "inf"},
       }) {
    expect_usage(arguments, "no finite number");
  }
}

TEST(OptionValues, CountsAndSeedsDoNotWrapRound) {
  for (const std::string number : {"-1", "36893488147419103232"}) {
    const std::string why = number == "-1" ? "below 0" : "too large";
    expect_usage({"solve", "a.gt3x", "--method", "ga", "--seed", number}, why);
    expect_usage({"virtual", "--seed", number}, why);
    expect_usage({"gap", "challenge", "--seed", number}, why);
    expect_usage({"gap", "score", "a.jsonl", "--labels", "l.jsonl", "--seed", number}, why);
    expect_usage({"gap", "diagnose", "bundle", "--seed", number}, why);
    expect_usage({"scan", "a.gt3x", "--jobs", number}, why);
  }
}

TEST(OptionValues, AFlagWithAValueOfItsOwnNeedsNone) {
  MemoryEnv memory;
  EXPECT_EQ(
      tests::run_command(memory.env, {"export", "a.gt3x", "--csv", "a.csv", "--time"}).exit_code,
      66);
}

}  // namespace
}  // namespace sixpoint::cli

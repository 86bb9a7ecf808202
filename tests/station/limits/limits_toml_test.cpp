// Limits as TOML: read, refused with the line, printed.
#include <algorithm>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "expect_result.h"
#include "run_command.h"
#include "station/limits/limits.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

TEST(Limits, WhatIsPrintedIsRead) {
  Limits limits = default_limits();
  limits.decision.guard_factor = 0.5;
  limits.retest.most_failures = 7;
  limits.check_unit.locking_rules = {1};
  limits.limits[1].low = -0.1;
  limits.limits[1].guard_band = 1e-3;
  const auto read = parse_limits(to_toml(limits), "again.toml");
  ASSERT_OK(read);
  auto before = to_json(limits);
  auto after = to_json(*read);
  before.erase("source");
  before.erase("sha256");
  after.erase("source");
  after.erase("sha256");
  EXPECT_EQ(before, after);
  // The built-in limits' hash is that of what is printed, so that both name the same thing.
  EXPECT_EQ(parse_limits(to_toml(default_limits()), "x")->sha256, default_limits().sha256);
}

TEST(Limits, ANegativeZeroIsZero) {
  const auto limits = parse_limits("[zero_offset_mg]\nlow = -0.0\nhigh = 5\n", "l.toml");
  ASSERT_OK(limits);
  const std::string printed = to_toml(*limits);
  EXPECT_EQ(printed.find("-0\n"), std::string::npos) << printed;
  EXPECT_EQ(to_toml(*parse_limits(printed, "again.toml")), printed);
}

TEST(Limits, WhatIsLeftOutKeepsItsValue) {
  const auto limits = parse_limits("[zero_offset_mg]\nhigh = 100\n", "l.toml");
  ASSERT_OK(limits);
  EXPECT_EQ(limits->of("zero_offset_mg").high, 100);
  EXPECT_EQ(limits->of("zero_offset_mg").low, default_limits().of("zero_offset_mg").low);
  EXPECT_EQ(limits->of("noise_mg").high, default_limits().of("noise_mg").high);
  EXPECT_NE(limits->sha256, default_limits().sha256);
}

struct BadFile {
  const char* name;
  const char* text;
  const char* where;
  const char* what;
};
class BadLimits : public testing::TestWithParam<BadFile> {};

TEST_P(BadLimits, AreRefusedWithTheLine) {
  const auto limits = parse_limits(GetParam().text, "l.toml");
  ASSERT_FALSE(limits);
  EXPECT_EQ(limits.error().code, ErrorCode::configuration);
  EXPECT_EQ(limits.error().where, GetParam().where);
  EXPECT_THAT(limits.error().what, HasSubstr(GetParam().what));
  EXPECT_FALSE(limits.error().hint.empty());
}

// What a person sees: one line, which names file and line, and exit code 78, from every command
// that reads such a file. A jig run ends before the unit is touched.
TEST_P(BadLimits, EndEveryCommandWithOneLine) {
  MemoryEnv env;
  const std::string text = GetParam().text;
  auto file = env.files.create("l.toml");
  ASSERT_OK(file);
  ASSERT_OK((*file)->write_at(0, as_bytes(text)));
  ASSERT_OK((*file)->close());
  const std::vector<std::vector<std::string>> commands = {
      {"limits", "check", "l.toml"},
      {"limits", "print", "l.toml"},
      {"jig", "--device", "virtual:seed=7,jig=auto", "--store", "s.db", "--limits", "l.toml"},
      {"station", "--device", "virtual:seed=7", "--store", "s.db", "--limits", "l.toml"}};
  for (const auto& command : commands) {
    const auto answer = tests::run_command(env.env, command);
    EXPECT_EQ(answer.exit_code, 78) << command[0] << ' ' << answer.people;
    EXPECT_TRUE(answer.out.empty()) << answer.out;
    EXPECT_THAT(answer.people, HasSubstr(GetParam().where));
    EXPECT_EQ(std::count(answer.people.begin(), answer.people.end(), '\n'), 1) << answer.people;
    EXPECT_LT(answer.people.size(), 300U) << answer.people;
    EXPECT_FALSE(env.files.open("s.db").has_value()) << "nothing was begun";
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, BadLimits,
    testing::Values(
        BadFile{"LowAboveHigh", "[zero_offset_mg]\nhigh = 5\nlow = 6\n", "l.toml:3",
                "not below high"},
        BadFile{"LowIsHigh", "[zero_offset_mg]\nhigh = 5\nlow = 5\n", "l.toml:3", "not below high"},
        BadFile{"LowAboveTheBuiltInHigh", "\n[zero_offset_mg]\nlow = 900\n", "l.toml:3",
                "not below high 700"},
        BadFile{"GuardBandBigger", "[zero_offset_mg]\nlow=-1\nhigh=1\nguard_band=1\n", "l.toml:4",
                "leaves nothing"},
        BadFile{"GuardBandBiggerOneSided", "[noise_mg]\nguard_band = 10\n", "l.toml:2",
                "leaves nothing"},
        BadFile{"UnknownTable", "[noise_mg]\nhigh=3\n[nois_mg]\nhigh = 3\n", "l.toml:3",
                "'nois_mg' is nothing"},
        BadFile{"UnknownEmptyTable", "[nois_mg]\n", "l.toml:1", "'nois_mg' is nothing"},
        BadFile{"UnknownKey", "[noise_mg]\nhigh = 3\nhihg = 3\n", "l.toml:3", "unknown key 'hihg'"},
        BadFile{"NoLow", "[noise_mg]\nlow = 3\n", "l.toml:2", "no 'low' limit"},
        BadFile{"NotATable", "noise_mg = 3\n", "l.toml:1", "no table"},
        BadFile{"Text", "[noise_mg]\nhigh = \"3\"\n", "l.toml:2", "no number"},
        BadFile{"Bool", "[noise_mg]\nhigh = true\n", "l.toml:2", "no number"},
        BadFile{"Negative", "[noise_mg]\nhigh = -3\n", "l.toml:2", "outside 0 to"},
        BadFile{"NegativeGuardBand", "[zero_offset_mg]\nguard_band = -1\n", "l.toml:2", "outside"},
        BadFile{"NaN", "[noise_mg]\nhigh = nan\n", "l.toml:2", "outside"},
        BadFile{"Infinite", "[noise_mg]\nhigh = inf\n", "l.toml:2", "outside"},
        BadFile{"HalfARun", "[retest]\nmost_failures = 1.5\n", "l.toml:2", "no whole number"},
        BadFile{"NoRun", "[retest]\nmost_failures = 0\n", "l.toml:2", "outside"},
        BadFile{"ARuleThatIsNone", "[check_unit]\nlocking_rules = [1, 9]\n", "l.toml:2", "outside"},
        BadFile{"RulesNoList", "[check_unit]\nlocking_rules = 1\n", "l.toml:2", "no list"},
        BadFile{"ARuleInWords", "[check_unit]\nlocking_rules = [\"1\"]\n", "l.toml:2",
                "no whole number"},
        BadFile{"UnknownDecision", "[decision]\nfactor = 1\n", "l.toml:2", "unknown key"},
        BadFile{"UnknownRetest", "[retest]\nfailures = 1\n", "l.toml:2", "unknown key"},
        BadFile{"UnknownOfACheckUnit", "[check_unit]\nruns = 5\n", "l.toml:2", "unknown key"},
        BadFile{"GuardFactorInWords", "[decision]\nguard_factor = \"none\"\n", "l.toml:2",
                "no number"},
        BadFile{"NoPassAfterAFailure", "[retest]\npasses_after_failure = 0\n", "l.toml:2",
                "outside"},
        BadFile{"SigmaBelowNothing", "[check_unit]\nleast_sigma_zero_mg = -1\n", "l.toml:2",
                "outside"},
        BadFile{"SigmaInWords", "[check_unit]\nleast_sigma_sensitivity_percent = \"1 %\"\n",
                "l.toml:2", "no number"},
        BadFile{"LowInWords", "[zero_offset_mg]\nlow = \"-300\"\n", "l.toml:2", "no number"},
        BadFile{"GuardBandInWords", "[noise_mg]\nguard_band = \"1\"\n", "l.toml:2", "no number"},
        BadFile{"Twice", "[noise_mg]\nhigh = 3\n[noise_mg]\nhigh = 3\n", "l.toml:3", "no TOML"},
        BadFile{"TwiceAKey", "[noise_mg]\nhigh = 3\nhigh = 4\n", "l.toml:3", "no TOML"},
        BadFile{"MinusInfinity", "[zero_offset_mg]\nlow = -inf\n", "l.toml:2", "outside"},
        BadFile{"Huge", "[noise_mg]\nhigh = 1e308\n", "l.toml:2", "outside"},
        BadFile{"HugerThanANumber", "[noise_mg]\nhigh = 1e999\n", "l.toml:2", ""},
        BadFile{"HugeWholeNumber", "[retest]\nmost_failures = 9223372036854775807\n", "l.toml:2",
                "outside"},
        BadFile{"AWordWithItsUnit", "[noise_mg]\nhigh = \"10 mg\"\n", "l.toml:2", "no number"},
        BadFile{"ANumberWithItsUnit", "[noise_mg]\nhigh = 10 mg\n", "l.toml:2", "no TOML"},
        BadFile{"ANameWithoutItsUnit", "[noise]\nhigh = 10\n", "l.toml:1", "'noise' is nothing"},
        BadFile{"ADate", "[noise_mg]\nhigh = 2020-01-01\n", "l.toml:2", "no number"},
        BadFile{"AListOfLimits", "[[noise_mg]]\nhigh = 3\n", "l.toml:1", "no table"},
        BadFile{"NoCoverage", "[decision]\ncoverage_factor = 0\n", "l.toml:2", "outside"},
        BadFile{"ShortBaseline", "[check_unit]\nbaseline_runs = 1\n", "l.toml:2", "outside"},
        BadFile{"AKeyThatIsNone", "[*b", "l.toml:1", "no TOML"},
        BadFile{"ALetterBeyondAscii", "[noise_mg]\n\317\273[b", "l.toml:2", "no TOML"},
        BadFile{"ASpaceBeyondAscii", "[noise_mg]\nhigh\302\240= 3\n", "l.toml:2", "no TOML"},
        BadFile{"NoToml", "\n\n[noise_mg\n", "l.toml:3", "no TOML"},
        BadFile{"Binary", "\x01\x02\x03", "l.toml:1", "no TOML"}),
    [](const auto& one) { return one.param.name; });

// As an editor of Windows and a German technician leave it.
TEST(Limits, AByteOrderMarkAndCommentsInAnyLanguageAreRead) {
  const auto limits = parse_limits(
      "\xEF\xBB\xBF[noise_mg]\r\nhigh = 3  # gr\xC3\xB6\xC3\x9F"
      "er nicht\r\n",
      "l.toml");
  ASSERT_OK(limits);
  EXPECT_EQ(limits->of("noise_mg").high, 3);
}

TEST(Limits, AFileIsNamedWithoutItsFolderAndAHugeOneIsRefused) {
  MemoryEnv env;
  const auto put = [&](const std::string& path, const std::string& text) {
    auto file = env.files.create(path);
    ASSERT_OK(file);
    ASSERT_OK((*file)->write_at(0, as_bytes(text)));
    ASSERT_OK((*file)->close());
  };
  put("l.toml", "[noise_mg]\nhigh = 3\n");
  const auto limits = read_limits(env.files, "l.toml");
  ASSERT_OK(limits);
  EXPECT_EQ(limits->source, "l.toml");
  put("huge.toml", std::string(2U << 20U, '#'));
  EXPECT_FAILS(read_limits(env.files, "huge.toml"), ErrorCode::configuration);
  EXPECT_FAILS(read_limits(env.files, "none.toml"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::station

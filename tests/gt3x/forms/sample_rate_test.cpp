#include "gt3x/forms/sample_rate.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

TEST(UsableSampleRate, IsWhatInfoNamesOrSaysWhatStandsThere) {
  const auto rate = [](const std::string& line, double most_hz) {
    return usable_sample_rate_hz(Info::parse("Serial Number: MOS2A45130450\n" + line).value(),
                                 "a.gt3x", most_hz);
  };
  for (const auto& [line, rate_hz] :
       std::vector<std::pair<std::string, double>>{{"Sample Rate: 30", 30},
                                                   {"Sample Rate: 1", 1},
                                                   {"Sample Rate: 37,5", 37.5},
                                                   {"Sample Rate: 100", 100}}) {
    const auto read = rate(line, 100);
    ASSERT_OK(read);
    EXPECT_EQ(*read, rate_hz) << line;
  }
  for (const auto& [line, what] : std::vector<std::pair<std::string, std::string>>{
           {"", "names no sample rate"},
           {"Sample Rate: 0", "of '0'"},
           {"Sample Rate: 0.5", "of '0.5', which is not from 1 to 100 Hz"},
           {"Sample Rate: -30", "of '-30'"},
           {"Sample Rate: 101", "of '101'"},
           {"Sample Rate: fast", "of 'fast'"},
           {"Sample Rate: nan", "of 'nan'"},
           {"Sample Rate: \x1b[2J", "of '\\x1b[2J'"}}) {
    const auto refused = rate(line, 100);
    EXPECT_FAILS(refused, ErrorCode::bad_data);
    EXPECT_NE(refused.error().what.find(what), std::string::npos) << refused.error().what;
    EXPECT_EQ(refused.error().where, "a.gt3x");
  }
}

}  // namespace
}  // namespace sixpoint::gt3x

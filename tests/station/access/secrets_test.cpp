#include "station/access/secrets.h"

#include <set>

#include <gmock/gmock.h>

namespace sixpoint::station {
namespace {

TEST(Secrets, EachIsAnother) {
  std::set<std::string> texts;
  for (int i = 0; i < 100; ++i) {
    texts.insert(random_hex(16));
    texts.insert(random_code());
  }
  EXPECT_EQ(texts.size(), 200U);
  for (const std::string& text : texts) {
    EXPECT_THAT(text, testing::AnyOf(testing::MatchesRegex("[0-9a-f]+"),
                                     testing::MatchesRegex("[2-9A-Z]+-[2-9A-Z]+-[2-9A-Z]+")));
  }
  EXPECT_EQ(random_hex(16).size(), 32U);
  EXPECT_EQ(random_code().size(), 14U);
}

// Oracle: RFC 4231, test cases 2 and 6.
TEST(Secrets, KeyedHashesAreThoseOfTheStandard) {
  EXPECT_EQ(keyed_hash("Jefe", "what do ya want for nothing?"),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  EXPECT_EQ(keyed_hash(std::string(131, '\xaa'),
                       "Test Using Larger Than Block-Size Key - Hash Key First"),
            "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
}

TEST(Secrets, OnlyEqualTextsAreTheSame) {
  EXPECT_TRUE(same_secret("abc", "abc"));
  EXPECT_TRUE(same_secret("", ""));
  for (const char* other : {"", "ab", "abd", "abcd", "ABC"}) {
    EXPECT_FALSE(same_secret("abc", other)) << other;
  }
}

}  // namespace
}  // namespace sixpoint::station

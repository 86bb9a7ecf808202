#include "base/text/csv_field.h"

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

// Oracle: RFC 4180, section 2.
TEST(CsvField, IsQuotedWhereTheFormatNeedsIt) {
  EXPECT_EQ(csv_field(""), "");
  EXPECT_EQ(csv_field("a b;c"), "a b;c");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("say \"g\""), "\"say \"\"g\"\"\"");
  EXPECT_EQ(csv_field("a\nb"), "\"a\nb\"");
  EXPECT_EQ(csv_field("a\r"), "\"a\r\"");
}

}  // namespace
}  // namespace sixpoint

#include "base/text/csv_columns.h"

#include <array>

#include <gtest/gtest.h>

#include "base/text/csv_field.h"
#include "expect_result.h"

namespace sixpoint {
namespace {

constexpr std::array<std::string_view, 2> kNames = {"serial", "lot"};

// RFC 4180 leaves the order of the columns to the header.
TEST(CsvColumns, AnyOrderAndFurtherColumns) {
  const auto rows = csv_columns("lot,note,\"serial\"\r\nA,x,1\r\n\r\n\"B\",,2\n", kNames, "f");
  ASSERT_OK(rows);
  ASSERT_EQ(rows->size(), 2U);
  EXPECT_EQ((*rows)[0].fields, (std::vector<std::string>{"1", "A"}));
  EXPECT_EQ((*rows)[1].fields, (std::vector<std::string>{"2", "B"}));
  EXPECT_EQ((*rows)[1].line, 4U);
}

TEST(CsvColumns, AByteOrderMarkIsNoPartOfTheFirstName) {
  const auto rows = csv_columns("\xEF\xBB\xBFserial,lot\n1,A\n", kNames, "f");
  ASSERT_OK(rows);
  EXPECT_EQ((*rows)[0].fields, (std::vector<std::string>{"1", "A"}));
}

// Oracle: RFC 4180, 2.5 to 2.7; what csv_field() writes is read back.
TEST(CsvColumns, AFieldInQuotesHoldsCommasLineEndsAndQuotes) {
  const auto rows = csv_columns(
      "serial,\"lot\"\r\n\"a, b\",\"say \"\"x\"\"\"\r\n\"two\r\nlines\",\"A \" \r\n5\" disk,\"\"\n",
      kNames, "f");
  ASSERT_OK(rows);
  ASSERT_EQ(rows->size(), 3U);
  EXPECT_EQ((*rows)[0].fields, (std::vector<std::string>{"a, b", "say \"x\""}));
  EXPECT_EQ((*rows)[1].fields, (std::vector<std::string>{"two\r\nlines", "A "}));
  EXPECT_EQ((*rows)[2].fields, (std::vector<std::string>{"5\" disk", ""}));
  EXPECT_EQ((*rows)[1].line, 3U);
  EXPECT_EQ((*rows)[2].line, 5U);
  for (const char* text : {"", "a", "a,b", "\"", "\"\"", " a ", "\r\n", "a\n\"b\","}) {
    const auto back =
        csv_columns("serial,lot\n" + csv_field(text) + "," + csv_field("x"), kNames, "f");
    ASSERT_OK(back);
    EXPECT_EQ((*back)[0].fields[0], text);
  }
}

TEST(CsvColumns, WhatIsNoTableIsRefusedWithItsLine) {
  for (const char* bad : {"", "serial,lot\n", "serial\n1\n", "\nserial,lot\n1,A\n", "\x80\n"}) {
    EXPECT_FAILS(csv_columns(bad, kNames, "f"), ErrorCode::bad_data);
  }
  EXPECT_EQ(csv_columns("serial,lot\n1,A\n2,\"B\n", kNames, "f.csv").error().where, "f.csv:3");
  EXPECT_EQ(csv_columns("serial,lot\n1,A\n2\n", kNames, "f.csv").error().where, "f.csv:3");
}

}  // namespace
}  // namespace sixpoint

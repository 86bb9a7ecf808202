#include "station/certificate/qr_code.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

// Oracle: ISO/IEC 18004. Version 1 has 21 modules a side, version 2 has 25; a finder pattern of 7 x
// 7 modules stands in three corners; error correction M holds 14 bytes in version 1, 2331 in
// version 40.
TEST(QrCode, HasTheSizeAndTheFinderPatternsOfTheStandard) {
  const auto code = qr_code("abcdefghijklmn");
  ASSERT_OK(code);
  EXPECT_EQ(code->size, 21U);
  EXPECT_EQ(qr_code("abcdefghijklmno")->size, 25U);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_TRUE(code->at(0, i) && code->at(i, 0) && code->at(6, i) && code->at(i, 6)) << i;
    EXPECT_TRUE(code->at(0, 14 + i) && code->at(14 + i, 0)) << i;
  }
  EXPECT_FALSE(code->at(1, 1) || code->at(7, 7)) << "the light ring and the separator";
  EXPECT_TRUE(code->at(3, 3)) << "the centre";
}

TEST(QrCode, TextThatDoesNotFitIsRefused) {
  EXPECT_EQ(qr_code(std::string(2331, '\x80'))->size, 177U);
  EXPECT_FAILS(qr_code(std::string(2332, '\x80')), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::station

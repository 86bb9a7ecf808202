#include "base/crc_ccitt.h"

#include <gtest/gtest.h>

#include "base/bytes.h"

namespace sixpoint {
namespace {

// Oracle: the check value of CRC-16/CCITT-FALSE in the catalogue of CRC algorithms.
TEST(CrcCcitt, HasItsPublishedCheckValue) {
  EXPECT_EQ(crc_ccitt(as_bytes("123456789")), 0x29B1);
  EXPECT_EQ(crc_ccitt({}), 0xFFFF);
}

}  // namespace
}  // namespace sixpoint

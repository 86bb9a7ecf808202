#include "db/chain.h"

#include <gtest/gtest.h>

namespace sixpoint::db {
namespace {

// The bytes of docs/store.md, written out by hand.
void put_number(Bytes& out, std::uint64_t value) {
  for (int shift = 56; shift >= 0; shift -= 8) {
    out.push_back(static_cast<std::uint8_t>(value >> shift));
  }
}
void put_integer(Bytes& out, std::uint64_t value) {
  out.push_back(1);
  put_number(out, value);
}
void put_text(Bytes& out, std::string_view text) {
  out.push_back(2);
  put_number(out, text.size());
  out.insert(out.end(), text.begin(), text.end());
}

TEST(Chain, HashesTheDocumentedBytes) {
  Bytes expected(32, 7);
  put_text(expected, "units");
  put_integer(expected, 3);
  put_text(expected, "MOS2A1");
  put_text(expected, "");
  put_integer(expected, 1'000'000'000);
  const Row columns = {std::string("MOS2A1"), std::string(), std::int64_t{1'000'000'000}};
  EXPECT_EQ(ChainHasher().hash(Bytes(32, 7), table("units"), 3, columns), sha256(expected));
}

TEST(Chain, NullColumnsOfLaterVersionsDoNotCount) {
  Bytes expected(32, 0);
  put_text(expected, "repairs");
  put_integer(expected, 1);
  for (int i = 0; i < 9; ++i) {
    i == 2 ? put_integer(expected, 5) : i == 7 ? expected.push_back(0) : put_text(expected, "x");
  }
  Row columns(9, std::string("x"));
  columns[2] = std::int64_t{5};
  columns[7] = Value();    // constants_id, there from the beginning: counts
  columns.emplace_back();  // software, added by version 2: does not
  EXPECT_EQ(ChainHasher().hash(Bytes(32, 0), table("repairs"), 1, columns), sha256(expected));
  columns.back() = std::string("s");
  put_text(expected, "s");
  EXPECT_EQ(ChainHasher().hash(Bytes(32, 0), table("repairs"), 1, columns), sha256(expected));
}

TEST(Chain, AnIdIsHalfTheHashWithoutPlace) {
  Bytes expected;
  put_text(expected, "captures");
  put_integer(expected, 0);
  put_text(expected, "run");
  put_text(expected, "raw");
  put_text(expected, "00ff");
  const Row columns = {std::string("run"), std::string("raw"), std::string("00ff")};
  EXPECT_EQ(ChainHasher().identifier(table("captures"), columns),
            to_hex(sha256(expected)).substr(0, 32));
}

}  // namespace
}  // namespace sixpoint::db

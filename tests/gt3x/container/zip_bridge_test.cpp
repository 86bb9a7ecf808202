#include "gt3x/container/zip_bridge.h"

#include <array>

#include <gtest/gtest.h>

namespace sixpoint::gt3x {
namespace {

class Broken final : public ByteSource {
 public:
  Result<std::size_t> read(std::span<std::uint8_t>) override {
    return fail(ErrorCode::io, "the disk is gone");
  }
};

TEST(ZipBridge, LibzipReadsTheSource) {
  std::optional<Error> failure;
  zip_source_t* source =
      make_pulling_source(std::make_unique<MemorySource>(Bytes{1, 2, 3}), &failure);
  ASSERT_NE(source, nullptr);
  ASSERT_EQ(zip_source_open(source), 0);
  std::array<std::uint8_t, 8> bytes{};
  EXPECT_EQ(zip_source_read(source, bytes.data(), bytes.size()), 3);
  EXPECT_EQ(bytes[2], 3);
  EXPECT_EQ(zip_source_read(source, bytes.data(), bytes.size()), 0);
  EXPECT_EQ(zip_source_close(source), 0);
  zip_source_free(source);
  EXPECT_FALSE(failure);
}

TEST(ZipBridge, TheSourcesOwnErrorIsLeftForTheCaller) {
  std::optional<Error> failure;
  zip_source_t* source = make_pulling_source(std::make_unique<Broken>(), &failure);
  ASSERT_EQ(zip_source_open(source), 0);
  std::array<std::uint8_t, 8> bytes{};
  EXPECT_EQ(zip_source_read(source, bytes.data(), bytes.size()), -1);
  zip_source_close(source);
  zip_source_free(source);
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->what, "the disk is gone");
}

}  // namespace
}  // namespace sixpoint::gt3x

#include "gt3x/container/gzip_writer.h"

#include <gtest/gtest.h>

#include "base/bytes.h"
#include "expect_result.h"
#include "gt3x/container/zlib_inflated.h"

namespace sixpoint::gt3x {
namespace {

Bytes gzipped(std::string_view text, std::size_t step, unsigned jobs) {
  Bytes file;
  GzipWriter gzip(
      [&](std::span<const std::uint8_t> bytes) {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return Status{};
      },
      jobs);
  for (std::size_t at = 0; at < text.size(); at += step) {
    EXPECT_OK(gzip.append(text.substr(at, step)));
  }
  EXPECT_OK(gzip.finish());
  return file;
}

// Oracle: zlib reads the file, header, CRC and size included.
std::string ungzipped(Bytes file, std::size_t size) {
  const Bytes text = inflated_by_zlib(std::move(file), size, kGzipFile);
  return {text.begin(), text.end()};
}

TEST(GzipWriter, ZlibReadsItAndTheBytesDependOnTheTextAlone) {
  std::string text;
  while (text.size() < 2 * kPackedPieceSize + 100) {
    text += std::to_string(text.size() * 7919 % 1000) + ",0.02\r\n";
  }
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{5}, kPackedPieceSize, kPackedPieceSize + 1, text.size()}) {
    const std::string_view part = std::string_view(text).substr(0, size);
    const Bytes one = gzipped(part, 1U << 16, 1);
    EXPECT_TRUE(ungzipped(one, size) == part) << size;
    EXPECT_TRUE(gzipped(part, 99'999, 3) == one) << size;
  }
}

}  // namespace
}  // namespace sixpoint::gt3x

#include "gt3x/container/gzip_writer.h"

#include <algorithm>
#include <array>

#include <isa-l/crc.h>

#include "base/bytes.h"

namespace sixpoint::gt3x {

GzipWriter::GzipWriter(PackLine::Sink sink, unsigned jobs)
    : sink_(std::move(sink)), line_(jobs, sink_) {}

Status GzipWriter::begin() {
  begun_ = true;
  // Deflate, no flags, no time, no level, a system that is not said.
  constexpr std::array<std::uint8_t, 10> kHeader = {0x1F, 0x8B, 8, 0, 0, 0, 0, 0, 0, 255};
  return sink_(kHeader);
}

Status GzipWriter::append(std::string_view text) {
  if (!begun_) {
    SIXPOINT_CHECK(begin());
  }
  const auto bytes = as_bytes(text);
  crc32_ = crc32_gzip_refl(crc32_, bytes.data(), bytes.size());
  size_ += bytes.size();
  for (auto left = bytes; !left.empty();) {
    if (piece_.size() == kPackedPieceSize) {
      SIXPOINT_CHECK(line_.put(piece_, PiecePacker::Place::inner));
      piece_.clear();
    }
    const auto part = left.first(std::min(left.size(), kPackedPieceSize - piece_.size()));
    piece_.insert(piece_.end(), part.begin(), part.end());
    left = left.subspan(part.size());
  }
  return {};
}

Status GzipWriter::finish() {
  if (!begun_) {
    SIXPOINT_CHECK(begin());
  }
  SIXPOINT_CHECK(line_.put(piece_, PiecePacker::Place::last));
  SIXPOINT_CHECK(line_.finish());
  std::array<std::uint8_t, 8> end{};
  for (std::size_t i = 0; i < 4; ++i) {
    end[i] = static_cast<std::uint8_t>(crc32_ >> (8 * i));
    end[4 + i] = static_cast<std::uint8_t>(size_ >> (8 * i));
  }
  return sink_(end);
}

}  // namespace sixpoint::gt3x

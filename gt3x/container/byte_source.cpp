#include "gt3x/container/byte_source.h"

#include <algorithm>

#include <fmt/format.h>

namespace sixpoint::gt3x {

Result<std::size_t> MemorySource::read(std::span<std::uint8_t> out) {
  const std::size_t count = std::min(out.size(), bytes_.size() - at_);
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
  at_ += count;
  return count;
}

Result<Bytes> read_all(ByteSource& source, std::uint64_t limit) {
  constexpr std::size_t kPiece = std::size_t{64} * 1024;
  Bytes bytes;
  for (;;) {
    const std::size_t start = bytes.size();
    bytes.resize(start + kPiece);
    SIXPOINT_ASSIGN(const std::size_t count, source.read(std::span(bytes).subspan(start)));
    bytes.resize(start + count);
    if (count == 0) {
      return bytes;
    }
    if (bytes.size() > limit) {
      return fail(ErrorCode::bad_data, fmt::format("there are more than {} bytes", limit), {},
                  "check that this is the right file");
    }
  }
}

}  // namespace sixpoint::gt3x

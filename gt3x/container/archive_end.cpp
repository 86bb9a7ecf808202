#include "gt3x/container/archive_end.h"

#include <algorithm>
#include <optional>

#include "gt3x/container/file_bytes.h"
#include "gt3x/container/zip_format.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kEndSize = 22;
constexpr std::size_t kLocatorSize = 20;
constexpr std::size_t kSearchedAtOnce = std::size_t{64} * 1024;

// Where the archive ends if the record at `at` is a true one.
Result<std::optional<std::uint64_t>> end_by_record(const ReadableFile& file, std::uint64_t at) {
  SIXPOINT_ASSIGN(const Bytes record, bytes_at(file, at, kEndSize));
  if (record.size() < kEndSize) {
    return std::nullopt;
  }
  const std::uint64_t list_size = number_at(record, 12, 4);
  const std::uint64_t list_offset = number_at(record, 16, 4);
  const std::uint64_t end = std::min(at + kEndSize + number_at(record, 20, 2), file.size());
  if (list_offset + list_size == at) {
    return end;
  }
  if (at < kLocatorSize) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const Bytes locator, bytes_at(file, at - kLocatorSize, kLocatorSize));
  if (number_at(locator, 0, 4) != zip::kEnd64Locator) {
    return std::nullopt;
  }
  const std::uint64_t at64 = number_at(locator, 8, 8);
  SIXPOINT_ASSIGN(const Bytes signature, bytes_at(file, at64, 4));
  const bool holds =
      at64 < at && signature.size() == 4 && number_at(signature, 0, 4) == zip::kEnd64;
  return holds ? std::optional(end) : std::nullopt;
}

}  // namespace

Result<std::uint64_t> archive_end(const ReadableFile& file) {
  const std::uint64_t size = file.size();
  // Pieces overlap by three bytes, so that a signature across their border is seen.
  for (std::uint64_t begin = size; begin > 0;) {
    const std::uint64_t piece_end = std::min(begin + 3, size);
    begin -= std::min<std::uint64_t>(begin, kSearchedAtOnce);
    SIXPOINT_ASSIGN(const Bytes piece, bytes_at(file, begin, piece_end - begin));
    for (std::size_t at = piece.size() < 4 ? 0 : piece.size() - 3; at > 0;) {
      --at;
      if (piece[at] != 'P' || number_at(piece, at, 4) != zip::kEnd) {
        continue;
      }
      SIXPOINT_ASSIGN(const auto end, end_by_record(file, begin + at));
      if (end) {
        return *end;
      }
    }
  }
  return size;
}

}  // namespace sixpoint::gt3x

// Reads log.bin as a stream and finds its way again behind damage.
//
//   LogReader log(std::move(source));
//   for (;;) {
//     SIXPOINT_ASSIGN(const auto item, log.next());
//     if (!item) break;  // the end, and the entry's CRC held
//     if (item->kind == LogItem::Kind::record && item->record.checksum_ok) ++good_records;
//   }
//
// Every byte of log.bin belongs to exactly one item: the `raw` of all items, one behind the other,
// are log.bin. Memory is bounded (a few MiB) whatever the input says.
//
// How damage is distinguished from data:
//  - Zero bytes between records are legal ("stray").
//  - A record whose checksum fails but behind which records go on is a record with
//    checksum_ok = false: count it, carry its bytes on, do not use its payload.
//  - Anything else that is no record starts a damaged stretch. It ends at the next place where a
//    record begins whose checksum holds, behind which stands a separator, a zero byte or the end,
//    and whose time lies near that of the last good record or of the record behind it. So at most
//    the damaged record is lost, also where its size field lies.
//
// One object belongs to one thread.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "gt3x/container/byte_source.h"
#include "gt3x/log/record.h"

namespace sixpoint::gt3x {

struct LogItem {
  enum class Kind {
    record,   // `record` is filled
    stray,    // zero bytes between records
    damaged,  // bytes that belong to no record; one stretch may come in several items
  };
  Kind kind = Kind::record;
  Record record;
  std::span<const std::uint8_t> raw;  // stays until the next call of next()
  std::uint64_t offset = 0;           // in log.bin
};

// What was lost in one stretch of damage.
struct Loss {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::optional<std::uint32_t> time_before;  // Unix time of the last good record before it
  std::optional<std::uint32_t> time_after;   // and of the first one behind it
};

struct ChecksumFailure {
  std::uint64_t offset = 0;
  std::uint8_t type = 0;
  std::uint32_t unix_time = 0;  // as the record says, which may itself be what is wrong
};

struct LogStatistics {
  std::array<std::uint64_t, 256> records{};  // per type, also those whose checksum fails
  std::uint64_t bytes = 0;
  std::uint64_t checksum_failures = 0;
  std::uint64_t stray_bytes = 0;
  std::uint64_t damaged_bytes = 0;
  std::uint64_t damaged_stretches = 0;
  // Unix time of the first and of the last record whose checksum holds.
  std::optional<std::uint32_t> first_time;
  std::optional<std::uint32_t> last_time;
  // The first kMaxListed of each; the counts above are of all.
  static constexpr std::size_t kMaxListed = 1000;
  std::vector<Loss> losses;
  std::vector<ChecksumFailure> failures;

  std::uint64_t count(RecordType type) const { return records[static_cast<std::uint8_t>(type)]; }
};

class LogReader {
 public:
  explicit LogReader(std::unique_ptr<ByteSource> source);
  LogReader(LogReader&&) noexcept;
  LogReader& operator=(LogReader&&) noexcept;
  ~LogReader();

  // The next item, nothing at the end. Errors are the source's own (a damaged zip entry, a disk
  // that fails); damage inside the log is no error but an item.
  Result<std::optional<LogItem>> next();

  // Of what next() has handed out so far.
  const LogStatistics& statistics() const;

 private:
  class Window;
  std::unique_ptr<Window> window_;
};

}  // namespace sixpoint::gt3x

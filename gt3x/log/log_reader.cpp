#include "gt3x/log/log_reader.h"

#include <algorithm>
#include <cstring>

namespace sixpoint::gt3x {
namespace {

// How many records in a row prove that a wrong checksum is no wrong size (see framed_by_chain).
constexpr int kChain = 7;
// From any place in the window, so many bytes ahead must be visible unless the end is.
constexpr std::size_t kLookahead = (kChain + 1) * (kMaxRecord + 16);
constexpr std::size_t kCapacity = 2 * kLookahead;
// Read first: memory comes as bytes do, and most readers of a file's first records end in it.
constexpr std::size_t kFirstPiece = std::size_t{64} * 1024;
// Zero bytes that may stand between two records of a chain.
constexpr std::size_t kMaxZerosInChain = 16;

// Times of neighbouring records: the clock may be set back by an hour, and idle sleep or a shelf
// may last two weeks. What lies outside is used when the record behind it agrees.
constexpr std::int64_t kNearBack_s = 3600;
constexpr std::int64_t kNearForward_s = std::int64_t{14} * 86400;

bool near(std::uint32_t time, std::uint32_t reference) {
  const std::int64_t step = static_cast<std::int64_t>(time) - static_cast<std::int64_t>(reference);
  return step >= -kNearBack_s && step <= kNearForward_s;
}

}  // namespace

// The part of log.bin that is in memory. Positions are indices into it.
class LogReader::Window {
 public:
  explicit Window(std::unique_ptr<ByteSource> source) : source_(std::move(source)) {}

  Result<std::optional<LogItem>> next() {
    if (bytes_.empty()) {
      SIXPOINT_CHECK(fill(kFirstPiece));
    }
    if (const auto frame = plain_record()) {
      return take_record(*frame);
    }
    if (!end_of_source_ && end_ - begin_ < kLookahead) {
      SIXPOINT_CHECK(fill(kCapacity));
    }
    if (begin_ == end_) {
      close_loss(std::nullopt);
      return std::nullopt;
    }
    if (!lost_) {
      if (bytes_[begin_] == 0) {
        return take_zeros();
      }
      if (const auto frame = frame_at(begin_); frame && is_record(begin_, *frame)) {
        return take_record(*frame);
      }
    }
    return take_damage();
  }

  const LogStatistics& statistics() const { return statistics_; }

 private:
  struct Frame {
    std::size_t size;
    std::uint32_t time;
    bool checksum_ok;
  };

  Status fill(std::size_t wanted) {
    if (begin_ < end_) {
      std::memmove(bytes_.data(), bytes_.data() + begin_, end_ - begin_);
    }
    base_ += begin_;
    end_ -= begin_;
    begin_ = 0;
    folded_.clear();
    while (end_ < wanted) {
      if (end_ == bytes_.size()) {
        bytes_.resize(std::min(wanted, std::max(kFirstPiece, 2 * bytes_.size())));
      }
      SIXPOINT_ASSIGN(const std::size_t count, source_->read(std::span(bytes_).subspan(end_)));
      if (count == 0) {
        end_of_source_ = true;
        break;
      }
      end_ += count;
    }
    return {};
  }

  // The record at the front, where it needs no look at what comes behind: is_record() would say
  // the same of it with every byte ahead in sight.
  std::optional<Frame> plain_record() const {
    if (lost_) {
      return std::nullopt;
    }
    const auto frame = frame_at(begin_);
    return frame && frame->checksum_ok && followed_well(begin_ + frame->size) ? frame
                                                                              : std::nullopt;
  }

  // The record that begins at `at`, where it is whole.
  std::optional<Frame> frame_at(std::size_t at) const {
    if (end_ - at < kRecordOverhead || bytes_[at] != kSeparator) {
      return std::nullopt;
    }
    const std::size_t size =
        kRecordOverhead + bytes_[at + 6] + static_cast<std::size_t>(bytes_[at + 7]) * 256;
    if (end_ - at < size) {
      return std::nullopt;
    }
    std::uint32_t time = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      time |= static_cast<std::uint32_t>(bytes_[at + 2 + i]) << (8 * i);
    }
    const std::uint8_t sum =
        folded_.empty() ? record_checksum(std::span(bytes_).subspan(at, size - 1))
                        : static_cast<std::uint8_t>(~(folded_[at] ^ folded_[at + size - 1]));
    return Frame{size, time, sum == bytes_[at + size - 1]};
  }

  bool at_end(std::size_t at) const { return at == end_ && end_of_source_; }

  bool followed_well(std::size_t at) const {
    return at == end_ ? end_of_source_ : bytes_[at] == kSeparator || bytes_[at] == 0;
  }

  std::size_t behind_zeros(std::size_t at) const {
    const std::size_t limit = std::min(end_, at + kMaxZerosInChain);
    while (at < limit && bytes_[at] == 0) {
      ++at;
    }
    return at;
  }

  // A place where reading may start again behind damage.
  bool plausible_start(std::size_t at) const {
    const auto frame = frame_at(at);
    if (!frame || !frame->checksum_ok || !followed_well(at + frame->size)) {
      return false;
    }
    if (last_time_ && near(frame->time, *last_time_)) {
      return true;
    }
    const std::size_t behind = behind_zeros(at + frame->size);
    if (at_end(behind)) {
      return true;
    }
    const auto next_frame = frame_at(behind);
    return next_frame && next_frame->checksum_ok && near(next_frame->time, frame->time);
  }

  // Running sums make the checksum of any stretch a matter of two look-ups, so that searching for a
  // record at every byte of a hostile file stays linear.
  void prepare_sums() {
    if (!folded_.empty()) {
      return;
    }
    folded_.resize(end_ + 1);
    std::uint8_t sum = 0;
    for (std::size_t i = 0; i < end_; ++i) {
      folded_[i] = sum;
      sum = static_cast<std::uint8_t>(sum ^ bytes_[i]);
    }
    folded_[end_] = sum;
  }

  bool hides_a_record(std::size_t at, std::size_t size) {
    prepare_sums();
    for (std::size_t inner = at + 1; inner < at + size; ++inner) {
      if (bytes_[inner] == kSeparator && plausible_start(inner)) {
        return true;
      }
    }
    return false;
  }

  // Whether records go on right behind a frame whose checksum fails: one whose own checksum holds,
  // perhaps behind others that fail as well, or kChain in a row that at least keep time.
  bool framed_by_chain(std::size_t at, std::uint32_t time) const {
    const std::uint32_t reference = last_time_.value_or(time);
    for (int step = 0; step < kChain; ++step) {
      at = behind_zeros(at);
      if (at_end(at)) {
        return near(time, reference);
      }
      const auto frame = frame_at(at);
      if (!frame || !near(frame->time, reference)) {
        return false;
      }
      if (frame->checksum_ok) {
        return true;
      }
      at += frame->size;
    }
    return true;
  }

  bool is_record(std::size_t at, const Frame& frame) {
    const std::size_t behind = at + frame.size;
    if (frame.checksum_ok) {
      // With rubbish behind it, it may be a wrong size that met a right checksum by chance, one
      // time in 256: then the real next record begins inside.
      return followed_well(behind) || !hides_a_record(at, frame.size);
    }
    return framed_by_chain(behind, frame.time) && !hides_a_record(at, frame.size);
  }

  LogItem take(LogItem::Kind kind, std::size_t size) {
    LogItem item;
    item.kind = kind;
    item.raw = std::span<const std::uint8_t>(bytes_).subspan(begin_, size);
    item.offset = base_ + begin_;
    begin_ += size;
    statistics_.bytes += size;
    return item;
  }

  LogItem take_zeros() {
    std::size_t at = begin_;
    while (at < end_ && bytes_[at] == 0) {
      ++at;
    }
    statistics_.stray_bytes += at - begin_;
    return take(LogItem::Kind::stray, at - begin_);
  }

  LogItem take_record(const Frame& frame) {
    LogItem item = take(LogItem::Kind::record, frame.size);
    Record& record = item.record;
    record.type = item.raw[1];
    record.unix_time = frame.time;
    record.payload = item.raw.subspan(kHeaderSize, frame.size - kRecordOverhead);
    record.raw = item.raw;
    record.checksum_ok = frame.checksum_ok;
    record.offset = item.offset;
    ++statistics_.records[record.type];
    if (record.checksum_ok) {
      close_loss(record.unix_time);
      last_time_ = record.unix_time;
      statistics_.last_time = record.unix_time;
      if (!statistics_.first_time) {
        statistics_.first_time = record.unix_time;
      }
    } else {
      ++statistics_.checksum_failures;
      if (statistics_.failures.size() < LogStatistics::kMaxListed) {
        statistics_.failures.push_back({record.offset, record.type, record.unix_time});
      }
    }
    return item;
  }

  LogItem take_damage() {
    prepare_sums();
    // The first byte of a stretch is damaged for certain; in its later pieces none is yet.
    std::size_t at = lost_ ? begin_ : begin_ + 1;
    const std::size_t limit = end_of_source_ ? end_ : std::max(begin_ + 1, end_ - kLookahead / 2);
    bool found = false;
    for (; at < limit; ++at) {
      if (bytes_[at] == kSeparator && plausible_start(at)) {
        found = true;
        break;
      }
    }
    const std::size_t size = at - begin_;
    if (size == 0) {  // a later piece that turns out to be none
      lost_ = false;
      return take_record(*frame_at(begin_));
    }
    lost_ = !found && !(end_of_source_ && at == end_);
    statistics_.damaged_bytes += size;
    if (!open_loss_) {
      open_loss_ = Loss{base_ + begin_, 0, last_time_, std::nullopt};
      ++statistics_.damaged_stretches;
    }
    open_loss_->bytes += size;
    return take(LogItem::Kind::damaged, size);
  }

  void close_loss(std::optional<std::uint32_t> time_after) {
    if (!open_loss_) {
      return;
    }
    open_loss_->time_after = time_after;
    if (statistics_.losses.size() < LogStatistics::kMaxListed) {
      statistics_.losses.push_back(*open_loss_);
    }
    open_loss_.reset();
  }

  std::unique_ptr<ByteSource> source_;
  Bytes bytes_;  // [begin_, end_) is what was read and not yet handed out
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t base_ = 0;  // offset of bytes_[0] in log.bin
  bool end_of_source_ = false;
  Bytes folded_;  // folded_[i]: exclusive-or of bytes_[0 .. i-1]; empty until it is needed
  bool lost_ = false;
  std::optional<std::uint32_t> last_time_;
  std::optional<Loss> open_loss_;
  LogStatistics statistics_;
};

LogReader::LogReader(std::unique_ptr<ByteSource> source)
    : window_(std::make_unique<Window>(std::move(source))) {}
LogReader::LogReader(LogReader&&) noexcept = default;
LogReader& LogReader::operator=(LogReader&&) noexcept = default;
LogReader::~LogReader() = default;

Result<std::optional<LogItem>> LogReader::next() { return window_->next(); }
const LogStatistics& LogReader::statistics() const { return window_->statistics(); }

}  // namespace sixpoint::gt3x

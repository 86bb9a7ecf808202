#include "gt3x/rows/sample_stream.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "gt3x/rows/sample_rows.h"

namespace sixpoint::gt3x {
namespace {

// How counts become g.
struct Meaning {
  const AgdcCalibration* agdc = nullptr;
  double scale_lsb_per_g = 1;

  bool operator==(const Meaning&) const = default;
};

// What a RowSource gave and no one has read yet.
struct Piece {
  std::optional<std::uint32_t> unix_time;  // where a second begins with it
  std::span<const Counts> samples;         // or, where empty:
  Counts repeated{};
  std::uint64_t times = 0;
  bool zeros = false;
  Meaning meaning;

  std::uint64_t rows() const { return samples.empty() ? times : samples.size(); }
};

class Pieces final : public RowWriter {
 public:
  Status begin(std::uint32_t, bool) override { return {}; }
  void set_meaning(const AgdcCalibration* agdc, double scale_lsb_per_g) override {
    meaning_ = {agdc, scale_lsb_per_g};
  }
  void at(std::uint32_t unix_time) override { unix_time_ = unix_time; }
  Status rows(std::span<const Counts> samples) override {
    if (!samples.empty()) {
      pieces_.push_back({take_time(), samples, {}, 0, false, meaning_});
    }
    return {};
  }
  Status repeat(const Counts& sample, std::uint64_t times, bool zeros) override {
    if (times > 0) {
      pieces_.push_back({take_time(), {}, zeros ? Counts{} : sample, times, zeros, meaning_});
    }
    return {};
  }
  Status end() override { return {}; }

  const Piece* first() const { return next_ < pieces_.size() ? &pieces_[next_] : nullptr; }
  void drop_first() {
    if (++next_ == pieces_.size()) {
      pieces_.clear();
      next_ = 0;
    }
  }
  // A time that no row followed (a gap that is left out) belongs to no row.
  void forget_time() { unix_time_.reset(); }

 private:
  std::optional<std::uint32_t> take_time() { return std::exchange(unix_time_, std::nullopt); }

  std::vector<Piece> pieces_;
  std::size_t next_ = 0;
  std::optional<std::uint32_t> unix_time_;
  Meaning meaning_;
};

template <class Value>
PerAxis<Value> in_g(const Counts& counts, const Meaning& meaning) {
  PerAxis<Value> row{};
  if (meaning.agdc != nullptr) {
    const PerAxis<double> exact_g = meaning.agdc->apply(counts);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      row[axis] = static_cast<Value>(exact_g[axis]);
    }
    return row;
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    row[axis] = static_cast<Value>(counts[axis] / meaning.scale_lsb_per_g);
  }
  return row;
}

// Rows `from` on of a piece, as many as `out` holds.
void put(const Piece& piece, std::uint64_t from, std::span<Counts> out) {
  if (piece.samples.empty()) {
    std::ranges::fill(out, piece.repeated);
  } else {
    std::memcpy(out.data(), piece.samples.data() + from, out.size_bytes());
  }
}
template <class Value>
void put(const Piece& piece, std::uint64_t from, std::span<PerAxis<Value>> out) {
  if (piece.samples.empty()) {
    std::ranges::fill(out,
                      piece.zeros ? PerAxis<Value>{} : in_g<Value>(piece.repeated, piece.meaning));
    return;
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = in_g<Value>(piece.samples[from + i], piece.meaning);
  }
}

}  // namespace

struct SampleStream::State {
  State(RowSource opened, const SampleStreamOptions& options, std::uint64_t expected_rows)
      : source(std::move(opened)),
        raw_lsb(options.raw_lsb),
        fill(options.fill),
        expected(expected_rows) {}

  // The next piece that has rows; null at the end.
  Result<const Piece*> piece() {
    while (pieces.first() == nullptr && !ended) {
      pieces.forget_time();
      SIXPOINT_ASSIGN(const bool more, source.step(pieces));
      ended = !more;
    }
    return pieces.first();
  }

  void note(const Piece& piece) {
    if (piece.unix_time) {
      const std::uint64_t rate = source.rate_hz();
      const bool goes_on =
          !runs.empty() && (rows - runs.back().first_row) % rate == 0 &&
          runs.back().unix_time + (rows - runs.back().first_row) / rate == *piece.unix_time;
      if (!goes_on) {
        runs.push_back({rows, *piece.unix_time});
      }
    }
    if (!raw_lsb && (scales.empty() || !(meaning == piece.meaning))) {
      meaning = piece.meaning;
      scales.push_back({rows, meaning.agdc != nullptr ? 0 : meaning.scale_lsb_per_g});
    }
  }

  template <class Row>
  Result<std::size_t> read(std::span<Row> out) {
    std::size_t done = 0;
    while (done < out.size()) {
      SIXPOINT_ASSIGN(const Piece* const next, piece());
      if (next == nullptr) {
        break;
      }
      if (taken == 0) {
        note(*next);
      }
      const auto count = static_cast<std::size_t>(
          std::min<std::uint64_t>(next->rows() - taken, out.size() - done));
      put(*next, taken, out.subspan(done, count));
      done += count;
      rows += count;
      taken += count;
      if (taken == next->rows()) {
        pieces.drop_first();
        taken = 0;
      }
    }
    return done;
  }

  template <class Row>
  Result<std::size_t> read_g(std::span<Row> out) {
    if (raw_lsb) {
      return fail(ErrorCode::usage, "a stream of stored counts has no rows in g", {},
                  "open it without raw_lsb");
    }
    return read(out);
  }

  RowSource source;
  bool raw_lsb;
  bool fill;
  std::uint64_t expected;
  Pieces pieces;
  std::uint64_t taken = 0;  // rows of the first piece
  bool ended = false;
  std::uint64_t rows = 0;
  std::vector<RowRun> runs;
  std::vector<RowScale> scales;
  Meaning meaning;
};

Result<SampleStream> SampleStream::open(Recording& recording, const SampleStreamOptions& options) {
  RawCsvOptions how;
  how.raw_lsb = options.raw_lsb;
  how.fill = options.fill;
  how.fill_limit_s = options.fill_limit_s;
  how.fill_zeros = options.fill_zeros;
  SIXPOINT_ASSIGN(RowSource source, RowSource::open(recording, how));
  std::uint64_t bytes = 0;
  for (const EntryInfo& entry : recording.entries()) {
    if (entry.name == (recording.has_log() ? "log.bin" : "activity.bin")) {
      bytes = entry.size;
    }
  }
  // Nine nibbles to a sample.
  return SampleStream(std::make_unique<State>(std::move(source), options, bytes / 9 * 2));
}

SampleStream::SampleStream(std::unique_ptr<State> state) : state_(std::move(state)) {}
SampleStream::SampleStream(SampleStream&&) noexcept = default;
SampleStream& SampleStream::operator=(SampleStream&&) noexcept = default;
SampleStream::~SampleStream() = default;

Result<std::size_t> SampleStream::read(std::span<Counts> rows) { return state_->read(rows); }
Result<std::size_t> SampleStream::read(std::span<PerAxis<float>> rows_g) {
  return state_->read_g(rows_g);
}
Result<std::size_t> SampleStream::read(std::span<PerAxis<double>> rows_g) {
  return state_->read_g(rows_g);
}
const std::vector<RowRun>& SampleStream::runs() const { return state_->runs; }
const std::vector<RowScale>& SampleStream::scales() const { return state_->scales; }
const GapList& SampleStream::gaps() const { return state_->source.gaps(); }
std::uint64_t SampleStream::rows() const { return state_->rows; }
bool SampleStream::fills() const { return state_->fill; }
std::uint64_t SampleStream::rate_hz() const { return state_->source.rate_hz(); }
const SampleReader& SampleStream::reader() const { return state_->source.reader(); }
Result<RawCsvTally> SampleStream::tally() const { return state_->source.tally(); }
std::uint64_t SampleStream::rows_at_hand() const {
  const Piece* const piece = state_->pieces.first();
  return piece == nullptr ? 0 : piece->rows() - state_->taken;
}
std::uint64_t SampleStream::expected_rows() const { return state_->expected; }

void row_times_ns(std::span<const RowRun> runs, std::uint64_t rate_hz, std::uint64_t first_row,
                  std::span<std::int64_t> times_ns) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  auto run = std::ranges::upper_bound(runs, first_row, {}, &RowRun::first_row);
  run = run == runs.begin() ? run : std::prev(run);
  std::size_t done = 0;
  while (done < times_ns.size() && run != runs.end()) {
    const auto next = std::next(run);
    const std::uint64_t row = first_row + done;
    const std::uint64_t end =
        next == runs.end() ? std::numeric_limits<std::uint64_t>::max() : next->first_row;
    const std::uint64_t within = row - run->first_row;
    std::int64_t second_ns =
        (std::int64_t{run->unix_time} + static_cast<std::int64_t>(within / rate_hz)) * kSecond_ns;
    std::uint64_t k = within % rate_hz;
    const auto rate = static_cast<std::int64_t>(rate_hz);
    for (std::uint64_t left = end - row; left > 0 && done < times_ns.size(); --left) {
      times_ns[done++] = second_ns + static_cast<std::int64_t>(k) * kSecond_ns / rate;
      if (++k == rate_hz) {
        k = 0;
        second_ns += kSecond_ns;
      }
    }
    run = next;
  }
}

std::size_t bytes_of_row(RowValue value) {
  switch (value) {
    case RowValue::lsb_int16:
      return sizeof(Counts);
    case RowValue::g_float32:
      return sizeof(PerAxis<float>);
    case RowValue::g_float64:
      break;
  }
  return sizeof(PerAxis<double>);
}

namespace {

template <class Row>
Result<std::size_t> read_rows_at(SampleStream& stream, void* memory, std::uint64_t row,
                                 std::uint64_t count) {
  return stream.read(std::span(static_cast<Row*>(memory) + row, static_cast<std::size_t>(count)));
}

Error too_large(std::uint64_t most_bytes) {
  return {ErrorCode::io,
          fmt::format("the samples take more than {} MB of memory", most_bytes / 1'000'000),
          {},
          "read it in blocks, or as stored counts; or do not fill what is missing"};
}

// Changes the size of the array's memory, which keeps its content.
Status hold_rows(RowArray& array, std::uint64_t rows, std::size_t row_bytes,
                 std::uint64_t most_bytes) {
  const std::uint64_t most_rows = most_bytes / row_bytes;
  if (array.rows >= most_rows && rows > array.rows) {
    return fail(too_large(most_bytes));
  }
  rows = std::min(rows, most_rows);
  void* const memory = std::realloc(array.data.get(), static_cast<std::size_t>(rows * row_bytes));
  if (memory == nullptr) {
    return fail(ErrorCode::io, fmt::format("there is no memory for {} rows", rows), {},
                "read it in blocks, or as stored counts");
  }
  static_cast<void>(array.data.release());
  array.data.reset(memory);
  return {};
}

}  // namespace

Result<RowArray> read_all_rows(SampleStream& stream, RowValue value,
                               const RowArrayOptions& options) {
  const std::size_t row_bytes = bytes_of_row(value);
  RowArray array;
  std::uint64_t room = std::min(std::max<std::uint64_t>(stream.expected_rows(), 1024),
                                options.most_bytes / row_bytes);
  SIXPOINT_CHECK(hold_rows(array, room, row_bytes, options.most_bytes));
  for (;;) {
    if (array.rows == room) {
      room += room / 2 + kRowsBetween;
      SIXPOINT_CHECK(hold_rows(array, room, row_bytes, options.most_bytes));
      room = std::min(room, options.most_bytes / row_bytes);
    }
    const std::uint64_t wanted = std::min(room - array.rows, kRowsBetween);
    void* const memory = array.data.get();
    const auto got = value == RowValue::lsb_int16
                         ? read_rows_at<Counts>(stream, memory, array.rows, wanted)
                     : value == RowValue::g_float32
                         ? read_rows_at<PerAxis<float>>(stream, memory, array.rows, wanted)
                         : read_rows_at<PerAxis<double>>(stream, memory, array.rows, wanted);
    SIXPOINT_ASSIGN(const std::size_t rows, got);
    array.rows += rows;
    if (stream.rows_at_hand() > options.most_bytes / row_bytes - array.rows) {
      return fail(too_large(options.most_bytes));  // before memory is touched
    }
    if (options.go_on) {
      SIXPOINT_CHECK(options.go_on());
    }
    if (rows < wanted) {
      break;
    }
  }
  if (array.rows > 0) {
    SIXPOINT_CHECK(hold_rows(array, array.rows, row_bytes, UINT64_MAX));
  }
  return array;
}

}  // namespace sixpoint::gt3x

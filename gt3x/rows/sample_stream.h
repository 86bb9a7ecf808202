// The samples of a recording as rows in memory: some at a time, or all at once.
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, "unit.gt3x"));
//   SIXPOINT_ASSIGN(auto stream, SampleStream::open(recording, {}));
//   std::vector<PerAxis<double>> block_g(100'000);
//   for (;;) {
//     SIXPOINT_ASSIGN(const std::size_t rows, stream.read(std::span(block_g)));
//     if (rows == 0) break;
//   }
//   stream.runs().front().unix_time;  // of the first row
//
// There is a row per line of the CSV (raw_csv.h), X Y Z. As counts (int16), rows are what the file
// holds; as float and double they are g: the count over the scale, not rounded to 0.001.
//
// One object belongs to one thread. It stays usable when the recording it was opened from ends.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/measure.h"
#include "gt3x/gap_list.h"
#include "gt3x/recording.h"
#include "gt3x/rows/raw_csv.h"

namespace sixpoint::gt3x {

// Rows without a break: row n, of first_row on, was taken at
// unix_time + (n - first_row) / rate_hz.
struct RowRun {
  std::uint64_t first_row = 0;
  std::uint32_t unix_time = 0;
};

// From first_row on so many counts make one g; 0 where an .agdc's matrix says it.
struct RowScale {
  std::uint64_t first_row = 0;
  double lsb_per_g = 0;
};

struct SampleStreamOptions {
  bool raw_lsb = false;  // rows are read as counts only, and no scale is asked for
  bool fill = true;      // as RawCsvOptions
  std::uint64_t fill_limit_s = kUsualFillLimit_s;
  bool fill_zeros = false;
};

class SampleStream {
 public:
  // Errors as write_raw_csv(), here or from read().
  static Result<SampleStream> open(Recording& recording, const SampleStreamOptions& options);
  SampleStream(SampleStream&&) noexcept;
  SampleStream& operator=(SampleStream&&) noexcept;
  ~SampleStream();

  // Writes the next rows to the front of `rows` and returns how many; fewer than there is room for
  // only at the end, then 0. As counts with any options, as g where raw_lsb is off: usage.
  Result<std::size_t> read(std::span<Counts> rows);
  Result<std::size_t> read(std::span<PerAxis<float>> rows_g);
  Result<std::size_t> read(std::span<PerAxis<double>> rows_g);

  // Of the rows read so far.
  const std::vector<RowRun>& runs() const;
  const std::vector<RowScale>& scales() const;  // empty with raw_lsb
  const GapList& gaps() const;                  // with filling; without, gaps_of() has them
  std::uint64_t rows() const;
  bool fills() const;  // SampleStreamOptions::fill
  std::uint64_t rate_hz() const;
  const SampleReader& reader() const;
  // Behind the end.
  Result<RawCsvTally> tally() const;

  // Rows that are certain to come next: what is left of a second, or of missing ones.
  std::uint64_t rows_at_hand() const;
  // About how many rows there will be: what the packed form has room for. Filled rows come on top.
  std::uint64_t expected_rows() const;

 private:
  struct State;
  explicit SampleStream(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Times of rows first_row, first_row + 1 ... in nanoseconds since 1970 by the recording's clock,
// rounded down.
void row_times_ns(std::span<const RowRun> runs, std::uint64_t rate_hz, std::uint64_t first_row,
                  std::span<std::int64_t> times_ns);

enum class RowValue : std::uint8_t { lsb_int16, g_float32, g_float64 };
std::size_t bytes_of_row(RowValue value);

// All rows, one after the other, in memory of malloc() that the one who takes `data` frees by
// free().
struct RowArray {
  struct Free {
    void operator()(void* memory) const { std::free(memory); }
  };
  std::unique_ptr<void, Free> data;  // null without rows
  std::uint64_t rows = 0;
};

struct RowArrayOptions {
  // io above so many bytes: a file of some kB can ask for 400 days to be filled.
  std::uint64_t most_bytes = UINT64_MAX;
  // Asked after every kRowsBetween rows, some milliseconds; an error ends the reading.
  std::function<Status()> go_on;
};
inline constexpr std::uint64_t kRowsBetween = std::uint64_t{1} << 19U;

// Reads the stream to its end. The memory grows without being copied (realloc of whole pages), so
// at most the array itself is resident.
Result<RowArray> read_all_rows(SampleStream& stream, RowValue value,
                               const RowArrayOptions& options = {});

}  // namespace sixpoint::gt3x

// The rows of an export: which there are, and what each holds (private to this room). raw_csv.h
// and samples_npy.h say how they are written.
//
//   SIXPOINT_ASSIGN(const RawCsvTally tally, write_rows(recording, {}, writer));
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "gt3x/forms/agdc.h"
#include "gt3x/gap_list.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/rows/raw_csv.h"

namespace sixpoint::gt3x {

class RowWriter {
 public:
  RowWriter() = default;
  RowWriter(const RowWriter&) = delete;
  RowWriter& operator=(const RowWriter&) = delete;
  virtual ~RowWriter() = default;

  // Once, before all else. `utc`: the recording's clock is known to show UTC.
  virtual Status begin(std::uint32_t start_time, bool utc) = 0;
  // How counts become g from here on: by `agdc`, or where it is null by the scale. Not called for
  // rows of stored counts.
  virtual void set_meaning(const AgdcCalibration* agdc, double scale_lsb_per_g) = 0;
  // The rows that come next are those of this second, from its first on.
  virtual void at(std::uint32_t unix_time) = 0;
  virtual Status rows(std::span<const Counts> samples) = 0;
  // The same row many times; `zeros`: of zeros, whatever the sample.
  virtual Status repeat(const Counts& sample, std::uint64_t times, bool zeros) = 0;
  virtual Status end() = 0;
};

// The rows of a recording, some at a time.
class RowSource {
 public:
  // Errors as write_raw_csv(). `recording` may end before the source; `options` may too.
  static Result<RowSource> open(Recording& recording, const RawCsvOptions& options);
  RowSource(RowSource&&) noexcept;
  RowSource& operator=(RowSource&&) noexcept;
  ~RowSource();

  // Gives `out` the next second, or the next missing ones; false at the end. The samples that
  // rows() is given stay until the next call.
  Result<bool> step(RowWriter& out);
  // Behind the end; bad_data where there was no sample.
  Result<RawCsvTally> tally() const;

  const SampleReader& reader() const;
  const GapList& gaps() const;  // with filling; without, gaps_of() has them
  std::uint64_t rate_hz() const;

 private:
  class Rows;
  explicit RowSource(std::unique_ptr<Rows> rows);
  std::unique_ptr<Rows> rows_;
};

// As write_raw_csv().
Result<RawCsvTally> write_rows(Recording& recording, const RawCsvOptions& options, RowWriter& out);

}  // namespace sixpoint::gt3x

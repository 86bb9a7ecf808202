// A log.bin with other constants: the records of one pulled in, the records of the other pulled
// out.
//
//   SIXPOINT_ASSIGN(auto log, recording.open_log());
//   RescaledLogOptions options;
//   options.fresh = constants;
//   SIXPOINT_ASSIGN(const auto repaired, RescaledLog::make(std::move(log), options));
//   SIXPOINT_CHECK(repaired->read(bytes));  // log.bin, piece by piece
//
// Only ACTIVITY and ACTIVITY2 records with samples in them and a right checksum change; they are
// packed anew and get their checksum. One record is new: the mark, before all others. Every other
// byte comes out as it went in: other records, USB records, records whose checksum fails, zero
// bytes and damage between records.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/stored_constants.h"
#include "calib/constants.h"
#include "calib/scaling.h"
#include "gt3x/container/byte_source.h"
#include "gt3x/log/log_reader.h"
#include "gt3x/log/samples.h"
#include "repair/rescale/still_windows.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

struct RescaledLogOptions {
  // The constants to apply. Without them only the rotation is undone.
  std::optional<calib::Calibration> fresh;
  // The cross-axis terms that belong to them: xy, xz, yz. All zero: none.
  PerAxis<double> cross_axis{};
  // Of the samples for which no PARAMETERS say it.
  double accel_scale_lsb_per_g = 256;
  // Scales the samples that stand before the first PARAMETERS record.
  std::optional<StoredConstants> first_constants;
  bool undo_rotation = false;
  // Write ACTIVITY2 records, so that nothing that leaves 12 bits is clipped.
  bool wide = false;
  // The file holds counts beyond 12 bits: its own limit is that of ACTIVITY2.
  bool beyond_12_bits = false;
  // Leaves out what is no good record: damage between records, and records whose checksum fails.
  bool leave_out_damage = false;
  // The counts cannot have come from the constants: one affine map instead of the integers.
  bool affine = false;
  // JSON text of at most gt3x::kMaxPayload bytes, put before the first good record as METADATA of
  // that record's time. Empty: no mark.
  std::string mark;
  // Bytes that will come out at most, but for the mark, where they are known (Survey::log_bytes,
  // log_bytes_wide).
  std::optional<std::uint64_t> size;

  bool operator==(const RescaledLogOptions&) const = default;
};

// A sample that was clipped before is clipped after, too, however wide the record is.
struct RescaledLogTally {
  std::uint64_t samples = 0;
  std::uint64_t sample_records = 0;
  std::uint64_t changed_samples = 0;
  std::uint64_t clipped_before = 0;  // samples with an axis at the limit of the record they came in
  std::uint64_t clipped_after = 0;   // ... of the record they went out in
  std::uint64_t affine_counts = 0;   // counts with no integer behind them, mapped by the line
  std::uint64_t epoch_records = 0;   // the unit's own epochs, which it computed from wrong samples
};

class RescaledLog final : public gt3x::ByteSource {
 public:
  // bad_data where the first constants are such that Eq. 1-3 cannot be used with them, and where the
  // mark is too long.
  static Result<std::unique_ptr<RescaledLog>> make(gt3x::LogReader log,
                                                   const RescaledLogOptions& options);

  // Before the first read(): every item goes through `survey` too, on the thread that reads, and
  // the still blocks that it finds are expected (below). Not owned. Its errors come from read().
  void survey_with(LogSurvey& survey);
  // Before the first read(): where the input was still (Survey::blocks).
  void expect_still(std::span<const StillWindow> windows);

  // bad_data where PARAMETERS bring constants that Eq. 1-3 cannot be used with.
  Result<std::size_t> read(std::span<std::uint8_t> out) override;
  std::optional<std::uint64_t> size() const override;

  // Complete after read() has answered 0.
  const RescaledLogTally& tally() const { return tally_; }
  const gt3x::LogStatistics& statistics() const { return log_.statistics(); }  // of the input
  // Mean of |magnitude - 1 g| of what came out in these windows, which were expected, by its own
  // scale; nothing without a window.
  std::optional<double> still_error_mg(std::span<const StillWindow> windows) {
    return still_.mean_mg(windows);
  }

 private:
  RescaledLog(gt3x::LogReader log, const RescaledLogOptions& options);
  // What the samples from here on were made with.
  Status set_source(const std::optional<StoredConstants>& constants, double accel_scale_lsb_per_g);
  Result<bool> pull();  // the next item into pending_; false at the end
  void put_mark(std::uint32_t unix_time);
  void put_samples(const gt3x::Record& record);

  gt3x::LogReader log_;
  RescaledLogOptions options_;
  LogSurvey* survey_ = nullptr;
  WindowError still_;
  std::optional<StoredConstants> constants_;
  double accel_scale_lsb_per_g_;
  // By the constants that are undone; the log holds a few sets, whatever their order.
  struct Map {
    StoredConstants undone;
    double accel_scale_lsb_per_g = 0;
    calib::Rescale rescale;
  };
  std::vector<Map> maps_;
  std::optional<std::size_t> map_;  // of maps_, in force
  bool marked_ = false;
  std::vector<gt3x::Counts> samples_;
  std::vector<gt3x::Counts> fresh_samples_;
  Bytes payload_;
  Bytes pending_;
  std::size_t taken_ = 0;
  RescaledLogTally tally_;
};

}  // namespace sixpoint::repair

// What the firmware did to every sample, undone exactly, and done again with other constants.
//
//   SIXPOINT_ASSIGN(const Reversal reversal, Reversal::make(stored, 256, RecordWidth::bits12));
//   SIXPOINT_ASSIGN(const Rescale rescale, Rescale::make(reversal, fresh, {}));
//   RescaleTally tally;
//   rescale.apply(counts, counts, tally);
//
//     stored = round_half_away(2 (m - zero) / (positive - negative) * accel_scale), clipped
//
// (paper, Eq. 1-6; the rounding and the clipping are the recordings'). m was an integer count of
// the sensor. Reversal finds it by running that rule forward over all integers; Rescale then
// applies new constants to it in floating point and rounds once. Rounding twice instead would leave
// a slow sawtooth of up to half a count (2 mg) that noise does not average out.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "base/stored_constants.h"
#include "calib/constants.h"

namespace sixpoint::calib {

using StoredCounts = PerAxis<std::int16_t>;  // one sample as it stands in the recording, X Y Z

// How wide a count a record type holds: ACTIVITY 12 bits, ACTIVITY2 and ACTIVITY3 16 bits.
enum class RecordWidth { bits12, bits16 };
constexpr int lowest_count(RecordWidth width) {
  return width == RecordWidth::bits12 ? -2048 : -32768;
}
constexpr int highest_count(RecordWidth width) {
  return width == RecordWidth::bits12 ? 2047 : 32767;
}

// The nearest integer, halves away from zero; saturates at +-2^30, NaN gives 0.
int round_half_away(double value);

// The integers that can have led to a stored count: first .. first + number - 1.
struct RawCandidates {
  int first = 0;
  int number = 0;     // 0: no integer leads here; 1, or 2 where the firmware's slope is below 1
  bool tie = false;   // reached only if the firmware rounded an exact half the other way
  double middle = 0;  // of the candidates; of the affine map where there is none
};

// Immutable after make(), so threads may share it.
class Reversal {
 public:
  // bad_data on invalid constants or an accel_scale outside 1 .. 32768.
  static Result<Reversal> make(const StoredConstants& stored, double accel_scale_lsb_per_g,
                               RecordWidth width);
  // For recordings that hold the sensor's raw counts (.agdc) or whose constants are not known: the
  // raw count is the stored count.
  static Result<Reversal> of_raw_counts(double accel_scale_lsb_per_g, RecordWidth width);

  RawCandidates candidates(std::size_t axis, int stored_count) const;
  // candidates().middle, from a table: the best estimate of m from one stored count.
  double raw_lsb(std::size_t axis, std::int16_t stored_count) const {
    return raw_[axis][index(stored_count)];
  }
  double affine_raw_lsb(std::size_t axis, double stored_count) const {
    return calibration_.zero_lsb[axis] +
           stored_count / (calibration_.sensitivity_g_per_lsb[axis] * accel_scale_);
  }
  // Clipped: the record's limit. Its true value is unknown.
  bool clipped(std::int16_t stored_count) const {
    return stored_count <= lowest_count(width_) || stored_count >= highest_count(width_);
  }

  double accel_scale_lsb_per_g() const { return accel_scale_; }
  RecordWidth width() const { return width_; }
  const Calibration& calibration() const { return calibration_; }  // the one that is undone
  bool raw_counts() const { return raw_counts_; }

 private:
  std::size_t index(int stored_count) const {
    const int low = lowest_count(width_);
    const int high = highest_count(width_);
    const int inside = stored_count < low ? low : (stored_count > high ? high : stored_count);
    return static_cast<std::size_t>(inside - low);
  }

  Calibration calibration_;
  double accel_scale_ = 0;
  RecordWidth width_ = RecordWidth::bits12;
  bool raw_counts_ = false;
  PerAxis<std::vector<double>> raw_;
  PerAxis<std::vector<std::int16_t>> first_;
  PerAxis<std::vector<std::uint16_t>> number_;
  PerAxis<std::vector<std::uint8_t>> tie_;
  // What tally() counts.
  static constexpr std::uint8_t kClipped = 1;
  static constexpr std::uint8_t kImpossible = 2;
  PerAxis<std::vector<std::uint8_t>> kind_;
  bool some_impossible_ = false;
  void sort_counts();

  friend void tally(const Reversal& reversal, std::span<const StoredCounts> samples,
                    struct PlausibilityTally& counts);
};

// Whether a file's counts can have come from its constants. Where positive - negative is below
// 2 accel_scale, some stored counts have no integer behind them; a file that holds such counts was
// repaired, resampled, or written by other firmware.
struct PlausibilityTally {
  std::uint64_t counts = 0;      // stored counts looked at (three per sample), clipped ones not
  std::uint64_t impossible = 0;  // those without a candidate

  double plausible_fraction() const {
    return counts == 0 ? 1.0 : 1.0 - static_cast<double>(impossible) / static_cast<double>(counts);
  }
  // False when more than one count in ten thousand is impossible: bit errors may make a few,
  // another origin makes (1 - slope) of them, which is 1 to 5 %.
  bool plausible() const { return plausible_fraction() > 0.9999; }
};
void tally(const Reversal& reversal, std::span<const StoredCounts> samples,
           PlausibilityTally& counts);

// What happened to the samples that went through a Rescale.
struct RescaleTally {
  std::uint64_t samples = 0;
  PerAxis<std::uint64_t> clipped_before{};  // at the limit of the incoming record
  PerAxis<std::uint64_t> clipped_after{};   // left the outgoing record's range, and was clipped
  PerAxis<std::uint64_t> affine{};          // no integer behind the count: mapped by the line
};

// Stored count -> new stored count, per axis, as a table.
//  - one candidate: the new constants applied to that integer; two: to their middle; none: to the
//    affine inverse. One rounding, halves away from zero, in every case.
//  - a count at the incoming record's limit stays at the limit when the outgoing record is 12 bits
//    wide as well; in a wider outgoing record it becomes what the new constants make of it (a lower
//    bound of the true magnitude). Either way it is counted in clipped_before.
//  - constants that are equal to the old ones change no count at all.
//  - with cross-axis terms: first the integers, as above; then the constants, in floating point;
//    then the terms; and then the one rounding. A count at the limit is left there as above.
// Immutable after make(); threads may share it.
class Rescale {
 public:
  struct Options {
    RecordWidth output = RecordWidth::bits12;  // the form that every reader understands
    // Set where the file's counts cannot have come from its constants: no candidates, the affine
    // map for all counts.
    bool affine = false;
    // Terms xy, xz, yz that belong to the constants (CrossAxisMap). All zero: none.
    PerAxis<double> cross_axis{};
  };
  static Result<Rescale> make(const Reversal& reversal, const Calibration& fresh,
                              const Options& options);

  // Without cross-axis terms, which need all three counts of a sample.
  std::int16_t operator()(std::size_t axis, std::int16_t stored_count) const {
    return count_of(entry(axis, stored_count));
  }
  // In place allowed (in == out); the spans have the same length.
  void apply(std::span<const StoredCounts> in, std::span<StoredCounts> out,
             RescaleTally& counts) const;

 private:
  enum Flag : std::uint8_t { kClippedBefore = 1, kClippedAfter = 2, kAffine = 4 };
  std::size_t index(int stored_count) const {
    const int low = lowest_count(input_);
    const int high = highest_count(input_);
    const int inside = stored_count < low ? low : (stored_count > high ? high : stored_count);
    return static_cast<std::size_t>(inside - low);
  }

  // The new count in the lower half and the flags above it: one look-up finds both.
  using Entry = std::uint32_t;
  static Entry entry_of(int count, std::uint8_t flags) {
    return static_cast<std::uint16_t>(count) | Entry{flags} << 16U;
  }
  static std::int16_t count_of(Entry entry) { return static_cast<std::int16_t>(entry); }
  static std::uint8_t flags_of(Entry entry) { return static_cast<std::uint8_t>(entry >> 16U); }
  Entry entry(std::size_t axis, int stored_count) const {
    return entries_[axis][index(stored_count)];
  }

  StoredCounts with_terms(const StoredCounts& in, PerAxis<std::uint8_t>& flags) const;

  RecordWidth input_ = RecordWidth::bits12;
  RecordWidth output_ = RecordWidth::bits12;
  bool has_terms_ = false;
  PerAxis<double> cross_axis_{};
  PerAxis<std::vector<double>> level_;  // unrounded counts by `fresh`; with cross-axis terms only
  PerAxis<std::vector<Entry>> entries_;
};

}  // namespace sixpoint::calib

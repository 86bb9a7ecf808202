// Still blocks of a recording, record by record: what a calibration can learn from it.
//
//   SIXPOINT_ASSIGN(auto scan, StillScan::make(30, 256));  // Hz, LSB/g
//   SIXPOINT_CHECK(scan.set_constants(stored));
//   scan.push(unix_time, samples);  // a second of them, again and again
//   const double error_mg = magnitude_error(scan.finish()).mean_mg;
//
// Feeds the sample records of a log to calib::StillBlockFinder and breaks its runs where the
// samples do: at a gap in the records' times, at idle sleep, at a USB record, and where the
// constants in the PARAMETERS records change. Used on what a file holds, and on what repair makes
// of it. Counts at or beyond 12 bits, the sensor's own full scale, are taken for clipped in 16-bit
// records too.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/stored_constants.h"
#include "calib/scaling.h"
#include "calib/still_blocks.h"
#include "gt3x/log/samples.h"

namespace sixpoint::repair {

// Turns stored axes back: firmware 1.6.0 stored x' = -y, y' = x; this gives x = y', y = -x'. A
// count at a limit of `width` becomes the other limit: the mirror image of the lowest would not
// fit.
void undo_rotation(std::span<gt3x::Counts> samples, calib::RecordWidth width);

// Different sets of constants in one recording. A unit writes one, or two where it was calibrated
// between; each costs a table, so what claims more is no recording that can be worked on.
inline constexpr std::size_t kMaxSetsOfConstants = 16;

class StillScan {
 public:
  // bad_data for a rate or a scale that cannot be. Without constants (a file that has none, or
  // whose counts are g already) the stored counts themselves are taken for raw ones.
  static Result<StillScan> make(double rate_hz, double accel_scale_lsb_per_g,
                                const calib::StillBlockOptions& options = {});

  // From here on the counts come from these constants; the same ones again change nothing. bad_data
  // for constants that Eq. 1-3 cannot be used with, and for one set more than kMaxSetsOfConstants.
  Status set_constants(const StoredConstants& constants);

  // From here on so many LSB make one g; the same again changes nothing. bad_data for a scale that
  // cannot be, and as set_constants().
  Status set_scale(double accel_scale_lsb_per_g);

  // One record's samples in the firmware's order of axes, right way round; X Y Z. In a file that
  // holds seconds twice or in a wrong order they lie still all the same, and what is still must be
  // seen, or a repair could not be judged:
  //
  //     the record's second, after the one before          the run
  //     the next one                                       goes on
  //     the same, or up to kNear_s earlier                 goes on: repeated, or out of order
  //     up to kNear_s later, and one of the last kNear_s   goes on
  //       records was such a one
  //     any other                                          ends: seconds are missing, or the clock
  //                                                        leapt
  void push(std::uint32_t unix_time, std::span<const gt3x::Counts> samples);
  static constexpr int kNear_s = 3;
  void break_run();
  // Holds for the blocks that end after it (.agdc).
  void set_temperature(std::optional<double> celsius);

  // From now on push() tells of every block that it finds and keeps, in order: its first sample, of
  // all that were pushed, and its number of samples. Blocks that are thinned out later were told
  // of all the same.
  using OnBlock = std::function<void(std::uint64_t first_sample, int samples)>;
  void on_block(OnBlock tell) { on_block_ = std::move(tell); }

  // Finishes. Blocks in order of time; mean_lsb are raw counts whatever constants were in force:
  // means of the recovered integers, or, where the file's counts cannot have come from integers
  // (plausibility() says so; seen in every real 30 Hz unit, whose firmware seems to average), the
  // straight line's inverse of the mean.
  std::vector<calib::StillBlock> finish();

  // Complete after finish().
  const calib::PlausibilityTally& plausibility() const { return plausibility_; }
  const calib::StillBlockTally& tally() const { return tally_; }

 private:
  StillScan(double rate_hz, double accel_scale, const calib::StillBlockOptions& options);
  Status start(const calib::Reversal& reversal);
  Status start_raw_counts();
  bool goes_on(std::uint32_t unix_time) const;
  Result<const calib::Reversal*> reversal_of(const StoredConstants& constants);
  void close_finder();
  void tell_of_blocks();
  void append(std::vector<calib::StillBlock> blocks);
  void thin();

  double rate_hz_;
  double accel_scale_;
  calib::StillBlockOptions options_;
  std::optional<StoredConstants> constants_;
  // By the constants that are undone; at fixed addresses, because the finder keeps a pointer.
  std::vector<std::pair<StoredConstants, std::unique_ptr<const calib::Reversal>>> reversals_;
  // Until constants are set: one for each scale.
  std::vector<std::unique_ptr<const calib::Reversal>> raw_counts_;
  const calib::Reversal* reversal_ = nullptr;  // of the finder
  std::optional<calib::StillBlockFinder> finder_;
  OnBlock on_block_;
  std::uint64_t told_to_ = 0;  // blocks that begin before this sample were told of
  std::optional<std::uint32_t> last_time_;
  int since_disorder_ = kNear_s;  // records since a second that was not later
  std::optional<double> temperature_c_;
  std::vector<calib::StillBlock> blocks_;
  // Which constants each block came by: those up to `end`, behind the ones before. Neighbours that
  // came by the same are one.
  struct Stretch {
    std::size_t end = 0;
    const calib::Reversal* reversal = nullptr;
  };
  std::vector<Stretch> stretches_;
  calib::PlausibilityTally plausibility_;
  calib::StillBlockTally tally_;
};

// How far the blocks' magnitudes are from 1 g, by the file's own scale.
struct MagnitudeError {
  std::size_t blocks = 0;
  double mean_mg = 0;   // mean of |magnitude - 1 g|
  double p95_mg = 0;    // its 95th percentile (nearest rank)
  double worst_mg = 0;  // its largest
};
MagnitudeError magnitude_error(std::span<const calib::StillBlock> blocks);

}  // namespace sixpoint::repair

// Still blocks: the stretches in which a sensor measures gravity and nothing else.
//
//   SIXPOINT_ASSIGN(auto finder, StillBlockFinder::make(reversal, 30.0));
//   finder.push(start_time_s, counts);  // again and again; break_run() at every gap
//   const std::vector<StillBlock> blocks = finder.finish();
//
// A block is "any 4-second long block of data" (paper, Step 2) in which, on calibrated g, the
// linear regression of every axis has a slope below 0.0005 g per sample, no sample lies 0.015 g or
// more from its line, and the unit was not charging. A block starts at the first sample where one
// fits and not on a fixed grid of 4 s: a stretch of 7.9 s then always gives a block, a grid only
// sometimes. After a block the search goes on behind it, so blocks never overlap and stay
// independent; after a failure it goes on half a second later (StillBlockOptions::step_s).
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "calib/scaling.h"
#include "calib/sums/count_sums.h"

namespace sixpoint::calib {

struct StillBlockOptions {
  double block_s = 4.0;                    // paper
  double max_slope_g_per_sample = 0.0005;  // paper, criterion 1
  double max_residual_g = 0.015;           // paper, criterion 2
  // Paper, criterion 3: its formula asks that no axis of any sample is zero, its reason (a charging
  // unit records zero on all axes) that not all three are. A level axis reads exactly 0 quite
  // often, so the formula throws away good data; false rejects all-zero samples only.
  bool strict_nonzero = false;
  // How far to move on after a failure. Half a second finds all but the last half second of what
  // any start would, at an eighth of a block.
  double step_s = 0.5;
  // The residual limit is three standard deviations of a sensor with 5 mg of noise, and a block of
  // 400 samples on three axes nearly always has one sample beyond that: at 100 Hz the letter of
  // criterion 2 refuses a noisy sensor lying on a rock. With this set, a block that fails only
  // criterion 2 is taken and marked `noisy` when its residuals are those of noise: standard
  // deviation below this, largest below 5 of them. Solvers take noisy blocks only where the others
  // do not suffice, and say so. 0 switches it off. 7 mg is the ADXL362's datasheet noise of its
  // worst axis (920 ug/sqrt(Hz)) in 50 Hz.
  double noisy_sd_g = 0.007;
  // Upper bound of memory: beyond it every second block is dropped and from then on only every
  // second one is taken (and so on). 20,000 blocks are 22 hours of stillness and 2.7 MB; between
  // 10,000 and 20,000 evenly taken ones say the same as all. A repair looks at a copy of them for a
  // moment, and its memory has to stay below 48 MB with everything else.
  std::size_t max_blocks = 20'000;
};

// A jump of more than this on any axis from one block to the next: the unit was moved. Under a
// chamber's fan (40 mg) means of 4 s scatter by 3.5 mg; 4 s of warming make 0.02 mg.
inline constexpr double kMoved_g = 0.015;

struct StillBlock {
  double start_time_s = 0;
  std::uint64_t first_sample = 0;  // of all that were pushed, gaps not counted
  int samples = 0;
  PerAxis<double> mean_g{};    // by the constants in the file
  PerAxis<double> mean_lsb{};  // of the recovered raw counts, which is what solvers work on
  // Standard deviation about the regression line, per sample, raw counts.
  PerAxis<double> sd_lsb{};
  // Slow rotation shortens the mean vector; this is what it takes from each axis' mean square:
  // variance of the regression line over the block, raw counts squared.
  PerAxis<double> ramp_variance_lsb2{};
  std::optional<double> temperature_c;
  double duration_s = 0;  // its samples over the rate
  bool noisy = false;     // fails criterion 2 of the paper, taken by StillBlockOptions::noisy_sd_g
};

// What the finder met, for reports.
struct StillBlockTally {
  std::uint64_t samples = 0;
  std::uint64_t runs = 0;
  std::uint64_t blocks = 0;            // found, dropped ones included
  std::uint64_t noisy_blocks = 0;      // of these
  std::uint64_t rejected_zero = 0;     // windows that failed for all-zero (or strict) samples only
  std::uint64_t rejected_clipped = 0;  // still windows with a sample at the record's limit
  std::uint64_t thinned = 1;           // one block in so many is stored
  PlausibilityTally plausibility;      // of all samples pushed
};

// One pass, memory bounded by a block and the blocks found. One object belongs to one thread.
class StillBlockFinder {
 public:
  // `reversal` must outlive the finder. bad_data for a rate outside 5 .. 1000 Hz, usage for options
  // that make no sense.
  static Result<StillBlockFinder> make(const Reversal& reversal, double rate_hz,
                                       const StillBlockOptions& options = {});

  // Samples of the current run, the first of them taken at start_time_s (any epoch). Consecutive
  // calls continue the run without a gap.
  void push(double start_time_s, std::span<const StoredCounts> stored);
  // The run ends here: a gap, an idle-sleep fill, a charging stretch. Blocks never span it.
  void break_run();
  // Holds for the blocks that end after it, until the next call.
  void set_temperature(std::optional<double> celsius) { temperature_c_ = celsius; }

  // The blocks, on the file's own evidence: recovered raw counts where its counts are plausible,
  // the affine map where they are not. Ends the run.
  std::vector<StillBlock> finish();

  // Valid at any time; complete after break_run().
  const std::vector<StillBlock>& blocks() const { return blocks_; }
  // The same, handed over; the finder has none then.
  std::vector<StillBlock> take_blocks() { return std::exchange(blocks_, {}); }
  const StillBlockTally& tally() const { return tally_; }

  // The regression line of one axis over a window, in counts.
  struct Line {
    double mean = 0;
    double slope = 0;  // per sample
  };

 private:
  // A candidate for a block, and what is found out about it.
  struct Window {
    PerAxis<std::span<const std::int16_t>> values{};
    PerAxis<std::int64_t> sums{};
    // The smallest and the largest of the values.
    PerAxis<std::int16_t> low{};
    PerAxis<std::int16_t> high{};
    PerAxis<Line> lines;
    PerAxis<double> largest_g{};  // residual
    PerAxis<double> sd{};         // about the line, counts; by find_noise()
    bool within_paper = true;
  };
  StillBlockFinder(const Reversal& reversal, double rate_hz, const StillBlockOptions& options);
  void make_cells();
  CountSums sums_of_cells(std::size_t axis, std::size_t first) const;
  Line line_by(const CountSums& sums) const;
  bool cannot_be_still(const Window& window, std::size_t axis, double widest_g) const;
  void search();
  bool take_block(std::size_t begin);
  bool fit_lines(std::size_t begin, Window& window) const;
  void find_noise(Window& window) const;
  bool is_noise(const Window& window) const;
  StillBlock measure(const Window& window) const;
  bool has_zeros(const Window& window) const;
  bool has_clipped(const Window& window) const;
  void keep(const StillBlock& block);

  const Reversal* reversal_;
  StillBlockOptions options_;
  double rate_hz_;
  int block_samples_;
  int step_samples_;
  double g_per_count_;
  PerAxis<std::vector<std::int16_t>> run_;  // the samples of the run that are not yet behind us
  std::size_t next_ = 0;                    // where the next window starts in run_
  // The sums of each step's samples, from which the windows that overlap them are put together,
  // where a block is a whole number of steps. Sums are exact, so a window has the same line
  // whatever way it is made.
  bool in_cells_ = false;
  PerAxis<std::vector<CountSums>> cells_;
  struct Mark {
    std::size_t index;  // into run_
    double time_s;
  };
  std::deque<Mark> marks_;
  std::vector<float> centred_;  // sample number minus the middle of the block
  double sum_square_index_ = 0;
  std::optional<double> temperature_c_;
  std::vector<StillBlock> blocks_;
  std::uint64_t since_kept_ = 0;
  StillBlockTally tally_;
  bool in_run_ = false;
};

// Replaces mean_lsb by the affine inverse of mean_g: for files whose counts cannot have come from
// their constants (StillBlockTally::plausibility), where candidates would be invented.
void use_affine_means(std::span<StillBlock> blocks, const Reversal& reversal);

}  // namespace sixpoint::calib

#include "calib/still_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "calib/sums/split_axes.h"

namespace sixpoint::calib {

namespace {

constexpr double kNoiseSigmas = 5;  // see StillBlockOptions::noisy_sd_g

// The sum of the raw counts behind `values`, which lie from `low` to `high` and whose sum is `sum`.
// Where those of neighbouring counts are equally far apart, as they are nearly everywhere, the sum
// of the counts says it; both ways are exact for halves of a count.
double raw_sum(const Reversal& reversal, std::size_t axis, std::span<const std::int16_t> values,
               std::int64_t sum, std::int16_t low, std::int16_t high) {
  const auto raw = [&](int count) {
    return reversal.raw_lsb(axis, static_cast<std::int16_t>(count));
  };
  const double step = low < high ? raw(low + 1) - raw(low) : 0;
  bool even = true;
  for (int count = low; count < high && even; ++count) {
    even = raw(count + 1) - raw(count) == step;
  }
  const auto number = static_cast<std::int64_t>(values.size());
  if (even) {
    return static_cast<double>(number) * raw(low) + step * static_cast<double>(sum - number * low);
  }
  double one_by_one = 0;
  for (const std::int16_t count : values) {
    one_by_one += raw(count);
  }
  return one_by_one;
}

}  // namespace

Result<StillBlockFinder> StillBlockFinder::make(const Reversal& reversal, double rate_hz,
                                                const StillBlockOptions& options) {
  if (!(rate_hz >= 5 && rate_hz <= 1000)) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("still periods are searched at sample rates of 5 to 1000 Hz, not at {:g} Hz",
                    rate_hz),
        "still blocks",
        "what it holds can be exported; where info.txt names a wrong rate, download the "
        "recording from the unit again");
  }
  if (!(options.block_s >= 1 && options.block_s <= 60) || !(options.step_s > 0) ||
      !(options.max_slope_g_per_sample > 0) || !(options.max_residual_g > 0) ||
      options.max_blocks < 2) {
    return fail(ErrorCode::usage, "the still-block criteria make no sense", "still blocks",
                "use the paper's: 4 s, 0.0005 g per sample, 0.015 g");
  }
  return StillBlockFinder(reversal, rate_hz, options);
}

StillBlockFinder::StillBlockFinder(const Reversal& reversal, double rate_hz,
                                   const StillBlockOptions& options)
    : reversal_(&reversal),
      options_(options),
      rate_hz_(rate_hz),
      block_samples_(static_cast<int>(std::lround(options.block_s * rate_hz))),
      step_samples_(std::max(1, static_cast<int>(std::lround(options.step_s * rate_hz)))),
      // Stored counts are calibrated: g is the count over accel_scale, whatever the constants.
      g_per_count_(1.0 / reversal.accel_scale_lsb_per_g()) {
  in_cells_ = block_samples_ % step_samples_ == 0;
  for (int i = 0; i < block_samples_; ++i) {
    const double centred = i - 0.5 * (block_samples_ - 1);
    centred_.push_back(static_cast<float>(centred));
    sum_square_index_ += centred * centred;
  }
}

void StillBlockFinder::push(double start_time_s, std::span<const StoredCounts> stored) {
  if (stored.empty()) {
    return;
  }
  if (!in_run_) {
    in_run_ = true;
    ++tally_.runs;
  }
  // Slices, so that one huge push needs no second copy of itself.
  constexpr std::size_t kSlice = 1U << 16;
  for (std::size_t begin = 0; begin < stored.size(); begin += kSlice) {
    const auto slice = stored.subspan(begin, std::min(kSlice, stored.size() - begin));
    marks_.push_back({run_[0].size(), start_time_s + static_cast<double>(begin) / rate_hz_});
    const std::size_t old_size = run_[0].size();
    PerAxis<std::int16_t*> out{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      run_[a].resize(old_size + slice.size());
      out[a] = run_[a].data() + old_size;
    }
    split_axes(slice, out[0], out[1], out[2]);
    tally_.samples += slice.size();
    calib::tally(*reversal_, slice, tally_.plausibility);
    search();
  }
}

std::vector<StillBlock> StillBlockFinder::finish() {
  break_run();
  if (!tally_.plausibility.plausible()) {
    use_affine_means(blocks_, *reversal_);
  }
  return blocks_;
}

void StillBlockFinder::break_run() {
  for (std::size_t a = 0; a < kAxes; ++a) {
    run_[a].clear();
    cells_[a].clear();
  }
  marks_.clear();
  next_ = 0;
  in_run_ = false;
}

void StillBlockFinder::make_cells() {
  const auto size = static_cast<std::size_t>(step_samples_);
  for (std::size_t a = 0; a < kAxes; ++a) {
    for (std::size_t begin = cells_[a].size() * size; begin + size <= run_[a].size();
         begin += size) {
      cells_[a].push_back(count_sums(std::span(run_[a]).subspan(begin, size)));
    }
  }
}

void StillBlockFinder::search() {
  const auto block = static_cast<std::size_t>(block_samples_);
  if (in_cells_) {
    make_cells();
  }
  while (next_ + block <= run_[0].size()) {
    next_ += take_block(next_) ? block : static_cast<std::size_t>(step_samples_);
  }
  // Drop what lies behind, seldom enough that the copying stays linear.
  constexpr std::size_t kBehind = 1U << 13;
  if (next_ > kBehind) {
    const std::size_t gone = std::min(next_, run_[0].size());
    const std::size_t cells_gone = gone / static_cast<std::size_t>(step_samples_);
    for (std::size_t a = 0; a < kAxes; ++a) {
      run_[a].erase(run_[a].begin(), run_[a].begin() + static_cast<std::ptrdiff_t>(gone));
      if (in_cells_) {
        cells_[a].erase(cells_[a].begin(),
                        cells_[a].begin() + static_cast<std::ptrdiff_t>(cells_gone));
      }
    }
    next_ -= gone;
    while (marks_.size() > 1 && marks_[1].index <= gone) {
      marks_.pop_front();
    }
    for (Mark& mark : marks_) {
      if (mark.index < gone) {
        mark.time_s += static_cast<double>(gone - mark.index) / rate_hz_;
        mark.index = 0;
      } else {
        mark.index -= gone;
      }
    }
  }
}

bool StillBlockFinder::take_block(std::size_t begin) {
  Window window;
  for (std::size_t a = 0; a < kAxes; ++a) {
    window.values[a] = std::span(run_[a]).subspan(begin, static_cast<std::size_t>(block_samples_));
  }
  if (!fit_lines(begin, window)) {
    return false;
  }
  find_noise(window);
  if (!window.within_paper && !is_noise(window)) {
    return false;
  }
  if (has_zeros(window)) {
    ++tally_.rejected_zero;
    return false;
  }
  if (has_clipped(window)) {
    ++tally_.rejected_clipped;
    return false;
  }
  ++tally_.blocks;
  tally_.noisy_blocks += window.within_paper ? 0 : 1;
  if (since_kept_++ % tally_.thinned != 0) {
    return true;
  }
  StillBlock block = measure(window);
  block.noisy = !window.within_paper;
  const auto after =
      std::upper_bound(marks_.begin(), marks_.end(), begin,
                       [](std::size_t index, const Mark& mark) { return index < mark.index; });
  const Mark& mark = after == marks_.begin() ? *after : *std::prev(after);
  block.start_time_s =
      mark.time_s + (static_cast<double>(begin) - static_cast<double>(mark.index)) / rate_hz_;
  block.first_sample = tally_.samples - run_[0].size() + begin;
  block.samples = block_samples_;
  block.temperature_c = temperature_c_;
  keep(block);
  return true;
}

StillBlockFinder::Line StillBlockFinder::line_by(const CountSums& sums) const {
  // Doubled, the centred sample numbers are whole.
  const std::int64_t doubled = 2 * sums.moment - (block_samples_ - 1) * sums.sum;
  return {static_cast<double>(sums.sum) / block_samples_,
          0.5 * static_cast<double>(doubled) / sum_square_index_};
}

CountSums StillBlockFinder::sums_of_cells(std::size_t axis, std::size_t first) const {
  CountSums all = cells_[axis][first];
  const int count = block_samples_ / step_samples_;
  for (int i = 1; i < count; ++i) {
    const CountSums& cell = cells_[axis][first + static_cast<std::size_t>(i)];
    all.sum += cell.sum;
    all.moment += cell.moment + static_cast<std::int64_t>(i) * step_samples_ * cell.sum;
    all.low = std::min(all.low, cell.low);
    all.high = std::max(all.high, cell.high);
  }
  return all;
}

// Values that spread this far have a residual of `widest_g` whatever line they lie about: half of
// the spread that the line's own rise does not explain. A count more, for the rounding of the
// residuals themselves (single precision).
bool StillBlockFinder::cannot_be_still(const Window& window, std::size_t axis,
                                       double widest_g) const {
  const double spread = static_cast<double>(window.high[axis]) - window.low[axis];
  const double rise = std::abs(window.lines[axis].slope) * (block_samples_ - 1);
  return g_per_count_ * ((spread - rise) / 2 - 1) >= widest_g;
}

// Criteria 1 and 2. False where the window cannot be a block, noisy or not.
bool StillBlockFinder::fit_lines(std::size_t begin, Window& window) const {
  for (std::size_t a = 0; a < kAxes; ++a) {
    const CountSums sums = in_cells_
                               ? sums_of_cells(a, begin / static_cast<std::size_t>(step_samples_))
                               : count_sums(window.values[a]);
    window.lines[a] = line_by(sums);
    window.sums[a] = sums.sum;
    window.low[a] = sums.low;
    window.high[a] = sums.high;
    if (std::abs(window.lines[a].slope) * g_per_count_ >= options_.max_slope_g_per_sample) {
      return false;
    }
  }
  const double widest = std::max(options_.max_residual_g, kNoiseSigmas * options_.noisy_sd_g);
  const double limit_g = options_.noisy_sd_g > 0 ? widest : options_.max_residual_g;
  for (std::size_t a = 0; a < kAxes; ++a) {
    if (cannot_be_still(window, a, limit_g)) {
      return false;
    }
  }
  for (std::size_t a = 0; a < kAxes; ++a) {
    // Values within this spread have no larger residual from their line. A tenth of a count more,
    // for the rounding of the residuals themselves (single precision).
    const Line& line = window.lines[a];
    const double farthest = std::max(window.high[a] - line.mean, line.mean - window.low[a]);
    const double rise = std::abs(line.slope) * (block_samples_ - 1);
    double largest_g = g_per_count_ * (farthest + rise / 2 + 0.1);
    if (largest_g >= options_.max_residual_g) {
      largest_g = g_per_count_ * static_cast<double>(largest_residual(
                                     window.values[a], centred_, static_cast<float>(line.mean),
                                     static_cast<float>(line.slope)));
    }
    window.largest_g[a] = largest_g;
    window.within_paper = window.within_paper && largest_g < options_.max_residual_g;
    if (!window.within_paper && (options_.noisy_sd_g <= 0 || largest_g >= widest)) {
      return false;
    }
  }
  return true;
}

// The spread about the lines, from sums that are exact up to the last subtraction.
void StillBlockFinder::find_noise(Window& window) const {
  for (std::size_t a = 0; a < kAxes; ++a) {
    const std::int64_t spread =
        block_samples_ * sum_of_squares(window.values[a]) - window.sums[a] * window.sums[a];
    const double slope = window.lines[a].slope;
    const double about_line =
        static_cast<double>(spread) / block_samples_ - slope * slope * sum_square_index_;
    window.sd[a] = std::sqrt(std::max(0.0, about_line) / (block_samples_ - 2));
  }
}

StillBlock StillBlockFinder::measure(const Window& window) const {
  StillBlock block;
  block.duration_s = block_samples_ / rate_hz_;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double raw_per_count = g_per_count_ / reversal_->calibration().sensitivity_g_per_lsb[a];
    block.mean_g[a] = window.lines[a].mean * g_per_count_;
    block.mean_lsb[a] =
        raw_sum(*reversal_, a, window.values[a], window.sums[a], window.low[a], window.high[a]) /
        block_samples_;
    block.sd_lsb[a] = window.sd[a] * raw_per_count;
    const double slope_lsb = window.lines[a].slope * raw_per_count;
    block.ramp_variance_lsb2[a] = slope_lsb * slope_lsb * sum_square_index_ / block_samples_;
  }
  return block;
}

// Noise and nothing else: as small as a sensor's, and no sample far out of it.
bool StillBlockFinder::is_noise(const Window& window) const {
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double sd_g = window.sd[a] * g_per_count_;
    if (sd_g >= options_.noisy_sd_g || (window.largest_g[a] >= options_.max_residual_g &&
                                        window.largest_g[a] >= kNoiseSigmas * sd_g)) {
      return false;
    }
  }
  return true;
}

// Criterion 3.
bool StillBlockFinder::has_zeros(const Window& window) const {
  const auto may_be_zero = [&](std::size_t a) { return window.low[a] <= 0 && window.high[a] >= 0; };
  if (options_.strict_nonzero ? !may_be_zero(0) && !may_be_zero(1) && !may_be_zero(2)
                              : !may_be_zero(0) || !may_be_zero(1) || !may_be_zero(2)) {
    return false;
  }
  const auto& [x, y, z] = window.values;
  for (std::size_t i = 0; i < centred_.size(); ++i) {
    if (options_.strict_nonzero ? x[i] == 0 || y[i] == 0 || z[i] == 0
                                : x[i] == 0 && y[i] == 0 && z[i] == 0) {
      return true;
    }
  }
  return false;
}

bool StillBlockFinder::has_clipped(const Window& window) const {
  for (std::size_t a = 0; a < kAxes; ++a) {
    if (reversal_->clipped(window.low[a]) || reversal_->clipped(window.high[a])) {
      return true;
    }
  }
  return false;
}

void StillBlockFinder::keep(const StillBlock& block) {
  if (blocks_.size() >= options_.max_blocks) {
    std::size_t out = 0;
    for (std::size_t i = 0; i < blocks_.size(); i += 2) {
      blocks_[out++] = blocks_[i];
    }
    blocks_.resize(out);
    tally_.thinned *= 2;
  }
  if (blocks_.empty()) {
    // At once: a vector that grows holds its blocks twice. Memory is only used where blocks are.
    blocks_.reserve(options_.max_blocks);
  }
  blocks_.push_back(block);
}

void use_affine_means(std::span<StillBlock> blocks, const Reversal& reversal) {
  for (StillBlock& block : blocks) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      block.mean_lsb[a] =
          reversal.affine_raw_lsb(a, block.mean_g[a] * reversal.accel_scale_lsb_per_g());
    }
  }
}

}  // namespace sixpoint::calib

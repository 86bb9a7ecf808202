#include "calib/still_blocks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace sixpoint::calib {

namespace {

struct Line {
  double mean = 0;
  double slope = 0;
};

// Sums of values and of values times the centred sample number. Both are exact: doubled centred
// numbers and counts are integers below 2^53. Chunks keep the inner loops in 32 bits, where the
// compiler vectorises them.
Line fit_line(const std::int16_t* values, int size, double sum_square_index) {
  std::int64_t sum = 0;
  std::int64_t moment = 0;
  constexpr int kChunk = 32;
  for (int begin = 0; begin < size; begin += kChunk) {
    const int end = std::min(size, begin + kChunk);
    std::int32_t chunk_sum = 0;
    std::int32_t chunk_moment = 0;
    for (int i = begin; i < end; ++i) {
      const std::int32_t value = values[i];
      chunk_sum += value;
      chunk_moment += value * static_cast<std::int16_t>(i - begin);
    }
    sum += chunk_sum;
    moment += 2 * static_cast<std::int64_t>(chunk_moment) + (2LL * begin - (size - 1)) * chunk_sum;
  }
  return {static_cast<double>(sum) / size, 0.5 * static_cast<double>(moment) / sum_square_index};
}

float largest_residual(const std::int16_t* values, const float* centred, int size, float mean,
                       float slope) {
  float largest = 0;
  for (int i = 0; i < size; ++i) {
    const float residual = std::abs(static_cast<float>(values[i]) - (mean + slope * centred[i]));
    largest = residual > largest ? residual : largest;
  }
  return largest;
}

}  // namespace

Result<StillBlockFinder> StillBlockFinder::make(const Reversal& reversal, double rate_hz,
                                                const StillBlockOptions& options) {
  if (!(rate_hz >= 5 && rate_hz <= 1000)) {
    return fail(ErrorCode::bad_data, fmt::format("a sample rate of {} Hz is impossible", rate_hz),
                "still blocks", "the recording's info.txt is damaged");
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
      step_samples_(std::max(1, static_cast<int>(std::lround(options.step_s * rate_hz)))) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    // Stored counts are calibrated: g is the count over accel_scale, whatever the constants.
    g_per_count_[a] = 1.0 / reversal.accel_scale_lsb_per_g();
  }
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
  tally_.samples += stored.size();
  // Slices, so that one huge push needs no second copy of itself.
  constexpr std::size_t kSlice = 1U << 16;
  for (std::size_t begin = 0; begin < stored.size(); begin += kSlice) {
    const auto slice = stored.subspan(begin, std::min(kSlice, stored.size() - begin));
    marks_.push_back({run_[0].size(), start_time_s + static_cast<double>(begin) / rate_hz_});
    const std::size_t old_size = run_[0].size();
    for (std::size_t a = 0; a < kAxes; ++a) {
      run_[a].resize(old_size + slice.size());
      std::int16_t* out = run_[a].data() + old_size;
      for (std::size_t i = 0; i < slice.size(); ++i) {
        out[i] = slice[i][a];
      }
    }
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
  for (auto& axis : run_) {
    axis.clear();
  }
  marks_.clear();
  next_ = 0;
  in_run_ = false;
}

void StillBlockFinder::search() {
  const auto block = static_cast<std::size_t>(block_samples_);
  while (next_ + block <= run_[0].size()) {
    next_ += take_block(next_) ? block : static_cast<std::size_t>(step_samples_);
  }
  // Drop what lies behind, seldom enough that the copying stays linear.
  constexpr std::size_t kBehind = 1U << 13;
  if (next_ > kBehind) {
    const std::size_t gone = std::min(next_, run_[0].size());
    for (auto& axis : run_) {
      axis.erase(axis.begin(), axis.begin() + static_cast<std::ptrdiff_t>(gone));
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
  PerAxis<const std::int16_t*> values{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    values[a] = run_[a].data() + begin;
  }
  PerAxis<Line> lines;
  for (std::size_t a = 0; a < kAxes; ++a) {
    lines[a] = fit_line(values[a], block_samples_, sum_square_index_);
    if (std::abs(lines[a].slope) * g_per_count_[a] >= options_.max_slope_g_per_sample) {
      return false;
    }
  }
  bool within_paper = true;
  const double widest = std::max(options_.max_residual_g, 5 * options_.noisy_sd_g);
  PerAxis<double> largest{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    largest[a] = g_per_count_[a] *
                 static_cast<double>(largest_residual(values[a], centred_.data(), block_samples_,
                                                      static_cast<float>(lines[a].mean),
                                                      static_cast<float>(lines[a].slope)));
    within_paper = within_paper && largest[a] < options_.max_residual_g;
    if (!within_paper && (options_.noisy_sd_g <= 0 || largest[a] >= widest)) {
      return false;
    }
  }

  const auto size = static_cast<std::size_t>(block_samples_);
  bool zeros = false;
  bool clipped = false;
  for (std::size_t i = 0; i < size; ++i) {
    const bool x = values[0][i] == 0;
    const bool y = values[1][i] == 0;
    const bool z = values[2][i] == 0;
    zeros = zeros || (options_.strict_nonzero ? (x || y || z) : (x && y && z));
    clipped = clipped || reversal_->clipped(values[0][i]) || reversal_->clipped(values[1][i]) ||
              reversal_->clipped(values[2][i]);
  }

  StillBlock block;
  PerAxis<double> sd_g{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    double sum_raw = 0;
    double square = 0;
    for (std::size_t i = 0; i < size; ++i) {
      sum_raw += reversal_->raw_lsb(a, values[a][i]);
      const double residual =
          values[a][i] - (lines[a].mean + lines[a].slope * static_cast<double>(centred_[i]));
      square += residual * residual;
    }
    const double sd = std::sqrt(square / (block_samples_ - 2));
    sd_g[a] = sd * g_per_count_[a];
    const double raw_per_count =
        g_per_count_[a] / reversal_->calibration().sensitivity_g_per_lsb[a];
    block.mean_g[a] = lines[a].mean * g_per_count_[a];
    block.mean_lsb[a] = sum_raw / block_samples_;
    block.sd_lsb[a] = sd * raw_per_count;
    const double slope_lsb = lines[a].slope * raw_per_count;
    block.ramp_variance_lsb2[a] = slope_lsb * slope_lsb * sum_square_index_ / block_samples_;
  }
  if (!within_paper) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      // Noise and nothing else: as small as a sensor's, and no sample far out of it.
      if (sd_g[a] >= options_.noisy_sd_g ||
          (largest[a] >= options_.max_residual_g && largest[a] >= 5 * sd_g[a])) {
        return false;
      }
    }
    block.noisy = true;
  }
  if (zeros) {
    ++tally_.rejected_zero;
    return false;
  }
  if (clipped) {
    ++tally_.rejected_clipped;
    return false;
  }

  const auto after =
      std::upper_bound(marks_.begin(), marks_.end(), begin,
                       [](std::size_t index, const Mark& mark) { return index < mark.index; });
  const Mark& mark = after == marks_.begin() ? *after : *std::prev(after);
  block.start_time_s =
      mark.time_s + (static_cast<double>(begin) - static_cast<double>(mark.index)) / rate_hz_;
  block.samples = block_samples_;
  block.temperature_c = temperature_c_;
  keep(block);
  return true;
}

void StillBlockFinder::keep(StillBlock block) {
  ++tally_.blocks;
  tally_.noisy_blocks += block.noisy ? 1 : 0;
  if (since_kept_++ % tally_.thinned != 0) {
    return;
  }
  if (blocks_.size() >= options_.max_blocks) {
    std::size_t out = 0;
    for (std::size_t i = 0; i < blocks_.size(); i += 2) {
      blocks_[out++] = blocks_[i];
    }
    blocks_.resize(out);
    tally_.thinned *= 2;
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

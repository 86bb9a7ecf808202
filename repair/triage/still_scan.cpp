#include "repair/triage/still_scan.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include <fmt/format.h>

namespace sixpoint::repair {

void undo_rotation(std::span<gt3x::Counts> samples, calib::RecordWidth width) {
  const int low = calib::lowest_count(width);
  const int high = calib::highest_count(width);
  for (gt3x::Counts& sample : samples) {
    const int stored_x = sample[0];
    sample[0] = sample[1];
    sample[1] = static_cast<std::int16_t>(stored_x <= low    ? high
                                          : stored_x >= high ? low
                                                             : -stored_x);
  }
}

StillScan::StillScan(double rate_hz, double accel_scale, const calib::StillBlockOptions& options)
    : rate_hz_(rate_hz), accel_scale_(accel_scale), options_(options) {}

Result<StillScan> StillScan::make(double rate_hz, double accel_scale_lsb_per_g,
                                  const calib::StillBlockOptions& options) {
  StillScan scan(rate_hz, accel_scale_lsb_per_g, options);
  SIXPOINT_CHECK(scan.start_raw_counts());
  return scan;
}

Status StillScan::start_raw_counts() {
  for (const auto& known : raw_counts_) {
    if (known->accel_scale_lsb_per_g() == accel_scale_) {
      return start(*known);
    }
  }
  if (raw_counts_.size() == kMaxSetsOfConstants) {
    return fail(ErrorCode::bad_data,
                fmt::format("the recording holds more than {} different acceleration scales",
                            kMaxSetsOfConstants),
                {}, "no unit changes them so often; download the recording from the unit again");
  }
  SIXPOINT_ASSIGN(auto made,
                  calib::Reversal::of_raw_counts(accel_scale_, calib::RecordWidth::bits12));
  raw_counts_.push_back(std::make_unique<const calib::Reversal>(std::move(made)));
  return start(*raw_counts_.back());
}

Status StillScan::start(const calib::Reversal& reversal) {
  close_finder();
  reversal_ = &reversal;
  SIXPOINT_ASSIGN(finder_, calib::StillBlockFinder::make(reversal, rate_hz_, options_));
  finder_->set_temperature(temperature_c_);
  return {};
}

Result<const calib::Reversal*> StillScan::reversal_of(const StoredConstants& constants) {
  for (const auto& [known, reversal] : reversals_) {
    if (known == constants && reversal->accel_scale_lsb_per_g() == accel_scale_) {
      return reversal.get();
    }
  }
  if (reversals_.size() == kMaxSetsOfConstants) {
    return fail(ErrorCode::bad_data,
                fmt::format("the recording holds more than {} different sets of constants",
                            kMaxSetsOfConstants),
                {}, "no unit changes them so often; download the recording from the unit again");
  }
  SIXPOINT_ASSIGN(auto made,
                  calib::Reversal::make(constants, accel_scale_, calib::RecordWidth::bits12));
  reversals_.emplace_back(constants, std::make_unique<const calib::Reversal>(std::move(made)));
  return reversals_.back().second.get();
}

Status StillScan::set_constants(const StoredConstants& constants) {
  if (constants_ == constants) {
    return {};
  }
  SIXPOINT_ASSIGN(const calib::Reversal* reversal, reversal_of(constants));
  SIXPOINT_CHECK(start(*reversal));
  constants_ = constants;
  return {};
}

Status StillScan::set_scale(double accel_scale_lsb_per_g) {
  if (accel_scale_ == accel_scale_lsb_per_g) {
    return {};
  }
  accel_scale_ = accel_scale_lsb_per_g;
  if (!constants_) {
    return start_raw_counts();
  }
  return set_constants(*std::exchange(constants_, std::nullopt));
}

bool StillScan::goes_on(std::uint32_t unix_time) const {
  const std::int64_t step = std::int64_t{unix_time} - std::int64_t{*last_time_};
  return step == 1 || (std::abs(step) <= kNear_s && (step < 1 || since_disorder_ < kNear_s));
}

void StillScan::push(std::uint32_t unix_time, std::span<const gt3x::Counts> samples) {
  if (last_time_.has_value()) {
    if (!goes_on(unix_time)) {
      break_run();
    }
    since_disorder_ = last_time_ && unix_time <= *last_time_ ? 0 : since_disorder_ + 1;
  }
  last_time_ = unix_time;
  finder_->push(unix_time, samples);
  if (on_block_) {
    tell_of_blocks();
  }
}

void StillScan::tell_of_blocks() {
  const std::vector<calib::StillBlock>& blocks = finder_->blocks();
  const std::uint64_t before = tally_.samples;  // of the finders before
  auto first = blocks.end();
  while (first != blocks.begin() && before + std::prev(first)->first_sample >= told_to_) {
    --first;
  }
  for (; first != blocks.end(); ++first) {
    on_block_(before + first->first_sample, first->samples);
    told_to_ = before + first->first_sample + 1;
  }
}

void StillScan::break_run() {
  finder_->break_run();
  last_time_.reset();
  since_disorder_ = kNear_s;
}

void StillScan::set_temperature(std::optional<double> celsius) {
  temperature_c_ = celsius;
  finder_->set_temperature(celsius);
}

void StillScan::close_finder() {
  if (!finder_.has_value()) {
    return;
  }
  break_run();
  append(finder_->take_blocks());
  const calib::StillBlockTally& tally = finder_->tally();
  plausibility_.counts += tally.plausibility.counts;
  plausibility_.impossible += tally.plausibility.impossible;
  tally_.samples += tally.samples;
  tally_.runs += tally.runs;
  tally_.blocks += tally.blocks;
  tally_.noisy_blocks += tally.noisy_blocks;
  tally_.rejected_zero += tally.rejected_zero;
  tally_.rejected_clipped += tally.rejected_clipped;
  tally_.thinned = std::max(tally_.thinned, tally.thinned);
  finder_.reset();
}

void StillScan::append(std::vector<calib::StillBlock> blocks) {
  if (blocks.empty()) {
    return;
  }
  for (calib::StillBlock& block : blocks) {
    block.first_sample += tally_.samples;  // of the finders before
  }
  if (blocks_.empty()) {
    blocks_ = std::move(blocks);
  } else {
    blocks_.insert(blocks_.end(), blocks.begin(), blocks.end());
  }
  if (stretches_.empty() || stretches_.back().reversal != reversal_) {
    stretches_.push_back({0, reversal_});
  }
  stretches_.back().end = blocks_.size();
  while (blocks_.size() > options_.max_blocks) {
    thin();
  }
}

// Every second block goes, as in the finder.
void StillScan::thin() {
  std::erase_if(blocks_,
                [at = std::size_t{0}](const calib::StillBlock&) mutable { return at++ % 2 == 1; });
  for (Stretch& stretch : stretches_) {
    stretch.end = (stretch.end + 1) / 2;
  }
  // Sets that take turns leave many stretches without a block.
  std::size_t begin = 0;
  std::erase_if(stretches_, [&](const Stretch& stretch) {
    return std::exchange(begin, stretch.end) == stretch.end;
  });
  tally_.thinned *= 2;
}

std::vector<calib::StillBlock> StillScan::finish() {
  close_finder();
  if (!plausibility_.plausible()) {
    std::size_t begin = 0;
    for (const Stretch& stretch : stretches_) {
      const calib::Calibration& undone = stretch.reversal->calibration();
      for (; begin < stretch.end; ++begin) {
        for (std::size_t a = 0; a < kAxes; ++a) {
          blocks_[begin].mean_lsb[a] =
              undone.zero_lsb[a] + blocks_[begin].mean_g[a] / undone.sensitivity_g_per_lsb[a];
        }
      }
    }
  }
  return std::move(blocks_);
}

MagnitudeError magnitude_error(std::span<const calib::StillBlock> blocks) {
  MagnitudeError result;
  result.blocks = blocks.size();
  if (blocks.empty()) {
    return result;
  }
  std::vector<double> errors_mg;
  errors_mg.reserve(blocks.size());
  for (const calib::StillBlock& block : blocks) {
    const double magnitude_g = std::hypot(block.mean_g[0], block.mean_g[1], block.mean_g[2]);
    errors_mg.push_back(kMgPerG * std::abs(magnitude_g - 1));
  }
  std::sort(errors_mg.begin(), errors_mg.end());
  result.mean_mg = std::accumulate(errors_mg.begin(), errors_mg.end(), 0.0) /
                   static_cast<double>(errors_mg.size());
  const auto rank =
      static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(errors_mg.size())));
  result.p95_mg = errors_mg[rank - 1];
  result.worst_mg = errors_mg.back();
  return result;
}

}  // namespace sixpoint::repair

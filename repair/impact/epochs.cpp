#include "repair/impact/epochs.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gt3x/forms/sample_rate.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::repair {
namespace {

constexpr std::uint32_t kLongestFill_s = 3600;

using Sample = PerAxis<double>;  // g

// Epochs without a hole between them: one run of the recording.
class Run {
 public:
  Run(std::uint32_t start, std::size_t rate, const EpochOptions& options, bool has_counts)
      : start_(start), rate_(rate), options_(options) {
    if (has_counts) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        counters_.emplace_back(static_cast<int>(rate), options.epoch_s, options.filter);
      }
    }
  }

  // Of the second that follows; `recorded` of the samples were recorded, the others fill it up.
  void push_second(const std::vector<Sample>& samples, std::size_t recorded,
                   std::vector<Epoch>& epochs) {
    for (std::size_t i = 0; i < rate_; ++i) {
      const Sample& sample = samples[std::min(i, samples.size() - 1)];
      if (i < recorded) {
        recorded_.push_back(sample);
      }
      for (std::size_t a = 0; a < counters_.size(); ++a) {
        if (const auto count = counters_[a].push(sample[a])) {
          counts_[a] = *count;
        }
      }
    }
    ++seconds_;
    if (seconds_ % static_cast<std::uint32_t>(options_.epoch_s) == 0) {
      end_epoch(epochs);
    }
  }

  std::uint32_t next_second() const { return start_ + seconds_; }

 private:
  void end_epoch(std::vector<Epoch>& epochs) {
    if (!recorded_.empty()) {
      Epoch epoch = measured();
      epoch.unix_time = next_second() - static_cast<std::uint32_t>(options_.epoch_s);
      epoch.counts = counts_;
      epochs.push_back(epoch);
    }
    recorded_.clear();
    counts_ = {};
  }

  Epoch measured() const {
    Epoch epoch;
    epoch.samples = static_cast<std::uint32_t>(recorded_.size());
    const auto count = static_cast<double>(recorded_.size());
    double mean_g = 0;
    Sample mean_direction{};
    for (const Sample& sample : recorded_) {
      const double r = magnitude_g(sample);
      mean_g += r / count;
      for (std::size_t a = 0; a < kAxes; ++a) {
        mean_direction[a] += direction(sample, r, a) / count;
      }
    }
    for (const Sample& sample : recorded_) {
      const double r = magnitude_g(sample);
      epoch.enmo_mg += kMgPerG * std::max(0.0, r - 1) / count;
      epoch.mad_mg += kMgPerG * std::abs(r - mean_g) / count;
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double along = direction(sample, r, a);
        epoch.enmo_per_error[a] += r > 1 ? along / count : 0;
        epoch.mad_per_error[a] += (r > mean_g ? 1 : -1) * (along - mean_direction[a]) / count;
      }
    }
    return epoch;
  }

  static double magnitude_g(const Sample& sample) {
    return std::hypot(sample[0], sample[1], sample[2]);
  }
  static double direction(const Sample& sample, double r, std::size_t axis) {
    return r > 0 ? sample[axis] / r : 0;
  }

  std::uint32_t start_;
  std::size_t rate_;
  EpochOptions options_;
  std::vector<ActivityCounts> counters_;
  std::uint32_t seconds_ = 0;
  std::vector<Sample> recorded_;
  PerAxis<int> counts_{};
};

tl::unexpected<Error> bad(std::string what, const std::string& path, std::string hint) {
  return fail(ErrorCode::bad_data, std::move(what), path, std::move(hint));
}

}  // namespace

Result<EpochSeries> epochs_of(gt3x::Recording& recording, const EpochOptions& options) {
  if (options.epoch_s < 1 || options.epoch_s > 3600) {
    return fail(ErrorCode::usage, fmt::format("an epoch of {} s is impossible", options.epoch_s),
                {}, "give whole seconds from 1 to 3600");
  }
  const std::string& path = recording.path();
  EpochSeries series;
  series.path = path;
  series.epoch_s = options.epoch_s;
  SIXPOINT_ASSIGN(series.rate_hz, gt3x::usable_sample_rate_hz(recording.info(), path, 1000));
  series.has_counts = ActivityCounts::knows(series.rate_hz);
  const auto rate = static_cast<std::size_t>(std::lround(series.rate_hz));
  std::optional<Run> run;
  std::vector<Sample> samples;
  const bool raw_counts = gt3x::holds_raw_counts(recording, series.rate_hz);  // of ACTIVITY3
  gt3x::SampleReader reader(recording);
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind != gt3x::SampleItem::Kind::recorded || item->counts.empty() ||
        (run && item->unix_time < run->next_second())) {
      continue;
    }
    if (item->type == gt3x::RecordType::activity3 && raw_counts) {
      return bad("the recording holds raw counts, not g", path, "give .gt3x recordings");
    }
    const auto scale = gt3x::accel_scale_lsb_per_g(recording.info(), item->parameters);
    if (!scale) {
      return bad("the recording does not say how many LSB make one g", path,
                 "check that this is a recording of a known unit");
    }
    if (run && item->unix_time - run->next_second() <= kLongestFill_s) {
      while (run->next_second() < item->unix_time) {
        samples.assign(1, samples.back());
        run->push_second(samples, 0, series.epochs);
      }
    } else {
      run.emplace(item->unix_time, rate, options, series.has_counts);
    }
    samples.clear();
    for (const gt3x::Counts& counts : item->counts.first(std::min(item->counts.size(), rate))) {
      samples.push_back({counts[0] / *scale, counts[1] / *scale, counts[2] / *scale});
    }
    run->push_second(samples, samples.size(), series.epochs);
    if (series.epochs.size() > kMostEpochs) {
      return bad(fmt::format("the recording has more than {} epochs", kMostEpochs), path,
                 "take longer epochs");
    }
  }
  if (series.epochs.empty()) {
    return bad("the recording holds no whole epoch", path,
               "check that the unit was started; take shorter epochs");
  }
  return series;
}

}  // namespace sixpoint::repair

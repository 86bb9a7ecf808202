#include "repair/impact/epochs.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <fmt/format.h>

#include "gt3x/forms/sample_rate.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::repair {
namespace {

// Seconds of one value behind which the counts' filter is at rest: the slowest part of it falls to a
// third in a second.
constexpr std::int64_t kAtRest_s = 60;

using Sample = PerAxis<double>;  // g

// Epochs without a hole between them: one run of the recording.
class Run {
 public:
  // The first epoch begins at `start`, Unix time. Before 1970 where the first sample is of the
  // first seconds of 1970.
  Run(std::int64_t start, std::size_t rate, const EpochOptions& options, bool has_counts)
      : start_(start), rate_(rate), options_(options) {
    if (has_counts) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        counters_.emplace_back(static_cast<int>(rate), options.epoch_s, options.filter);
      }
    }
  }

  // Of the second that follows; `recorded` of the samples were recorded, the others fill it up.
  void push_second(std::span<const Sample> samples, std::size_t recorded,
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
    if (seconds_ % options_.epoch_s == 0) {
      end_epoch(epochs);
    }
  }

  // So many seconds follow in which nothing was recorded.
  void fill(std::int64_t seconds, const Sample& sample, std::vector<Epoch>& epochs) {
    for (std::int64_t done = 0; done < seconds; ++done) {
      if (done >= kAtRest_s && seconds_ % options_.epoch_s == 0) {
        const std::int64_t nothing = (seconds - done) / options_.epoch_s * options_.epoch_s;
        seconds_ += nothing;
        done += nothing;
        if (done == seconds) {
          break;
        }
      }
      push_second({&sample, 1}, 0, epochs);
    }
  }

  // What was recorded of the epoch that is not whole yet is one, too.
  void end(const Sample& sample, std::vector<Epoch>& epochs) {
    if (!recorded_.empty()) {
      fill(options_.epoch_s - seconds_ % options_.epoch_s, sample, epochs);
    }
  }

 private:
  void end_epoch(std::vector<Epoch>& epochs) {
    if (!recorded_.empty()) {
      Epoch epoch = measured();
      epoch.unix_time = static_cast<std::uint32_t>(
          std::max<std::int64_t>(0, start_ + seconds_ - options_.epoch_s));
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

  std::int64_t start_;
  std::size_t rate_;
  EpochOptions options_;
  std::vector<ActivityCounts> counters_;
  std::int64_t seconds_ = 0;
  std::vector<Sample> recorded_;
  PerAxis<int> counts_{};
};

// The last beginning of an epoch up to `unix_time`; one of them is `first`.
std::int64_t epoch_before(std::int64_t unix_time, std::int64_t first, int epoch_s) {
  const std::int64_t within = (unix_time - first) % epoch_s;
  return unix_time - (within < 0 ? within + epoch_s : within);
}

// Adds what another run has of the same epoch.
void add(Epoch& epoch, const Epoch& other) {
  const double all = epoch.samples + other.samples;
  const double before = epoch.samples / all;
  const double share = other.samples / all;
  epoch.samples += other.samples;
  epoch.enmo_mg = before * epoch.enmo_mg + share * other.enmo_mg;
  epoch.mad_mg = before * epoch.mad_mg + share * other.mad_mg;
  for (std::size_t a = 0; a < kAxes; ++a) {
    epoch.enmo_per_error[a] = before * epoch.enmo_per_error[a] + share * other.enmo_per_error[a];
    epoch.mad_per_error[a] = before * epoch.mad_per_error[a] + share * other.mad_per_error[a];
    epoch.counts[a] += other.counts[a];
  }
}

// In order of time, each once, also where the clock was set back.
void put_in_order(std::vector<Epoch>& epochs) {
  if (std::ranges::adjacent_find(epochs, std::ranges::greater_equal(), &Epoch::unix_time) ==
      epochs.end()) {
    return;
  }
  std::ranges::sort(epochs, {}, &Epoch::unix_time);
  std::size_t kept = 0;
  for (std::size_t i = 1; i < epochs.size(); ++i) {
    if (epochs[i].unix_time == epochs[kept].unix_time) {
      add(epochs[kept], epochs[i]);
    } else {
      epochs[++kept] = epochs[i];
    }
  }
  epochs.resize(kept + 1);
}

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
  std::optional<std::uint32_t> first_second;
  std::vector<Sample> samples;
  const bool raw_counts = gt3x::holds_raw_counts(recording, series.rate_hz);  // of ACTIVITY3
  Sample filler{};  // of missing seconds, as in the vendor's CSV
  gt3x::SampleReader reader(recording);
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    const bool recorded = item->kind == gt3x::SampleItem::Kind::recorded;
    if (run && (item->broke_order || (!recorded && !item->filled))) {
      run->end(filler, series.epochs);
      run.reset();
    }
    if (!recorded) {
      if (item->kind == gt3x::SampleItem::Kind::usb || item->gap == gt3x::GapKind::usb) {
        filler = {};
      }
      if (run) {
        run->fill(item->seconds, filler, series.epochs);
      }
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
    samples.clear();
    for (const gt3x::Counts& counts : item->counts.first(std::min(item->counts.size(), rate))) {
      samples.push_back({counts[0] / *scale, counts[1] / *scale, counts[2] / *scale});
    }
    if (!run) {
      first_second = first_second.value_or(item->unix_time);
      const auto start = epoch_before(item->unix_time, *first_second, options.epoch_s);
      run.emplace(start, rate, options, series.has_counts);
      run->fill(item->unix_time - start, samples.front(), series.epochs);
    }
    run->push_second(samples, samples.size(), series.epochs);
    filler = samples.back();
    if (series.epochs.size() > kMostEpochs) {
      return bad(fmt::format("the recording has more than {} epochs", kMostEpochs), path,
                 "take longer epochs");
    }
  }
  if (series.epochs.empty()) {
    return bad("the recording holds no whole epoch", path,
               "check that the unit was started; take shorter epochs");
  }
  put_in_order(series.epochs);
  return series;
}

}  // namespace sixpoint::repair

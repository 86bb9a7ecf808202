#include "gap/features/timing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <queue>
#include <span>

namespace sixpoint::gap {
namespace {

constexpr double kUniformSd_s = kHostStamp_s / std::numbers::sqrt3;

struct Stamp {
  std::size_t sample;
  double nominal_s;   // since the segment's start, by the nominal rate
  double residual_s;  // host's less nominal
};
using Stamps = std::vector<Stamp>;  // of one segment, three and more

std::vector<Stamps> stamps_by_segment(const Bundle& bundle) {
  std::vector<Stamps> all;
  const auto& index = bundle.host_clock.sample_index;
  std::size_t at = 0;
  for (const Segment& segment : bundle.segments) {
    Stamps stamps;
    while (at < index.size() && index[at] < segment.first_sample) {
      ++at;
    }
    for (; at < index.size() && index[at] < segment.first_sample + segment.samples; ++at) {
      const double nominal_s =
          static_cast<double>(index[at] - segment.first_sample) / bundle.rate_hz;
      stamps.push_back({index[at], nominal_s,
                        bundle.host_clock.host_time_s[at] - segment.host_start_s - nominal_s});
    }
    if (stamps.size() >= 3) {
      all.push_back(std::move(stamps));
    }
  }
  return all;
}

struct CoarseRate {
  double slope = 0;      // host seconds per nominal second, less 1
  bool jittery = false;  // the stamps scatter by more than the host's error
};

// The rate before slips are known: each difference of stamps is an angle on the circle of one
// sample interval, on which a slip is a whole turn. Packets of about a second only, so that the
// circle means the same for all.
CoarseRate rate_on_circle(const std::vector<Stamps>& segments, double interval_s) {
  // The mean of the angles has this share of the length that two uniform stamps give it.
  constexpr double kJitteryShare = 0.93;
  std::complex<double> sum = 0;
  double pairs = 0;
  for (const Stamps& stamps : segments) {
    for (std::size_t i = 0; i + 1 < stamps.size(); ++i) {
      const double dt = stamps[i + 1].nominal_s - stamps[i].nominal_s;
      if (dt > 0.5 && dt < 1.5) {
        pairs += 1;
        sum += std::polar(
            1.0, 2 * M_PI * (stamps[i + 1].residual_s - stamps[i].residual_s) / interval_s);
      }
    }
  }
  // Two uniform stamps: the square of a sinc, and two sd of it by chance.
  const double width = 2 * M_PI * kHostStamp_s / interval_s;
  const double uniform = std::pow(std::sin(width) / width, 2);
  return {std::arg(sum) / (2 * M_PI) * interval_s,
          pairs > 0 && std::abs(sum) / pairs < kJitteryShare * uniform - 2 / std::sqrt(2 * pairs)};
}

// Residuals less those of a clock of this rate.
std::vector<double> levels(const Stamps& stamps, double slope) {
  std::vector<double> level;
  level.reserve(stamps.size());
  for (const Stamp& s : stamps) {
    level.push_back(s.residual_s - slope * s.nominal_s);
  }
  return level;
}

// Slips in whole samples before each stamp, positive where samples were lost. A median of three: a
// late stamp comes and goes, a slip stays. The clock's rate is off the levels before: with it the
// median would cut what a slip is against the clock.
std::vector<double> clear_slips(const Stamps& stamps, double slope, double interval_s) {
  const std::vector<double> level = levels(stamps, slope);
  const auto median = [&](std::size_t i) {
    if (i == 0 || i + 1 == level.size()) {
      return level[i];
    }
    const auto [low, high] = std::minmax(level[i - 1], level[i + 1]);
    return std::clamp(level[i], low, high);
  };
  std::vector<double> slips(level.size(), 0);
  for (std::size_t i = 1; i < level.size(); ++i) {
    slips[i] = std::round((median(i) - median(i - 1)) / interval_s);
  }
  return slips;
}

constexpr std::size_t kAveraged = 5;  // stamps on either side of a slip, where stamps are jittery

// Mean of up to five values from `at` on, less that of as many before it.
double step_at(std::span<const double> level, std::size_t at) {
  const std::size_t before = std::min(at, kAveraged);
  const std::size_t behind = std::min(level.size() - at, kAveraged);
  double step = 0;
  for (std::size_t k = 0; k < before; ++k) {
    step -= level[at - 1 - k] / static_cast<double>(before);
  }
  for (std::size_t k = 0; k < behind; ++k) {
    step += level[at + k] / static_cast<double>(behind);
  }
  return step;
}

// Slips where stamps are jittery. A slip that is taken out changes the steps of its neighbours only:
// the work grows with the number of stamps and slips, not with their product.
class JitterySlips {
 public:
  JitterySlips(const Stamps& stamps, double slope, double interval_s)
      : interval_s_(interval_s),
        level_(levels(stamps, slope)),
        steps_(stamps.size(), 0),
        slips_(stamps.size(), 0) {
    look(level_, 0, 0, level_.size());
  }

  // The largest first, the earlier of two alike.
  std::vector<double> run() {
    for (std::size_t round = 0; round < slips_.size() && !queue_.empty();) {
      const Candidate largest = queue_.top();
      queue_.pop();
      if (largest.size == std::abs(steps_[largest.at])) {
        slips_[largest.at] += std::round(steps_[largest.at] / interval_s_);
        look_about(largest.at);
        ++round;
      }
    }
    return slips_;
  }

 private:
  struct Candidate {
    double size;
    std::size_t at;
    bool operator<(const Candidate& o) const { return size != o.size ? size < o.size : at > o.at; }
  };

  // The steps at [from, to), of levels from the stamp `first` on. What is in the queue and is the step
  // no more is old.
  void look(std::span<const double> level, std::size_t first, std::size_t from, std::size_t to) {
    constexpr std::size_t kLeast = 3;   // stamps on either side
    constexpr double kInterval = 0.75;  // half of one happens by chance in thousands of stamps
    for (std::size_t i = std::max(from, kLeast); i < to && i + kLeast <= slips_.size(); ++i) {
      steps_[i] = step_at(level, i - first);
      if (std::abs(steps_[i]) > kInterval * interval_s_) {
        queue_.push({std::abs(steps_[i]), i});
      }
    }
  }

  void look_about(std::size_t at) {
    const std::size_t first = at - std::min(at, 2 * kAveraged);
    const std::size_t end = std::min(level_.size(), at + 2 * kAveraged);
    std::vector<double> level;
    double shift = 0;
    for (std::size_t i = first; i < end; ++i) {
      shift += slips_[i] * interval_s_;
      level.push_back(level_[i] - shift);
    }
    look(level, first, at - std::min(at, kAveraged), std::min(end, at + kAveraged));
  }

  double interval_s_;
  std::vector<double> level_;  // with all slips
  std::vector<double> steps_;  // without those that were found
  std::vector<double> slips_;
  std::priority_queue<Candidate> queue_;
};

std::vector<double> slips_of(const Stamps& stamps, const CoarseRate& rate, double interval_s) {
  return rate.jittery ? JitterySlips(stamps, rate.slope, interval_s).run()
                      : clear_slips(stamps, rate.slope, interval_s);
}

double count_slips(const std::vector<Stamps>& segments, const CoarseRate& rate, double interval_s) {
  double total = 0;
  for (const Stamps& stamps : segments) {
    const std::vector<double> slips = slips_of(stamps, rate, interval_s);
    for (std::size_t i = 1; i < slips.size(); ++i) {
      total += std::abs(slips[i]);
    }
  }
  return total;
}

void take_out_slips(std::vector<Stamps>& segments, double interval_s, HostTiming& timing) {
  constexpr double kMostSlip = 1e6;         // more than any second holds: stamps may say anything
  constexpr double kLargestError = 0.0065;  // of a clock: beyond the catalogue's 5000 ppm
  CoarseRate rate = rate_on_circle(segments, interval_s);
  // Near half an interval a second the circle is ambiguous: the fewer slips the better.
  CoarseRate other = rate;
  other.slope += rate.slope > 0 ? -interval_s : interval_s;
  if (std::abs(other.slope) < kLargestError &&
      count_slips(segments, other, interval_s) < count_slips(segments, rate, interval_s)) {
    rate = other;
  }
  // By the host: where a clock is 4000 ppm off and slips every other second at 100 Hz, nominal
  // intervals leave 20 ppm.
  const double host_interval_s = interval_s * (1 + rate.slope);
  for (Stamps& stamps : segments) {
    const std::vector<double> slips = slips_of(stamps, rate, interval_s);
    double shift_s = 0;
    for (std::size_t i = 1; i < stamps.size(); ++i) {
      shift_s += slips[i] * host_interval_s;
      stamps[i].residual_s -= shift_s;
      const int lost = static_cast<int>(std::clamp(slips[i], -kMostSlip, kMostSlip));
      (lost > 0 ? timing.lost : timing.repeated) += static_cast<std::size_t>(std::abs(lost));
      if (lost != 0) {
        timing.slips.push_back({stamps[i - 1].sample, stamps[i].sample, lost});
      }
    }
  }
}

// Sums of a straight line through the origin.
struct Line {
  double xx = 0, xy = 0;
  double slope() const { return xx > 0 ? xy / xx : 0; }
};

// Log likelihood of the slope of `unseen` as `seen` predicts it, over a slope of zero.
double held_out_nats(const Line& seen, const Line& unseen) {
  const double variance = kUniformSd_s * kUniformSd_s / unseen.xx;
  const double slope = unseen.slope();
  return 0.5 * (slope * slope - std::pow(slope - seen.slope(), 2)) / variance;
}

// Of the stamps about lines of this slope, one for each segment.
double squares_about(const std::vector<Stamps>& segments, double fitted) {
  double squares = 0;
  for (const Stamps& stamps : segments) {
    double mean = 0;
    for (const Stamp& s : stamps) {
      mean += s.residual_s - fitted * s.nominal_s;
    }
    mean /= static_cast<double>(stamps.size());
    for (const Stamp& s : stamps) {
      const double r = s.residual_s - fitted * s.nominal_s - mean;
      squares += r * r;
    }
  }
  return squares;
}

}  // namespace

HostTiming host_timing(const Bundle& bundle) {
  HostTiming timing;
  auto segments = stamps_by_segment(bundle);
  timing.usable = !segments.empty();
  if (!timing.usable) {
    return timing;
  }
  const double interval_s = 1 / bundle.rate_hz;
  timing.slips_visible = interval_s > 4 * kHostStamp_s;
  if (timing.slips_visible) {
    take_out_slips(segments, interval_s, timing);
  }
  Line all;
  std::array<Line, 2> half;
  std::size_t count = 0;
  for (std::size_t segment = 0; segment < segments.size(); ++segment) {
    const Stamps& stamps = segments[segment];
    double mean_t = 0;
    double mean_r = 0;
    for (const Stamp& s : stamps) {
      mean_t += s.nominal_s;
      mean_r += s.residual_s;
    }
    mean_t /= static_cast<double>(stamps.size());
    mean_r /= static_cast<double>(stamps.size());
    for (const Stamp& s : stamps) {
      for (Line* line : {&all, &half[segment % 2]}) {
        line->xx += (s.nominal_s - mean_t) * (s.nominal_s - mean_t);
        line->xy += (s.nominal_s - mean_t) * (s.residual_s - mean_r);
      }
    }
    count += stamps.size();
    timing.packets += stamps.size() - 1;
    timing.samples += static_cast<std::size_t>(
        (stamps.back().nominal_s - stamps.front().nominal_s) * bundle.rate_hz);
  }
  if (half[0].xx > 0 && half[1].xx > 0) {
    timing.clock_held_out_nats = held_out_nats(half[0], half[1]) + held_out_nats(half[1], half[0]);
  }
  const double fitted = all.slope();
  const double freedom = std::max(1.0, static_cast<double>(count - segments.size() - 1));
  timing.clock_ppm = 1e6 * (1 / (1 + fitted) - 1);
  timing.scatter_ms = 1e3 * std::sqrt(squares_about(segments, fitted) / freedom);
  timing.clock_sd_ppm =
      all.xx > 0 ? 1e6 * std::max(kUniformSd_s, timing.scatter_ms / 1e3) / std::sqrt(all.xx) : 1e6;
  return timing;
}

void mark_slips(const HostTiming& timing, CleanSamples& clean) {
  clean.slips = timing.slips;
  for (const ClockSlip& slip : clean.slips) {
    for (std::size_t i = slip.first; i < slip.last; ++i) {
      clean.wrapped_samples -= (clean.flags[i] & kSampleWrapped) != 0 ? 1 : 0;
      clean.flags[i] |= kSampleSlipped;
    }
  }
}

}  // namespace sixpoint::gap

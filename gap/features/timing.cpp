#include "gap/features/timing.h"

#include <algorithm>
#include <cmath>
#include <complex>

namespace sixpoint::gap {
namespace {

struct Stamp {
  double nominal_s;   // since the segment's start, by the nominal rate
  double residual_s;  // host's less nominal
};

std::vector<std::vector<Stamp>> stamps_by_segment(const Bundle& bundle) {
  std::vector<std::vector<Stamp>> all;
  const auto& index = bundle.host_clock.sample_index;
  std::size_t at = 0;
  for (const Segment& segment : bundle.segments) {
    std::vector<Stamp> stamps;
    while (at < index.size() && index[at] < segment.first_sample) {
      ++at;
    }
    for (; at < index.size() && index[at] < segment.first_sample + segment.samples; ++at) {
      const double nominal_s =
          static_cast<double>(index[at] - segment.first_sample) / bundle.rate_hz;
      stamps.push_back(
          {nominal_s, bundle.host_clock.host_time_s[at] - segment.host_start_s - nominal_s});
    }
    if (stamps.size() >= 3) {
      all.push_back(std::move(stamps));
    }
  }
  return all;
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

  // The rate first, blind to slips: each difference of stamps as an angle on the circle of one
  // sample interval. Packets of about a second only, so that the circle means the same for all.
  bool jittery = false;
  double slope = 0;  // host seconds per nominal second, less 1
  if (timing.slips_visible) {
    std::complex<double> sum = 0;
    double pairs = 0;
    for (const auto& stamps : segments) {
      for (std::size_t i = 0; i + 1 < stamps.size(); ++i) {
        const double dt = stamps[i + 1].nominal_s - stamps[i].nominal_s;
        if (dt > 0.5 && dt < 1.5) {
          pairs += 1;
          sum += std::polar(
              1.0, 2 * M_PI * (stamps[i + 1].residual_s - stamps[i].residual_s) / interval_s);
        }
      }
    }
    slope = std::arg(sum) / (2 * M_PI) * interval_s;
    // How narrow the angles are: two uniform stamps give the square of a sinc, jitter less.
    const double width = 2 * M_PI * kHostStamp_s / interval_s;
    jittery = pairs > 0 && std::abs(sum) / pairs < 0.93 * std::pow(std::sin(width) / width, 2) -
                                                       2 / std::sqrt(2 * pairs);
  }
  // Where stamps are jittery, neighbours of a slip are averaged, and three quarters of an interval
  // are asked for: half of one happens by chance in a recording of thousands of stamps.
  const auto jittery_steps = [&](const std::vector<Stamp>& stamps, double rate_error) {
    constexpr std::size_t kLeast = 3;
    constexpr std::size_t kMost = 5;
    std::vector<double> level;
    level.reserve(stamps.size());
    for (const Stamp& s : stamps) {
      level.push_back(s.residual_s - rate_error * s.nominal_s);
    }
    std::vector<double> steps(stamps.size(), 0);
    for (std::size_t round = 0; round < stamps.size(); ++round) {
      std::size_t at = 0;
      double most = 0.75 * interval_s;
      double height = 0;
      for (std::size_t i = kLeast; i + kLeast <= level.size(); ++i) {
        const std::size_t before = std::min(i, kMost);
        const std::size_t behind = std::min(level.size() - i, kMost);
        double difference = 0;
        for (std::size_t k = 0; k < before; ++k) {
          difference -= level[i - 1 - k] / static_cast<double>(before);
        }
        for (std::size_t k = 0; k < behind; ++k) {
          difference += level[i + k] / static_cast<double>(behind);
        }
        if (std::abs(difference) > most) {
          most = std::abs(difference);
          at = i;
          height = std::round(difference / interval_s);
        }
      }
      if (at == 0) {
        break;
      }
      steps[at] += height;
      for (std::size_t i = at; i < level.size(); ++i) {
        level[i] -= height * interval_s;
      }
    }
    return steps;
  };
  const auto slips_with = [&](double rate_error, bool apply) {
    double total = 0;
    for (auto& stamps : segments) {
      // A median of three: one late stamp goes and comes back, a slip stays.
      std::vector<double> level(stamps.size());
      for (std::size_t i = 0; i < stamps.size(); ++i) {
        level[i] = stamps[i].residual_s;
        if (i > 0 && i + 1 < stamps.size()) {
          const double a = stamps[i - 1].residual_s;
          const double b = stamps[i + 1].residual_s;
          level[i] = std::max(std::min(a, b), std::min(std::max(a, b), level[i]));
        }
      }
      std::vector<double> steps(stamps.size(), 0);
      if (jittery) {
        steps = jittery_steps(stamps, rate_error);
      } else {
        for (std::size_t i = 1; i < stamps.size(); ++i) {
          const double dt = stamps[i].nominal_s - stamps[i - 1].nominal_s;
          steps[i] = std::round((level[i] - level[i - 1] - rate_error * dt) / interval_s);
        }
      }
      double shift = 0;
      for (std::size_t i = 1; i < stamps.size(); ++i) {
        total += std::abs(steps[i]);
        if (apply) {
          shift += steps[i] * interval_s;
          stamps[i].residual_s -= shift;
          (steps[i] > 0 ? timing.lost : timing.repeated) +=
              static_cast<std::size_t>(std::abs(steps[i]));
        }
      }
    }
    return total;
  };
  if (timing.slips_visible) {
    // Near half an interval a second the circle is ambiguous: the fewer slips the better.
    const double other = slope > 0 ? slope - interval_s : slope + interval_s;
    if (std::abs(other) < 0.0065 && slips_with(other, false) < slips_with(slope, false)) {
      slope = other;
    }
    slips_with(slope, true);
  }
  double sxx = 0;
  double sxy = 0;
  std::size_t count = 0;
  std::array<double, 2> half_xx{};
  std::array<double, 2> half_xy{};
  std::size_t segment_number = 0;
  for (const auto& stamps : segments) {
    const std::size_t half = segment_number++ % 2;
    double mean_t = 0;
    double mean_r = 0;
    for (const Stamp& s : stamps) {
      mean_t += s.nominal_s;
      mean_r += s.residual_s;
    }
    mean_t /= static_cast<double>(stamps.size());
    mean_r /= static_cast<double>(stamps.size());
    for (const Stamp& s : stamps) {
      sxx += (s.nominal_s - mean_t) * (s.nominal_s - mean_t);
      sxy += (s.nominal_s - mean_t) * (s.residual_s - mean_r);
      half_xx[half] += (s.nominal_s - mean_t) * (s.nominal_s - mean_t);
      half_xy[half] += (s.nominal_s - mean_t) * (s.residual_s - mean_r);
    }
    count += stamps.size();
    timing.packets += stamps.size() - 1;
    timing.samples += static_cast<std::size_t>(
        (stamps.back().nominal_s - stamps.front().nominal_s) * bundle.rate_hz);
  }
  const double fitted = sxx > 0 ? sxy / sxx : 0;
  double squares = 0;
  for (const auto& stamps : segments) {
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
  const auto freedom = static_cast<double>(count - segments.size() - 1);
  const double uniform_sd = kHostStamp_s / std::sqrt(3.0);
  if (half_xx[0] > 0 && half_xx[1] > 0) {
    for (std::size_t half = 0; half < 2; ++half) {
      const double seen = half_xy[half] / half_xx[half];
      const double unseen = half_xy[1 - half] / half_xx[1 - half];
      const double variance = uniform_sd * uniform_sd / half_xx[1 - half];
      timing.clock_held_out_nats +=
          0.5 * (unseen * unseen - (unseen - seen) * (unseen - seen)) / variance;
    }
  }
  timing.clock_ppm = 1e6 * (1 / (1 + fitted) - 1);
  timing.scatter_ms = 1e3 * std::sqrt(squares / std::max(1.0, freedom));
  timing.clock_sd_ppm =
      sxx > 0 ? 1e6 * std::max(uniform_sd, timing.scatter_ms / 1e3) / std::sqrt(sxx) : 1e6;
  // The variance of a uniform law's square is 0.8 of its own squared; the rms' is a quarter of
  // that.
  timing.scatter_sd_ms = 1e3 * uniform_sd * std::sqrt(0.8 / std::max(1.0, freedom)) / 2;
  return timing;
}

}  // namespace sixpoint::gap

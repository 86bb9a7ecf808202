// The magnitudes of one recording on a grid of equal steps: what two recordings are compared by.
//
//   SIXPOINT_ASSIGN(const Trace trace, Trace::load(env.files, "a.gt3x"));
//   trace.at(trace.start_s() + 0.5);   // g, half a second after the start
//
// Held in memory, 4 bytes a sample: for recordings of hours, up to kMaxTraceSamples samples.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/result.h"
#include "gt3x/forms/clock.h"

namespace sixpoint::repair {

inline constexpr std::uint64_t kMaxTraceSamples = 40'000'000;

// The samples of one recording on a grid of equal steps; steps without a sample are missing.
class Trace {
 public:
  // As gt3x::Recording and SampleReader have it; bad_data also for a recording without samples,
  // without a rate or a scale, longer than kMaxTraceSamples from the earliest sample to the latest,
  // or of raw counts (.agdc).
  static Result<Trace> load(FileSystem& files, const std::string& path);
  // From g values at a fixed rate, for tests and for data from elsewhere. The grid begins at
  // start_s and holds one step per element; a magnitude that is not finite is a missing sample.
  static Trace from_magnitudes(std::string name, double start_s, double rate_hz,
                               std::vector<float> magnitudes_g);

  const std::string& name() const { return name_; }
  double rate_hz() const { return rate_hz_; }
  double start_s() const { return start_s_; }          // Unix time of step 0
  const gt3x::Clock& clock() const { return clock_; }  // of these times; not known by default
  double end_s() const { return start_s_ + static_cast<double>(magnitude_g_.size()) / rate_hz_; }
  std::size_t size() const { return magnitude_g_.size(); }
  float magnitude_g(std::size_t i) const { return magnitude_g_[i]; }  // NaN where missing
  // Cubic between samples; NaN where one of the four about it is missing.
  double at(double time_s) const;

 private:
  std::string name_;
  double start_s_ = 0;
  gt3x::Clock clock_;
  double rate_hz_ = 1;
  std::vector<float> magnitude_g_;
};

// Mean and standard deviation of values that come one by one.
class Moments {
 public:
  void add(double value) {
    ++count_;
    sum_ += value;
    square_ += value * value;
  }
  std::size_t count() const { return count_; }
  double mean() const { return sum_ / static_cast<double>(count_); }
  double sd() const {
    return std::sqrt(std::max(0.0, square_ / static_cast<double>(count_) - mean() * mean()));
  }

 private:
  std::size_t count_ = 0;
  double sum_ = 0;
  double square_ = 0;
};

// What a second of magnitudes amounts to.
struct Second {
  float smallest_g = std::numeric_limits<float>::quiet_NaN();
  float largest_g = std::numeric_limits<float>::quiet_NaN();
  float sd_g = std::numeric_limits<float>::quiet_NaN();
};

// Of the samples of a second whose first is the one nearest to from_s, Unix time; NaN where fewer
// than half are there.
Second second_at(const Trace& trace, double from_s);

}  // namespace sixpoint::repair

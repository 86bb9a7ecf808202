#include "repair/compare/trace.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gt3x/forms/sample_rate.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::repair {

constexpr float kMissing = std::numeric_limits<float>::quiet_NaN();

Result<Trace> Trace::load(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  Trace trace;
  trace.name_ = path;
  SIXPOINT_ASSIGN(trace.rate_hz_, gt3x::usable_sample_rate_hz(recording.info(), path));
  const auto rate = static_cast<std::uint64_t>(std::lround(trace.rate_hz_));
  std::optional<std::uint32_t> start;
  const bool raw_counts = gt3x::holds_raw_counts(recording, trace.rate_hz_);  // of ACTIVITY3
  gt3x::SampleReader reader(recording);
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind != gt3x::SampleItem::Kind::recorded) {
      continue;
    }
    if (item->type == gt3x::RecordType::activity3 && raw_counts) {
      return fail(ErrorCode::bad_data, "the recording holds raw counts, not g", path,
                  "compare .gt3x recordings");
    }
    const auto scale = gt3x::accel_scale_lsb_per_g(recording.info(), item->parameters);
    if (!scale) {
      return fail(ErrorCode::bad_data, "the recording does not say how many LSB make one g", path,
                  "check that this is a recording of a known unit");
    }
    if (!start) {
      start = item->unix_time;
    }
    // It begins before the first step: the clock was set back.
    const std::uint64_t earlier_s = std::max(*start, item->unix_time) - item->unix_time;
    std::uint64_t first = (std::max(*start, item->unix_time) - *start) * rate;
    const std::uint64_t count = std::min<std::uint64_t>(item->counts.size(), rate);
    const std::uint64_t size = trace.magnitude_g_.size();
    if (std::max(earlier_s * rate + size, first + count) > kMaxTraceSamples) {
      return fail(ErrorCode::bad_data,
                  fmt::format("the recording, from its earliest sample to its latest, is longer "
                              "than {} samples",
                              kMaxTraceSamples),
                  path,
                  "compare recordings of hours, not of weeks; inspect says where its clock leaps");
    }
    if (earlier_s > 0) {
      // With room for as much again: it may be set back second by second.
      const std::uint64_t spare_s = std::min<std::uint64_t>(
          {item->unix_time, size / rate, (kMaxTraceSamples - size) / rate - earlier_s});
      trace.magnitude_g_.insert(trace.magnitude_g_.begin(), (spare_s + earlier_s) * rate, kMissing);
      start = static_cast<std::uint32_t>(item->unix_time - spare_s);
      first = spare_s * rate;
    }
    if (trace.magnitude_g_.size() < first + count) {  // not where the clock leapt back
      trace.magnitude_g_.resize(first + count, kMissing);
    }
    for (std::size_t i = 0; i < count; ++i) {
      double square = 0;
      for (const std::int16_t value : item->counts[i]) {
        square += static_cast<double>(value) * value;
      }
      trace.magnitude_g_[first + i] = static_cast<float>(std::sqrt(square) / *scale);
    }
  }
  trace.clock_ = reader.clock();
  if (!start) {
    return fail(ErrorCode::bad_data, "the recording holds no samples", path,
                "check that the unit was started; download the recording again");
  }
  const auto recorded = std::ranges::find_if_not(
      trace.magnitude_g_, [](float magnitude_g) { return std::isnan(magnitude_g); });
  const std::uint64_t spare_s =
      static_cast<std::uint64_t>(recorded - trace.magnitude_g_.begin()) / rate;
  trace.magnitude_g_.erase(
      trace.magnitude_g_.begin(),
      trace.magnitude_g_.begin() + static_cast<std::ptrdiff_t>(spare_s * rate));
  trace.start_s_ = static_cast<double>(*start) + static_cast<double>(spare_s);
  return trace;
}

Trace Trace::from_magnitudes(std::string name, double start_s, double rate_hz,
                             std::vector<float> magnitudes_g) {
  Trace trace;
  trace.name_ = std::move(name);
  trace.start_s_ = start_s;
  trace.rate_hz_ = rate_hz;
  trace.magnitude_g_ = std::move(magnitudes_g);
  return trace;
}

double Trace::at(double time_s) const {
  const double place = (time_s - start_s_) * rate_hz_;
  const double floor = std::floor(place);
  if (!(floor >= 1) || floor + 2 >= static_cast<double>(magnitude_g_.size())) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  // Catmull-Rom.
  const auto i = static_cast<std::size_t>(floor);
  const double u = place - floor;
  const double p0 = magnitude_g_[i - 1];
  const double p1 = magnitude_g_[i];
  const double p2 = magnitude_g_[i + 1];
  const double p3 = magnitude_g_[i + 2];
  return p1 +
         0.5 * u * (p2 - p0 + u * (2 * p0 - 5 * p1 + 4 * p2 - p3 + u * (3 * (p1 - p2) + p3 - p0)));
}

Second second_at(const Trace& trace, double from_s) {
  const double first = std::round((from_s - trace.start_s()) * trace.rate_hz());
  const auto count = static_cast<std::size_t>(std::lround(trace.rate_hz()));
  Second second;
  if (first < 0 || first + static_cast<double>(count) > static_cast<double>(trace.size())) {
    return second;
  }
  const auto begin = static_cast<std::size_t>(first);
  Moments present;
  float smallest = std::numeric_limits<float>::max();
  float largest = 0;
  for (std::size_t i = begin; i < begin + count; ++i) {
    const float value = trace.magnitude_g(i);
    if (std::isnan(value)) {
      continue;
    }
    present.add(value);
    smallest = std::min(smallest, value);
    largest = std::max(largest, value);
  }
  if (2 * present.count() < count || present.count() == 0) {
    return second;
  }
  second.smallest_g = smallest;
  second.largest_g = largest;
  second.sd_g = static_cast<float>(present.sd());
  return second;
}

}  // namespace sixpoint::repair

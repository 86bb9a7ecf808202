#include "repair/compare/compare.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "base/time.h"
#include "repair/compare/align.h"

namespace sixpoint::repair {
namespace {

// Of the absolute values.
double size_percentile(const std::vector<float>& errors, std::size_t percent) {
  std::vector<float> sizes;
  sizes.reserve(errors.size());
  for (const float error : errors) {
    sizes.push_back(std::abs(error));
  }
  const auto at = sizes.begin() + static_cast<std::ptrdiff_t>((sizes.size() - 1) * percent / 100);
  std::ranges::nth_element(sizes, at);
  return static_cast<double>(*at);
}

Histogram histogram_of(const std::vector<float>& errors_mg, std::size_t bins) {
  Histogram histogram;
  if (errors_mg.empty() || bins == 0) {
    return histogram;
  }
  // A round width that shows 99 of 100 errors, with a fifth to spare.
  const double width =
      std::max(1.0, std::ceil(2.4 * size_percentile(errors_mg, 99) / static_cast<double>(bins)));
  const double first = -width * static_cast<double>(bins) / 2;
  for (std::size_t i = 0; i <= bins; ++i) {
    histogram.edges_mg.push_back(first + width * static_cast<double>(i));
  }
  histogram.counts.assign(bins, 0);
  for (const float error : errors_mg) {
    const double bin = std::floor((static_cast<double>(error) - first) / width);
    ++histogram
          .counts[static_cast<std::size_t>(std::clamp(bin, 0.0, static_cast<double>(bins - 1)))];
  }
  return histogram;
}

}  // namespace

Result<PairComparison> compare(const Trace& a, const Trace& b, const CompareOptions& options) {
  PairComparison result;
  result.a = a.name();
  result.b = b.name();
  result.clock = a.clock();
  const Line line = align(a, b, options, result);
  result.lag_s = line.lag_s;
  result.lag_at_s = line.middle_s;
  result.drift_ppm = line.slope * 1e6;

  double square_mg2 = 0;
  std::uint64_t samples = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double time_s = a.start_s() + static_cast<double>(i) / a.rate_hz();
    const double difference = b.at(time_s + line.at(time_s)) - a.magnitude_g(i);
    if (!std::isnan(difference)) {
      square_mg2 += difference * difference * kMgPerG * kMgPerG;
      ++samples;
    }
  }
  if (samples == 0) {
    return fail(ErrorCode::bad_data, "the two recordings have no moment in common",
                a.name() + ", " + b.name(), "compare recordings of units that ran together");
  }
  result.overlap_s = static_cast<double>(samples) / a.rate_hz();
  result.rms_mg = std::sqrt(square_mg2 / static_cast<double>(samples));

  std::vector<float> errors_mg;
  Moments errors;
  for (double t = a.start_s(); t + 1 <= a.end_s(); t += 1) {
    const Second mine = second_at(a, t);
    const Second theirs = second_at(b, t + line.at(t));
    if (std::isnan(mine.sd_g) || std::isnan(theirs.sd_g)) {
      continue;
    }
    for (const float error :
         {theirs.largest_g - mine.largest_g, theirs.smallest_g - mine.smallest_g}) {
      const double error_mg = static_cast<double>(error) * kMgPerG;
      errors_mg.push_back(static_cast<float>(error_mg));
      errors.add(error_mg);
    }
  }
  result.envelope.errors = errors_mg.size();
  if (!errors_mg.empty()) {
    result.envelope.mean_mg = errors.mean();
    result.envelope.sd_mg = errors.sd();
    result.histogram = histogram_of(errors_mg, options.histogram_bins);
    result.envelope.p95_mg = size_percentile(errors_mg, 95);
  }
  return result;
}

double PairComparison::shown_lag_s() const { return std::round(lag_s * 1e4) / 1e4 + 0.0; }

std::string PairComparison::brief() const {
  return fmt::format(
      "{} and {}: lag {:.4f} s{}, RMS {:.1f} mg, envelopes {:+.1f} mg (sd {:.1f}, 95 % within "
      "{:.1f}) over {:.0f} s",
      a, b, shown_lag_s(), aligned ? "" : " (not aligned)", rms_mg, envelope.mean_mg,
      envelope.sd_mg, envelope.p95_mg, overlap_s);
}

nlohmann::ordered_json PairComparison::to_json() const {
  return {{"a", a},
          {"b", b},
          {"lag_s", lag_s},
          {"lag_at", gt3x::clock_time(
                         clock, UtcTime(std::chrono::milliseconds(std::llround(lag_at_s * 1e3))))},
          {"lag_uncertainty_s", lag_uncertainty_s},
          {"drift_ppm", drift_ppm},
          {"aligned", aligned},
          {"minutes_used", minutes_used},
          {"overlap_s", overlap_s},
          {"rms_mg", rms_mg},
          {"envelope_error_mg",
           {{"mean", envelope.mean_mg}, {"sd", envelope.sd_mg}, {"p95", envelope.p95_mg}}},
          {"histogram", {{"edges_mg", histogram.edges_mg}, {"counts", histogram.counts}}},
          {"remarks", remarks}};
}

}  // namespace sixpoint::repair

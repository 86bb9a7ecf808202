#include "station/records/gap_trends.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <nlohmann/json.hpp>

#include "base/random.h"
#include "device/jig.h"

namespace sixpoint::station {

namespace {

constexpr double kDegPerRad = 57.29577951308232;
constexpr double kLeastSpan_lsb = 50;  // between two opposite faces: a tenth of a sensor's span
// Two jigs with patterns that differ by less than this part of their length: the station's.
constexpr double kSameAsOtherJig = 0.5;

double square(const SkewPattern& pattern) {
  double sum = 0;
  for (const double x : pattern) {
    sum += x * x;
  }
  return sum;
}

double rms(const SkewPattern& pattern) {
  return std::sqrt(square(pattern) / static_cast<double>(pattern.size()));
}

SkewPattern difference(SkewPattern a, const SkewPattern& b) {
  for (std::size_t k = 0; k < a.size(); ++k) {
    a[k] -= b[k];
  }
  return a;
}

SkewPattern mean_of(const std::vector<SkewPattern>& all, const std::vector<int>& signs) {
  SkewPattern mean{};
  for (std::size_t u = 0; u < all.size(); ++u) {
    for (std::size_t k = 0; k < mean.size(); ++k) {
      mean[k] += signs[u] * all[u][k] / static_cast<double>(all.size());
    }
  }
  return mean;
}

// The randomisation test of the header.
double chance_of(const std::vector<SkewPattern>& units, std::size_t sign_patterns) {
  std::vector<int> signs(units.size(), 1);
  const double found = square(mean_of(units, signs));
  Random random(7, 0x666C6970);
  std::size_t as_long = 1;
  for (std::size_t i = 0; i < sign_patterns; ++i) {
    for (int& sign : signs) {
      sign = random.uniform() < 0.5 ? -1 : 1;
    }
    as_long += square(mean_of(units, signs)) >= found * (1 - 1e-12) ? 1 : 0;
  }
  return static_cast<double>(as_long) / static_cast<double>(sign_patterns + 1);
}

JigTrend trend_of(const std::string& jig,
                  const std::map<std::string, std::vector<SkewPattern>>& by_unit,
                  const TrendOptions& options) {
  JigTrend trend;
  trend.jig = jig;
  trend.units = by_unit.size();
  std::vector<SkewPattern> units;
  for (const auto& [serial, patterns] : by_unit) {
    trend.runs += patterns.size();
    units.push_back(mean_of(patterns, std::vector<int>(patterns.size(), 1)));
  }
  trend.pattern_deg = mean_of(units, std::vector<int>(units.size(), 1));
  trend.common_deg = rms(trend.pattern_deg);
  double own = 0;
  for (const SkewPattern& unit : units) {
    own += square(difference(unit, trend.pattern_deg)) / static_cast<double>(unit.size());
  }
  trend.units_deg = units.size() > 1 ? std::sqrt(own / static_cast<double>(units.size() - 1)) : 0;
  if (trend.units >= options.fewest_units) {
    trend.chance = chance_of(units, options.sign_patterns);
    const bool common = trend.chance < options.alarm_chance && trend.common_deg > options.least_deg;
    trend.cause = common                                ? TrendCause::jig
                  : trend.units_deg > options.least_deg ? TrendCause::unit
                                                        : TrendCause::none;
  }
  return trend;
}

// A pattern that several jigs share comes from the station: its floor, or how its poses are meant.
void mark_station(std::vector<JigTrend>& jigs) {
  const auto is_common = [](const JigTrend& trend) {
    return trend.cause == TrendCause::jig || trend.cause == TrendCause::station;
  };
  for (JigTrend& a : jigs) {
    for (JigTrend& b : jigs) {
      if (&a != &b && is_common(a) && is_common(b) &&
          rms(difference(a.pattern_deg, b.pattern_deg)) <
              kSameAsOtherJig * std::min(a.common_deg, b.common_deg)) {
        a.cause = TrendCause::station;
        b.cause = TrendCause::station;
      }
    }
  }
}

}  // namespace

std::string_view to_string(TrendCause cause) {
  static constexpr std::array<std::string_view, 5> kNames = {"none", "unit", "jig", "station",
                                                             "too_few_units"};
  return kNames.at(static_cast<std::size_t>(cause));
}

Result<SkewPattern> skew_of_run(const StoredRun& run) {
  const auto wrong = [&] {
    return fail(ErrorCode::bad_data, "the run's report holds no six faces", run.id,
                "leave this run out, or measure the unit again");
  };
  const auto report = nlohmann::json::parse(run.document, nullptr, false);
  if (!report.is_object() || !report.contains("poses")) {
    return wrong();
  }
  const auto readings = stored_readings(report["poses"]);
  std::map<device::Pose, PerAxis<double>> faces;
  for (const StoredReading& reading : readings.value_or(std::vector<StoredReading>())) {
    faces[reading.pose] = reading.mean_lsb;
  }
  if (faces.size() != device::kPoses.size()) {
    return wrong();
  }
  SkewPattern pattern{};
  std::size_t at = 0;
  for (const device::Pose pose : device::kPoses) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (axis == device::axis_of(pose)) {
        continue;
      }
      const double plus = faces[device::pose_of(axis, 1)][axis];
      const double minus = faces[device::pose_of(axis, -1)][axis];
      if (!(plus - minus > kLeastSpan_lsb)) {
        return wrong();
      }
      pattern[at++] = kDegPerRad * (faces[pose][axis] - (plus + minus) / 2) / ((plus - minus) / 2);
    }
  }
  return pattern;
}

GapTrends find_trends(const std::vector<StoredRun>& runs, const TrendOptions& options) {
  GapTrends trends;
  trends.runs = runs.size();
  std::map<std::string, std::map<std::string, std::vector<SkewPattern>>> by_jig;
  for (const StoredRun& run : runs) {
    if (const auto skew = skew_of_run(run)) {
      by_jig[run.jig][run.serial].push_back(*skew);
    } else {
      ++trends.left_out;
    }
  }
  for (const auto& [jig, by_unit] : by_jig) {
    trends.jigs.push_back(trend_of(jig, by_unit, options));
  }
  mark_station(trends.jigs);
  std::stable_sort(trends.jigs.begin(), trends.jigs.end(),
                   [](const JigTrend& a, const JigTrend& b) { return a.runs > b.runs; });
  return trends;
}

}  // namespace sixpoint::station

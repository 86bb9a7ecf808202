#include "station/gap_trends.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <nlohmann/json.hpp>

#include "base/random.h"
#include "device/jig.h"

namespace sixpoint::station {

namespace {

constexpr double kDegPerRad = 57.29577951308232;

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

SkewPattern mean_of(const std::vector<SkewPattern>& all, const std::vector<int>& signs) {
  SkewPattern mean{};
  for (std::size_t u = 0; u < all.size(); ++u) {
    for (std::size_t k = 0; k < mean.size(); ++k) {
      mean[k] += signs[u] * all[u][k] / static_cast<double>(all.size());
    }
  }
  return mean;
}

}  // namespace

std::string_view to_string(Owner owner) {
  switch (owner) {
    case Owner::nobody:
      return "nobody";
    case Owner::unit:
      return "unit";
    case Owner::jig:
      return "jig";
    case Owner::station:
      return "station";
    case Owner::too_few:
      return "too_few_units";
  }
  return "?";
}

Result<SkewPattern> skew_of_run(const StoredRun& run) {
  const auto wrong = [&] {
    return fail(ErrorCode::bad_data, "the run's report holds no six faces", run.id,
                "leave this run out, or measure the unit again");
  };
  const auto report = nlohmann::json::parse(run.document, nullptr, false);
  if (!report.is_object() || !report.contains("poses") || !report["poses"].is_array()) {
    return wrong();
  }
  std::map<device::Pose, std::array<double, 3>> faces;
  for (const auto& item : report["poses"]) {
    if (!item.is_object() || !item.contains("pose") || !item["pose"].is_string() ||
        !item.contains("mean_lsb") || !item["mean_lsb"].is_array() ||
        item["mean_lsb"].size() != 3) {
      return wrong();
    }
    const auto pose = device::parse_pose(item["pose"].get<std::string>());
    std::array<double, 3> mean{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!item["mean_lsb"][axis].is_number()) {
        return wrong();
      }
      mean[axis] = item["mean_lsb"][axis].get<double>();
    }
    if (!pose) {
      return wrong();
    }
    faces[*pose] = mean;
  }
  if (faces.size() != device::kPoses.size()) {
    return wrong();
  }
  SkewPattern pattern{};
  std::size_t at = 0;
  for (const device::Pose pose : device::kPoses) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (axis == device::axis_of(pose)) {
        continue;
      }
      const double plus = faces[device::pose_of(axis, 1)][axis];
      const double minus = faces[device::pose_of(axis, -1)][axis];
      if (!(plus - minus > 50)) {  // a tenth of a sensor's span
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
    const auto skew = skew_of_run(run);
    if (skew) {
      by_jig[run.jig][run.serial].push_back(*skew);
    } else {
      ++trends.left_out;
    }
  }
  for (const auto& [jig, by_unit] : by_jig) {
    JigTrend trend;
    trend.jig = jig;
    trend.units = by_unit.size();
    std::vector<SkewPattern> units;
    for (const auto& [serial, patterns] : by_unit) {
      trend.runs += patterns.size();
      units.push_back(mean_of(patterns, std::vector<int>(patterns.size(), 1)));
    }
    std::vector<int> signs(units.size(), 1);
    trend.pattern_deg = mean_of(units, signs);
    trend.common_deg = rms(trend.pattern_deg);
    double own = 0;
    for (const SkewPattern& unit : units) {
      SkewPattern left = unit;
      for (std::size_t k = 0; k < left.size(); ++k) {
        left[k] -= trend.pattern_deg[k];
      }
      own += square(left) / static_cast<double>(left.size());
    }
    trend.units_deg = units.size() > 1 ? std::sqrt(own / static_cast<double>(units.size() - 1)) : 0;
    if (trend.units >= options.fewest_units) {
      Random random(7, 0x666C6970);
      const double seen = square(trend.pattern_deg);
      std::size_t as_long = 1;
      for (std::size_t flip = 0; flip < options.flips; ++flip) {
        for (int& sign : signs) {
          sign = random.uniform() < 0.5 ? -1 : 1;
        }
        as_long += square(mean_of(units, signs)) >= seen * (1 - 1e-12) ? 1 : 0;
      }
      trend.chance = static_cast<double>(as_long) / static_cast<double>(options.flips + 1);
      const bool common =
          trend.chance < options.alarm_chance && trend.common_deg > options.least_deg;
      trend.owner = common                                ? Owner::jig
                    : trend.units_deg > options.least_deg ? Owner::unit
                                                          : Owner::nobody;
    }
    trends.jigs.push_back(std::move(trend));
  }
  // What several jigs do alike is the station's: its floor, or the way the poses are meant.
  for (JigTrend& a : trends.jigs) {
    for (JigTrend& b : trends.jigs) {
      if (&a == &b || (a.owner != Owner::jig && a.owner != Owner::station) ||
          (b.owner != Owner::jig && b.owner != Owner::station)) {
        continue;
      }
      SkewPattern apart = a.pattern_deg;
      for (std::size_t k = 0; k < apart.size(); ++k) {
        apart[k] -= b.pattern_deg[k];
      }
      if (rms(apart) < 0.5 * std::min(a.common_deg, b.common_deg)) {
        a.owner = Owner::station;
        b.owner = Owner::station;
      }
    }
  }
  std::stable_sort(trends.jigs.begin(), trends.jigs.end(),
                   [](const JigTrend& a, const JigTrend& b) { return a.runs > b.runs; });
  return trends;
}

}  // namespace sixpoint::station

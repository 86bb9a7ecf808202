#include "station/statistics/control_chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include <nlohmann/json.hpp>

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Shewhart's constants for ranges of two (ASTM STP 15D, table 27).
constexpr double kD2 = 1.128;
constexpr double kD4 = 3.267;

double mean_of_first(const std::vector<double>& values, std::size_t count) {
  const auto end = values.begin() + static_cast<std::ptrdiff_t>(count);
  return std::accumulate(values.begin(), end, 0.0) / static_cast<double>(count);
}

// The rules on distances from the centre in sigma. `z` holds the points that count, oldest first;
// true when the last one completes the pattern.
class NelsonRules {
 public:
  explicit NelsonRules(std::span<const double> z) : z_(z) {}

  bool holds(int rule) const {
    switch (rule) {
      case 1:
        return std::abs(z_.back()) > 3;
      case 2:
        return one_side(9, 9, 0);
      case 3:
        return steps(6, 1, false) || steps(6, -1, false);
      case 4:
        return steps(14, 1, true) || steps(14, -1, true);
      case 5:
        return one_side(2, 3, 2);
      case 6:
        return one_side(4, 5, 1);
      case 7:
        return all(15, [](double z) { return std::abs(z) < 1; });
      case 8:
        return all(8, [](double z) { return std::abs(z) > 1; });
      default:
        return false;
    }
  }

 private:
  std::span<const double> last(std::size_t count) const { return z_.last(count); }

  template <class Condition>
  bool all(std::size_t count, Condition&& condition) const {
    return z_.size() >= count &&
           std::all_of(last(count).begin(), last(count).end(), std::forward<Condition>(condition));
  }

  // The last point and `least` in all of the last `of` lie beyond `sigma` on one side.
  bool one_side(std::ptrdiff_t least, std::size_t of, double sigma) const {
    for (const double sign : {1.0, -1.0}) {
      const auto beyond = [&](double z) { return sign * z > sigma; };
      const auto points = last(std::min(of, z_.size()));
      if (beyond(z_.back()) && std::count_if(points.begin(), points.end(), beyond) >= least) {
        return true;
      }
    }
    return false;
  }

  // Every step between the last `count` points goes up (sign 1) or down (sign -1); with
  // `alternating`, the sign changes at each step.
  bool steps(std::size_t count, double sign, bool alternating) const {
    if (z_.size() < count) {
      return false;
    }
    const auto points = last(count);
    for (std::size_t i = 1; i < count; ++i, sign = alternating ? -sign : sign) {
      if (!(sign * (points[i] - points[i - 1]) > 0)) {
        return false;
      }
    }
    return true;
  }

  std::span<const double> z_;
};

}  // namespace

std::string_view nelson_rule(int rule) {
  static constexpr std::array<std::string_view, kNelsonRules> kRules = {
      "a point beyond 3 sigma",
      "nine points in a row on one side",
      "six points in a row rising or falling",
      "fourteen points in a row up and down",
      "two of three points beyond 2 sigma on one side",
      "four of five points beyond 1 sigma on one side",
      "fifteen points in a row within 1 sigma",
      "eight points in a row beyond 1 sigma"};
  return rule >= 1 && rule <= kNelsonRules ? kRules[static_cast<std::size_t>(rule) - 1] : "?";
}

ControlChart control_chart(std::string name, std::vector<double> values, std::size_t baseline,
                           double least_sigma, std::size_t from) {
  ControlChart chart;
  chart.name = std::move(name);
  chart.values = std::move(values);
  for (std::size_t i = 1; i < chart.values.size(); ++i) {
    chart.moving_ranges.push_back(std::abs(chart.values[i] - chart.values[i - 1]));
  }
  if (baseline < 2 || chart.values.size() < baseline) {
    return chart;
  }
  chart.baseline = baseline;
  chart.centre = mean_of_first(chart.values, baseline);
  chart.mean_range = mean_of_first(chart.moving_ranges, baseline - 1);
  chart.sigma = std::max(chart.mean_range / kD2, least_sigma);
  chart.lower = chart.centre - 3 * chart.sigma;
  chart.upper = chart.centre + 3 * chart.sigma;
  chart.upper_range = kD4 * chart.mean_range;
  if (!(chart.sigma > 0)) {
    return chart;
  }
  std::vector<double> z;
  for (std::size_t i = std::max(baseline, from); i < chart.values.size(); ++i) {
    z.push_back((chart.values[i] - chart.centre) / chart.sigma);
    for (int rule = 1; rule <= kNelsonRules; ++rule) {
      if (NelsonRules(z).holds(rule)) {
        chart.signals.push_back({i, rule});
      }
    }
  }
  return chart;
}

Json ControlChart::to_json() const {
  Json json = {{"name", name},
               {"points", values.size()},
               {"in_force", baseline > 0},
               {"baseline", baseline},
               {"centre", centre},
               {"sigma", sigma},
               {"lower", lower},
               {"upper", upper},
               {"mean_range", mean_range},
               {"upper_range", upper_range},
               {"values", values}};
  json["signals"] = Json::array();
  for (const ChartSignal& signal : signals) {
    json["signals"].push_back(
        {{"point", signal.point}, {"rule", signal.rule}, {"meaning", nelson_rule(signal.rule)}});
  }
  return json;
}

}  // namespace sixpoint::station

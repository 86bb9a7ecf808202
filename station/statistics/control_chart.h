// Individuals and moving range charts with Nelson's rules (docs/statistics.md).
//
//   const ControlChart chart = control_chart("zero_offset_mg x", values_mg, 10);
//   for (const ChartSignal& signal : chart.signals) {
//     std::cout << chart.values[signal.point] << ": " << nelson_rule(signal.rule) << '\n';
//   }
//
// Pure functions. Limits: Shewhart's, from the mean moving range of the baseline (ASTM STP 15D).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace sixpoint::station {

// Nelson, J. Quality Technology 16 (1984) 237: 1 one point beyond 3 sigma; 2 nine in a row on one
// side; 3 six in a row rising or falling; 4 fourteen alternating; 5 two of three beyond 2 sigma on
// one side; 6 four of five beyond 1 sigma on one side; 7 fifteen within 1 sigma; 8 eight in a row
// beyond 1 sigma on either side. Western Electric's four (1956) are 1, 5, 6 and, with eight in a
// row, 2.
inline constexpr int kNelsonRules = 8;
std::string_view nelson_rule(int rule);  // 1 .. 8

struct ChartSignal {
  std::size_t point = 0;  // the last of those that make it
  int rule = 0;           // 1 .. 8
};

struct ControlChart {
  std::string name;
  std::vector<double> values;
  std::vector<double> moving_ranges;  // one fewer
  std::size_t baseline = 0;           // points that the limits come from; 0: too few yet
  double centre = 0;
  double sigma = 0;  // mean moving range / d2 (1.128 for two points), or the least sigma
  double lower = 0;  // centre -+ 3 sigma
  double upper = 0;
  double mean_range = 0;
  double upper_range = 0;            // D4 (3.267) times the mean range
  std::vector<ChartSignal> signals;  // after the baseline only

  nlohmann::ordered_json to_json() const;
};
// Limits from the first `baseline` values. `from`: signals need all their points at or after this
// index (points that an engineer has signed give no signal again).
ControlChart control_chart(std::string name, std::vector<double> values, std::size_t baseline,
                           double least_sigma = 0, std::size_t from = 0);

}  // namespace sixpoint::station

// Benches with hidden causes, drawn by a seed: jigs, units that are measured on one jig or on two,
// lots.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "station/records/gap_trends.h"
#include "station/records/made_run.h"

namespace sixpoint::station {

struct MadeBench {
  std::vector<MadeJig> jigs;
  std::size_t units = 6;    // of each jig
  bool unbalanced = false;  // from 2 units a jig to 2 * units
  double twice = 0;         // share of units that are measured on a further jig, drawn
  std::size_t lots = 0;     // drawn for each unit; the hidden effect is that of "L0"
  Eigen::Vector3d lot_turn_deg = Eigen::Vector3d::Zero();
  Eigen::Vector3d lot_zero_mg = Eigen::Vector3d::Zero();
  MadeScatter scatter;
};

struct MadeRuns {
  std::vector<StoredRun> runs;
  LotOfSerial lots;
};

inline MadeRuns made_runs(const MadeBench& bench, Random& random) {
  MadeRuns out;
  const auto add = [&](const MadeUnit& unit, const MadeJig& jig) {
    out.runs.push_back(
        made_run(unit, jig, bench.scatter, random, "run" + std::to_string(out.runs.size())));
  };
  for (std::size_t j = 0; j < bench.jigs.size(); ++j) {
    const std::size_t units =
        bench.unbalanced ? 2 + random.below(2 * bench.units - 1) : bench.units;
    for (std::size_t u = 0; u < units; ++u) {
      MadeUnit unit = made_unit("U" + std::to_string(j) + "-" + std::to_string(u), random);
      if (bench.lots > 0) {
        const std::size_t lot = random.below(bench.lots);
        out.lots[unit.serial] = "L" + std::to_string(lot);
        if (lot == 0) {
          unit.turn_deg += bench.lot_turn_deg;
          unit.zero_mg += bench.lot_zero_mg;
        }
      }
      add(unit, bench.jigs[j]);
      if (random.uniform() < bench.twice) {
        add(unit, bench.jigs[random.below(bench.jigs.size())]);
      }
    }
  }
  return out;
}

inline std::vector<MadeJig> made_jigs(std::size_t count, std::size_t stations = 1) {
  std::vector<MadeJig> jigs(count);
  for (std::size_t j = 0; j < count; ++j) {
    jigs[j].name = "J" + std::to_string(j);
    jigs[j].station = "S" + std::to_string(j % stations);
  }
  return jigs;
}

// `size` along a direction that is drawn.
inline Eigen::Vector3d made_vector(double size, Random& random) {
  const Eigen::Vector3d way(random.normal(), random.normal(), random.normal());
  return size * way.normalized();
}
inline std::array<double, 2> made_lean(double size_deg, Random& random) {
  const double way = random.uniform(0, 360) * kMadeRad;
  return {size_deg * std::cos(way), size_deg * std::sin(way)};
}

}  // namespace sixpoint::station

#include "calib/temperature_drift.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

namespace sixpoint::calib {

namespace {

// The least range of a stretch that counts: over less, settling and creep look like drift.
constexpr double kLeastRange_c = 3;

// Means over one degree of one stretch.
struct Degree {
  double temperature_c = 0;
  PerAxis<double> level_g{};
  double blocks = 0;
};

std::vector<Degree> degrees_of(std::span<const StillBlock> stretch,
                               const Calibration& calibration) {
  std::map<int, Degree> bins;
  for (const StillBlock& block : stretch) {
    const double celsius = *block.temperature_c;
    Degree& bin = bins[static_cast<int>(std::lround(std::clamp(celsius, -300.0, 300.0)))];
    const PerAxis<double> g = calibration.to_g(block.mean_lsb);
    bin.temperature_c += celsius;
    for (std::size_t a = 0; a < kAxes; ++a) {
      bin.level_g[a] += g[a];
    }
    bin.blocks += 1;
  }
  std::vector<Degree> out;
  for (auto& [key, bin] : bins) {
    bin.temperature_c /= bin.blocks;
    for (double& level : bin.level_g) {
      level /= bin.blocks;
    }
    out.push_back(bin);
  }
  return out;
}

struct Sums {
  double square_c2 = 0;
  PerAxis<double> product{};
  PerAxis<double> square_g2{};
  int degrees = 0;
};

}  // namespace

std::optional<TemperatureDrift> temperature_drift(std::span<const StillBlock> blocks,
                                                  const Calibration& calibration) {
  TemperatureDrift out;
  Sums sums;
  const auto add = [&](std::span<const StillBlock> stretch) {
    if (stretch.empty()) {
      return;
    }
    const auto degrees = degrees_of(stretch, calibration);
    if (degrees.size() < 3 ||
        degrees.back().temperature_c - degrees.front().temperature_c < kLeastRange_c) {
      return;
    }
    Degree mean;
    for (const Degree& degree : degrees) {
      const double share = 1.0 / static_cast<double>(degrees.size());
      mean.temperature_c += share * degree.temperature_c;
      for (std::size_t a = 0; a < kAxes; ++a) {
        mean.level_g[a] += share * degree.level_g[a];
      }
    }
    for (const Degree& degree : degrees) {
      const double warmth_c = degree.temperature_c - mean.temperature_c;
      sums.square_c2 += warmth_c * warmth_c;
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double level_g = degree.level_g[a] - mean.level_g[a];
        sums.product[a] += warmth_c * level_g;
        sums.square_g2[a] += level_g * level_g;
      }
    }
    sums.degrees += static_cast<int>(degrees.size());
    if (out.stretches == 0) {
      out.low_c = degrees.front().temperature_c;
      out.high_c = degrees.back().temperature_c;
    }
    out.low_c = std::min(out.low_c, degrees.front().temperature_c);
    out.high_c = std::max(out.high_c, degrees.back().temperature_c);
    out.blocks += stretch.size();
    ++out.stretches;
  };

  std::size_t begin = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (!blocks[i].temperature_c || !std::isfinite(*blocks[i].temperature_c)) {
      add(blocks.subspan(begin, i - begin));
      begin = i + 1;
      continue;
    }
    bool moved = false;
    for (std::size_t a = 0; a < kAxes && i > begin; ++a) {
      const double jump_g = calibration.sensitivity_g_per_lsb[a] *
                            (blocks[i].mean_lsb[a] - blocks[i - 1].mean_lsb[a]);
      moved = moved || !(std::abs(jump_g) <= kMoved_g);
    }
    if (moved) {
      add(blocks.subspan(begin, i - begin));
      begin = i;
    }
  }
  add(blocks.subspan(begin));
  if (out.stretches == 0) {
    return std::nullopt;
  }
  const double freedom = std::max(1, sums.degrees - out.stretches - 1);
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double slope = sums.product[a] / sums.square_c2;
    const double left_g2 = std::max(0.0, sums.square_g2[a] - slope * sums.product[a]);
    out.zero_mg_per_c[a] = kMgPerG * slope;
    out.standard_uncertainty_mg_per_c[a] = kMgPerG * std::sqrt(left_g2 / freedom / sums.square_c2);
  }
  return out;
}

}  // namespace sixpoint::calib

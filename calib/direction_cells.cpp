#include "calib/direction_cells.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

namespace sixpoint::calib {

namespace {

constexpr int kGrid = 16;                   // cells along a cube face: 90 / 16 = 5.6 degrees
constexpr double kNeighbourCosine = 0.978;  // 12 degrees
constexpr double kTemperatureBin_c = 1.0;
constexpr double kMostBins = 200;  // either way, against absurd temperatures

// Which of the 6 * kGrid * kGrid cells of a cube around the sphere; -1 for a zero vector.
int cell_key(const PerAxis<double>& mean_g) {
  std::size_t face_axis = 0;
  for (std::size_t a = 1; a < kAxes; ++a) {
    if (std::abs(mean_g[a]) > std::abs(mean_g[face_axis])) {
      face_axis = a;
    }
  }
  const double length = mean_g[face_axis];
  if (length == 0) {
    return -1;
  }
  const double inverse = 1 / std::abs(length);
  // Angles, not tangents, so that cells are alike in size; atan t on -1 .. 1 to 0.3 degrees is
  // t (pi/4 + 0.273 (1 - |t|)) (Rajan and others 2006), which is monotonic and enough here.
  const auto slot = [&](std::size_t axis) {
    const double t = mean_g[axis] * inverse;
    const double angle = t * (M_PI_4 + 0.273 * (1 - std::abs(t))) / M_PI_2 + 0.5;
    return std::clamp(static_cast<int>(angle * kGrid), 0, kGrid - 1);
  };
  const int face = static_cast<int>(face_axis) * 2 + (length < 0 ? 1 : 0);
  return (face * kGrid + slot((face_axis + 1) % 3)) * kGrid + slot((face_axis + 2) % 3);
}

PerAxis<double> direction_of(const DirectionCell& cell, const Calibration& calibration) {
  PerAxis<double> g = calibration.to_g(cell.mean_lsb);
  const double length = std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  for (double& value : g) {
    value /= length > 0 ? length : 1;
  }
  return g;
}

// Sums of a cell while its blocks are added.
struct CellSum {
  DirectionCell cell;
  PerAxis<double> square_lsb2{};

  void add(const StillBlock& block, double temperature_c) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      cell.mean_lsb[a] += block.mean_lsb[a];
      cell.variance_lsb2[a] += block.ramp_variance_lsb2[a];
      square_lsb2[a] += block.mean_lsb[a] * block.mean_lsb[a];
    }
    cell.temperature_c += temperature_c;
    cell.blocks += 1;
  }

  DirectionCell mean() const {
    DirectionCell out = cell;
    for (std::size_t a = 0; a < kAxes; ++a) {
      out.mean_lsb[a] /= cell.blocks;
      out.variance_lsb2[a] /= cell.blocks;
      out.variance_lsb2[a] +=
          std::max(0.0, square_lsb2[a] / cell.blocks - out.mean_lsb[a] * out.mean_lsb[a]);
    }
    out.temperature_c /= cell.blocks;
    return out;
  }
};

// The candidates for one axis of the nine integers: floor and floor + 1 of the difference and of
// zero, and one further on either side.
constexpr std::size_t kChoices = 16;
struct AxisChoices {
  int span_low = 0;
  int zero_low = 0;
  int span(std::size_t choice) const { return span_low - 1 + static_cast<int>(choice / 4); }
  int zero(std::size_t choice) const { return zero_low - 1 + static_cast<int>(choice % 4); }
};

}  // namespace

GravityPoint point_of(const DirectionCell& cell, double sigma_g) {
  return {cell.mean_lsb, cell.variance_lsb2, sigma_g, cell.temperature_c};
}

std::vector<GravityPoint> points_of(std::span<const DirectionCell> cells,
                                    std::span<const double> sigma_g) {
  std::vector<GravityPoint> points;
  points.reserve(cells.size());
  for (std::size_t k = 0; k < cells.size(); ++k) {
    points.push_back(point_of(cells[k], sigma_g[k]));
  }
  return points;
}

std::optional<double> mean_temperature_c(std::span<const StillBlock> blocks) {
  double sum = 0;
  double count = 0;
  for (const StillBlock& block : blocks) {
    if (block.temperature_c && std::isfinite(*block.temperature_c)) {
      sum += *block.temperature_c;
      count += 1;
    }
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

std::vector<DirectionCell> cells_of(std::span<const StillBlock> blocks, std::span<const char> used,
                                    std::vector<int>* cell_of_block) {
  if (cell_of_block != nullptr) {
    cell_of_block->assign(blocks.size(), -1);
  }
  const double reference_c = mean_temperature_c(blocks).value_or(0);
  const auto temperature_of = [&](const StillBlock& block) {
    return block.temperature_c ? *block.temperature_c - reference_c : 0.0;
  };
  const auto bin_of = [&](const StillBlock& block) {
    return static_cast<int>(std::clamp(std::floor(temperature_of(block) / kTemperatureBin_c + 0.5),
                                       -kMostBins, kMostBins));
  };
  int lowest_bin = 0;
  int highest_bin = 0;
  for (const StillBlock& block : blocks) {
    lowest_bin = std::min(lowest_bin, bin_of(block));
    highest_bin = std::max(highest_bin, bin_of(block));
  }
  constexpr std::size_t kKeys = 6 * kGrid * kGrid + 1;
  std::vector<int> number(static_cast<std::size_t>(highest_bin - lowest_bin + 1) * kKeys, -1);
  std::vector<CellSum> sums;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (!used.empty() && used[i] == 0) {
      continue;
    }
    const StillBlock& block = blocks[i];
    int& found = number[static_cast<std::size_t>(bin_of(block) - lowest_bin) * kKeys +
                        static_cast<std::size_t>(cell_key(block.mean_g) + 1)];
    if (found < 0) {
      found = static_cast<int>(sums.size());
      sums.emplace_back();
    }
    sums[static_cast<std::size_t>(found)].add(block, temperature_of(block));
    if (cell_of_block != nullptr) {
      (*cell_of_block)[i] = found;
    }
  }
  std::vector<DirectionCell> cells;
  cells.reserve(sums.size());
  for (const CellSum& sum : sums) {
    cells.push_back(sum.mean());
  }
  return cells;
}

int number_neighbourhoods(std::vector<DirectionCell>& cells, const Calibration& calibration) {
  std::vector<std::size_t> order(cells.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t left, std::size_t right) {
    return cells[left].blocks > cells[right].blocks;
  });
  std::vector<PerAxis<double>> leaders;
  for (const std::size_t i : order) {
    const PerAxis<double> n = direction_of(cells[i], calibration);
    std::size_t nearest = leaders.size();
    double best = kNeighbourCosine;
    for (std::size_t k = 0; k < leaders.size(); ++k) {
      const double cosine = n[0] * leaders[k][0] + n[1] * leaders[k][1] + n[2] * leaders[k][2];
      if (cosine >= best) {
        best = cosine;
        nearest = k;
      }
    }
    if (nearest == leaders.size()) {
      leaders.push_back(n);
    }
    cells[i].neighbourhood = static_cast<int>(nearest);
  }
  return static_cast<int>(leaders.size());
}

std::vector<double> neighbourhood_sizes(std::span<const DirectionCell> cells, int neighbourhoods) {
  std::vector<double> size(static_cast<std::size_t>(neighbourhoods), 0);
  for (const DirectionCell& cell : cells) {
    size[static_cast<std::size_t>(cell.neighbourhood)] += 1;
  }
  std::vector<double> out;
  out.reserve(cells.size());
  for (const DirectionCell& cell : cells) {
    out.push_back(size[static_cast<std::size_t>(cell.neighbourhood)]);
  }
  return out;
}

double cells_rms_mg(std::span<const DirectionCell> cells, const Calibration& calibration,
                    double gravity_g) {
  std::unordered_map<int, double> members;
  for (const DirectionCell& cell : cells) {
    members[cell.neighbourhood] += 1;
  }
  double square = 0;
  for (const DirectionCell& cell : cells) {
    const double residual = magnitude_g(calibration, cell.mean_lsb, cell.variance_lsb2) - gravity_g;
    square += residual * residual / members[cell.neighbourhood];
  }
  return members.empty() ? 0 : kMgPerG * std::sqrt(square / static_cast<double>(members.size()));
}

Result<StoredConstants> round_constants(const Calibration& calibration,
                                        std::span<const DirectionCell> cells,
                                        std::span<const double> sigma_mg, double gravity_g) {
  SIXPOINT_ASSIGN(StoredConstants out, nearest_stored(calibration));
  PerAxis<AxisChoices> choices;
  // Squares of every cell, axis and choice once; the 16^3 combinations are then sums.
  PerAxis<std::vector<double>> squares;
  for (std::size_t a = 0; a < kAxes; ++a) {
    choices[a] = {static_cast<int>(std::floor(2 / calibration.sensitivity_g_per_lsb[a])),
                  static_cast<int>(std::floor(calibration.zero_lsb[a]))};
    squares[a].resize(cells.size() * kChoices);
    for (std::size_t c = 0; c < kChoices; ++c) {
      const double s = 2.0 / std::max(1, choices[a].span(c));
      const double zero = choices[a].zero(c);
      for (std::size_t k = 0; k < cells.size(); ++k) {
        const double level = s * (cells[k].mean_lsb[a] - zero);
        squares[a][k * kChoices + c] = level * level + s * s * cells[k].variance_lsb2[a];
      }
    }
  }
  std::vector<double> weight;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const double sigma = k < sigma_mg.size() && sigma_mg[k] > 0 ? sigma_mg[k] : 1;
    weight.push_back(1 / (sigma * sigma));
  }
  double best = HUGE_VAL;
  PerAxis<std::size_t> chosen = {5, 5, 5};  // floor of both numbers
  for (std::size_t c = 0; c < kChoices * kChoices * kChoices; ++c) {
    const PerAxis<std::size_t> tried = {c / (kChoices * kChoices), c / kChoices % kChoices,
                                        c % kChoices};
    double cost = 0;
    for (std::size_t k = 0; k < cells.size() && cost < best; ++k) {
      const double residual =
          std::sqrt(squares[0][k * kChoices + tried[0]] + squares[1][k * kChoices + tried[1]] +
                    squares[2][k * kChoices + tried[2]]) -
          gravity_g;
      cost += weight[k] * residual * residual;
    }
    if (cost < best) {
      best = cost;
      chosen = tried;
    }
  }
  for (std::size_t a = 0; a < kAxes; ++a) {
    out.zero_lsb[a] = choices[a].zero(chosen[a]);
    out.positive_lsb[a] = out.negative_lsb[a] + choices[a].span(chosen[a]);
  }
  SIXPOINT_CHECK(validate(out));
  return out;
}

}  // namespace sixpoint::calib

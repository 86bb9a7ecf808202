#include "calib/block_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include <fmt/format.h>

namespace sixpoint::calib {

namespace {

constexpr int kGrid = 16;                   // cells along a cube face: 90 / 16 = 5.6 degrees
constexpr double kNeighbourCosine = 0.978;  // 12 degrees
constexpr double kTemperatureBin_c = 1.0;

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

// Numbers the neighbourhoods, the fullest cell of each first. Returns how many there are.
int number_neighbourhoods(std::vector<DirectionCell>& cells, const Calibration& calibration) {
  std::vector<std::size_t> order(cells.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t left, std::size_t right) {
    return cells[left].blocks > cells[right].blocks;
  });
  std::vector<PerAxis<double>> leaders;
  for (const std::size_t i : order) {
    const PerAxis<double> n = direction_of(cells[i], calibration);
    int found = -1;
    double best = kNeighbourCosine;
    for (std::size_t k = 0; k < leaders.size(); ++k) {
      const double cosine = n[0] * leaders[k][0] + n[1] * leaders[k][1] + n[2] * leaders[k][2];
      if (cosine >= best) {
        best = cosine;
        found = static_cast<int>(k);
      }
    }
    if (found < 0) {
      found = static_cast<int>(leaders.size());
      leaders.push_back(n);
    }
    cells[i].neighbourhood = found;
  }
  return static_cast<int>(leaders.size());
}

std::vector<double> neighbours_of(const std::vector<DirectionCell>& cells, int neighbourhoods) {
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

GravityPoint point_of(const DirectionCell& cell, double sigma_g) {
  return {cell.mean_lsb, cell.variance_lsb2, sigma_g, cell.temperature_c};
}

double median(std::vector<double> values) {
  if (values.empty()) {
    return 0;
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The structural variance at which the cells' weighted squares add up to their degrees of freedom.
double paule_mandel(const std::vector<double>& residual_g, const std::vector<double>& white_g2,
                    int parameters) {
  const double freedom = static_cast<double>(residual_g.size()) - parameters;
  if (freedom < 1) {
    return 0;
  }
  const auto excess = [&](double structural_g2) {
    double sum = 0;
    for (std::size_t i = 0; i < residual_g.size(); ++i) {
      sum += residual_g[i] * residual_g[i] / (white_g2[i] + structural_g2);
    }
    return sum - freedom;
  };
  // Three standard deviations of chi-square: below that the scatter is noise.
  if (excess(0) < 3 * std::sqrt(2 * freedom)) {
    return 0;
  }
  double low = 0;
  double high = 1e-8;
  while (excess(high) > 0 && high < 1) {
    high *= 4;
  }
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Of the blocks that have one: what constants without temperature terms hold for.
double mean_temperature_c(std::span<const StillBlock> blocks) {
  double sum = 0;
  double count = 0;
  for (const StillBlock& block : blocks) {
    if (block.temperature_c && std::isfinite(*block.temperature_c)) {
      sum += *block.temperature_c;
      count += 1;
    }
  }
  return count > 0 ? sum / count : 0;
}

struct HeldOut {
  double rms_mg = 0;
  int directions = 0;  // that could be predicted at all
  bool valid() const { return directions > 0; }
};

// Standard deviation of the magnitude that a fit predicts at a point.
double predicted_sd_g(const LeastSquaresFit& fit, const DirectionCell& cell) {
  const PerAxis<double> g = fit.calibration.to_g(cell.mean_lsb);
  const double length = std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  const std::array<double, 6> pull = {g[0] * g[0] / length, g[1] * g[1] / length,
                                      g[2] * g[2] / length, -g[0] / length,
                                      -g[1] / length,       -g[2] / length};
  double variance = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      variance += pull[i] * pull[j] * fit.covariance_at(i, j);
    }
  }
  return std::sqrt(std::max(0.0, variance));
}

// Folds of whole neighbourhoods: five, or one each where there are few.
HeldOut hold_out(const std::vector<DirectionCell>& cells, const std::vector<double>& sigma_g,
                 const std::vector<double>& weight_sigma_g, const LeastSquaresFit& fit,
                 const BlockFitOptions& options, int directions) {
  constexpr int kFew = 15;
  constexpr double kPredictable_g = 0.005;
  const int folds = directions <= kFew ? directions : 5;
  double square = 0;
  double weights = 0;
  std::vector<char> tested(static_cast<std::size_t>(directions), 0);
  for (int fold = 0; fold < folds; ++fold) {
    std::vector<GravityPoint> kept;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].neighbourhood % folds != fold) {
        kept.push_back(point_of(cells[i], sigma_g[i]));
      }
    }
    LeastSquaresOptions least;
    least.model = fit.model;
    least.gravity_g = options.gravity_g;
    least.prior = options.prior;
    least.starts = 1;
    least.max_iterations = 50;
    const auto fold_fit = least_squares(kept, fit.calibration, least);
    if (!fold_fit || !fold_fit->converged) {
      continue;
    }
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].neighbourhood % folds != fold ||
          !(predicted_sd_g(*fold_fit, cells[i]) < kPredictable_g)) {
        continue;
      }
      const double residual =
          magnitude_g(*fold_fit, point_of(cells[i], sigma_g[i])) - options.gravity_g;
      const double weight = 1 / (weight_sigma_g[i] * weight_sigma_g[i]);
      square += weight * residual * residual;
      weights += weight;
      tested[static_cast<std::size_t>(cells[i].neighbourhood)] = 1;
    }
  }
  HeldOut out;
  out.directions = static_cast<int>(std::count(tested.begin(), tested.end(), 1));
  out.rms_mg = weights > 0 ? kMgPerG * std::sqrt(square / weights) : 0;
  return out;
}

}  // namespace

std::vector<DirectionCell> cells_of(std::span<const StillBlock> blocks, std::span<const char> used,
                                    std::vector<int>* cell_of_block) {
  std::vector<DirectionCell> cells;
  if (cell_of_block != nullptr) {
    cell_of_block->assign(blocks.size(), -1);
  }
  const double reference_c = mean_temperature_c(blocks);
  const auto temperature_of = [&](const StillBlock& block) {
    return block.temperature_c ? *block.temperature_c - reference_c : 0.0;
  };
  const auto bin_of = [&](const StillBlock& block) {
    return static_cast<int>(
        std::clamp(std::floor(temperature_of(block) / kTemperatureBin_c + 0.5), -200.0, 200.0));
  };
  int lowest_bin = 0;
  int highest_bin = 0;
  for (const StillBlock& block : blocks) {
    lowest_bin = std::min(lowest_bin, bin_of(block));
    highest_bin = std::max(highest_bin, bin_of(block));
  }
  constexpr std::size_t kKeys = 6 * kGrid * kGrid + 1;
  std::vector<int> number(static_cast<std::size_t>(highest_bin - lowest_bin + 1) * kKeys, -1);
  std::vector<PerAxis<double>> square;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (!used.empty() && used[i] == 0) {
      continue;
    }
    const StillBlock& block = blocks[i];
    int& found = number[static_cast<std::size_t>(bin_of(block) - lowest_bin) * kKeys +
                        static_cast<std::size_t>(cell_key(block.mean_g) + 1)];
    if (found < 0) {
      found = static_cast<int>(cells.size());
      cells.emplace_back();
      cells.back().first_s = block.start_time_s;
      square.emplace_back();
    }
    const auto k = static_cast<std::size_t>(found);
    DirectionCell& cell = cells[k];
    for (std::size_t a = 0; a < kAxes; ++a) {
      cell.mean_lsb[a] += block.mean_lsb[a];
      cell.variance_lsb2[a] += block.ramp_variance_lsb2[a];
      square[k][a] += block.mean_lsb[a] * block.mean_lsb[a];
    }
    cell.temperature_c += temperature_of(block);
    cell.blocks += 1;
    cell.first_s = std::min(cell.first_s, block.start_time_s);
    cell.last_s = std::max(cell.last_s, block.start_time_s);
    if (cell_of_block != nullptr) {
      (*cell_of_block)[i] = found;
    }
  }
  for (std::size_t k = 0; k < cells.size(); ++k) {
    DirectionCell& cell = cells[k];
    for (std::size_t a = 0; a < kAxes; ++a) {
      cell.mean_lsb[a] /= cell.blocks;
      cell.variance_lsb2[a] /= cell.blocks;
      cell.variance_lsb2[a] +=
          std::max(0.0, square[k][a] / cell.blocks - cell.mean_lsb[a] * cell.mean_lsb[a]);
    }
    cell.temperature_c /= cell.blocks;
  }
  return cells;
}

Result<BlockFit> fit_blocks(std::span<const StillBlock> blocks, const Calibration& start,
                            const BlockFitOptions& options) {
  if (blocks.empty()) {
    return fail(ErrorCode::bad_data, "no still block", "least squares",
                "lay the unit still on each of its six sides for a minute");
  }
  for (const StillBlock& block : blocks) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (!std::isfinite(block.mean_g[a]) || !std::isfinite(block.mean_lsb[a]) ||
          !std::isfinite(block.ramp_variance_lsb2[a])) {
        return fail(ErrorCode::bad_data, "a still block is not a finite number", "least squares",
                    "the recording is damaged");
      }
    }
  }
  BlockFit out;
  bool all_have_temperature = true;
  double coldest = 1e9;
  double warmest = -1e9;
  for (const StillBlock& block : blocks) {
    all_have_temperature = all_have_temperature && block.temperature_c.has_value() &&
                           std::isfinite(*block.temperature_c);
    if (all_have_temperature) {
      coldest = std::min(coldest, *block.temperature_c);
      warmest = std::max(warmest, *block.temperature_c);
    }
  }
  out.temperature_range_c = all_have_temperature ? warmest - coldest : 0;
  out.reference_temperature_c = mean_temperature_c(blocks);

  std::vector<char> used(blocks.size(), 1);
  std::vector<int> cell_of_block;
  LeastSquaresOptions least;
  least.gravity_g = options.gravity_g;
  least.prior = options.prior;
  Calibration from = start;
  std::vector<double> sigma_g;
  double structural_g2 = 9e-6;  // to begin with: every direction nearly equal
  double block_g2 = 1e-6;

  const auto fit_once = [&]() -> Status {
    std::vector<GravityPoint> points;
    points.reserve(out.cells.size());
    for (std::size_t k = 0; k < out.cells.size(); ++k) {
      points.push_back(point_of(out.cells[k], sigma_g[k]));
    }
    SIXPOINT_ASSIGN(out.fit, least_squares(points, from, least));
    from = out.fit.calibration;
    return {};
  };
  const auto sigmas = [&](double structure_g2) {
    std::vector<double> values;
    values.reserve(out.cells.size());
    for (const DirectionCell& cell : out.cells) {
      values.push_back(std::sqrt(block_g2 / cell.blocks + structure_g2 + 1e-14));
    }
    return values;
  };
  const auto weigh = [&]() { sigma_g = sigmas(structural_g2); };
  // The misfit of cells next to each other is the same: it does not average out over them, and the
  // covariance must not believe so.
  const auto correlate = [&](LeastSquaresFit& fit, double structure_g2) -> Status {
    const auto neighbours = neighbours_of(out.cells, out.directions);
    std::vector<GravityPoint> points;
    for (std::size_t k = 0; k < out.cells.size(); ++k) {
      points.push_back(point_of(out.cells[k], std::sqrt(block_g2 / out.cells[k].blocks +
                                                        structure_g2 * neighbours[k] + 1e-14)));
    }
    LeastSquaresOptions wide = least;
    wide.model = fit.model;
    wide.starts = 1;
    // What the six leave out is not only scatter: a cross-axis term bends all directions at once,
    // and where these are few it hides in the sensitivities with next to no residual. It is put to
    // the data as far as they can tell, and by the prior where they cannot.
    const bool alias = !fit.model.cross_axis &&
                       std::ranges::any_of(options.cross_axis_sd, [](double sd) { return sd > 0; });
    if (alias) {
      wide.model.cross_axis = true;
      wide.cross_axis_sd = options.cross_axis_sd;
    }
    SIXPOINT_ASSIGN(const LeastSquaresFit other, least_squares(points, fit.calibration, wide));
    if (!alias) {
      fit.covariance = other.covariance;
      return {};
    }
    const auto kept = [&](std::size_t i) { return i < 6 ? i : i + 3; };
    const auto parameters = static_cast<std::size_t>(fit.model.parameters());
    for (std::size_t i = 0; i < parameters; ++i) {
      for (std::size_t j = 0; j < parameters; ++j) {
        fit.covariance[i * kMaxParameters + j] = other.covariance_at(kept(i), kept(j));
      }
    }
    // The estimate stays the plain one; how far it lies from the centre of that is error as well.
    std::array<double, 6> apart{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      apart[a] =
          other.calibration.sensitivity_g_per_lsb[a] / fit.calibration.sensitivity_g_per_lsb[a] - 1;
      apart[3 + a] = fit.calibration.sensitivity_g_per_lsb[a] *
                     (other.calibration.zero_lsb[a] - fit.calibration.zero_lsb[a]);
    }
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = 0; j < 6; ++j) {
        fit.covariance[i * kMaxParameters + j] += apart[i] * apart[j];
      }
    }
    return {};
  };
  const auto merge = [&]() {
    out.cells = cells_of(blocks, used, &cell_of_block);
    out.directions = number_neighbourhoods(out.cells, from);
    weigh();
  };

  // Magnitude errors of all blocks, and what they say about scatter.
  std::vector<double> error_g(blocks.size());
  double noise = 0;
  const auto look_at_noise = [&]() {
    std::size_t count = 0;
    noise = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const StillBlock& block = blocks[i];
      if (used[i] == 0) {
        continue;
      }
      ++count;
      double variance = 0;
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double s = out.fit.calibration.sensitivity_g_per_lsb[a];
        const double along = out.fit.calibration.to_g(a, block.mean_lsb[a]) * s * block.sd_lsb[a];
        variance += along * along;
      }
      noise += variance / std::max(1, block.samples);
    }
    noise /= static_cast<double>(std::max<std::size_t>(1, count));
    out.noise_sd_mg = kMgPerG * std::sqrt(noise);
  };
  const auto look = [&]() {
    std::vector<double> cell_sum(out.cells.size(), 0);
    std::size_t count = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const StillBlock& block = blocks[i];
      const double temperature =
          block.temperature_c ? *block.temperature_c - out.reference_temperature_c : 0;
      error_g[i] =
          magnitude_g(out.fit, {block.mean_lsb, block.ramp_variance_lsb2, 1, temperature}) -
          options.gravity_g;
      if (used[i] == 0) {
        continue;
      }
      ++count;
      cell_sum[static_cast<std::size_t>(cell_of_block[i])] += error_g[i];
    }
    out.blocks_used = count;
    double within = 0;
    double square = 0;
    double absolute = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (used[i] == 0) {
        continue;
      }
      const auto k = static_cast<std::size_t>(cell_of_block[i]);
      const double off = error_g[i] - cell_sum[k] / out.cells[k].blocks;
      within += off * off;
      square += error_g[i] * error_g[i];
      absolute += std::abs(error_g[i]);
    }
    const double freedom = static_cast<double>(count) - static_cast<double>(out.cells.size());
    const double pooled = freedom > 0 ? within / freedom : 0;
    // Few repeats say little about scatter; then it is at least what the samples' noise makes.
    block_g2 = std::max(freedom >= 20 ? pooled : std::max(pooled, noise), 1e-14);
    out.block_sd_mg = kMgPerG * std::sqrt(block_g2);
    out.rms_mg = kMgPerG * std::sqrt(square / static_cast<double>(std::max<std::size_t>(1, count)));
    out.mean_error_mg = kMgPerG * absolute / static_cast<double>(std::max<std::size_t>(1, count));
  };
  // What the cells' scatter says about the misfit of a model, as a variance.
  const auto structure_of = [&](const LeastSquaresFit& fit, std::vector<double>& residual_g) {
    residual_g.clear();
    std::vector<double> white_g2;
    for (const DirectionCell& cell : out.cells) {
      residual_g.push_back(magnitude_g(fit, point_of(cell, 1)) - options.gravity_g);
      white_g2.push_back(block_g2 / cell.blocks + 1e-14);
    }
    const int redundancy = out.directions - fit.model.parameters();
    const double found = paule_mandel(residual_g, white_g2, fit.model.parameters());
    const double assumed = std::pow(options.assumed_structural_mg / kMgPerG, 2);
    const double freedom = std::max(0, redundancy);
    constexpr double kAssumedFreedom = 2;
    return redundancy >= 30
               ? found
               : (freedom * found + kAssumedFreedom * assumed) / (freedom + kAssumedFreedom);
  };
  std::vector<double> residual_g;
  const auto look_at_cells = [&]() {
    out.redundancy = out.directions - out.fit.model.parameters();
    structural_g2 = structure_of(out.fit, residual_g);
    out.structural_mg = kMgPerG * std::sqrt(structural_g2);
  };

  merge();
  if (out.cells.size() < static_cast<std::size_t>(least.model.parameters()) && !options.prior) {
    return fail(ErrorCode::bad_data, "fewer directions than constants to determine",
                "least squares", "lay the unit still on each of its six sides for a minute");
  }
  // The basin from a part of the cells, the minimum from all of them.
  {
    constexpr std::size_t kForTheBasin = 256;
    const std::size_t stride = 1 + out.cells.size() / kForTheBasin;
    std::vector<GravityPoint> part;
    for (std::size_t k = 0; k < out.cells.size(); k += stride) {
      part.push_back(point_of(out.cells[k], sigma_g[k]));
    }
    LeastSquaresOptions basin = least;
    basin.relative_step = 1e-6;
    basin.relative_gradient = 1e-4;
    SIXPOINT_ASSIGN(const LeastSquaresFit rough, least_squares(part, from, basin));
    if (rough.converged) {
      from = rough.calibration;
    }
    out.fit.starts = rough.starts;
    out.fit.starts_in_basin = rough.starts_in_basin;
  }
  const int starts = out.fit.starts;
  const int starts_in_basin = out.fit.starts_in_basin;
  least.starts = 1;
  SIXPOINT_CHECK(fit_once());
  look_at_noise();
  double outlier_limit_g = 0;
  for (int round = 0; round < 6; ++round) {
    look();
    look_at_cells();
    std::vector<double> sizes;
    sizes.reserve(residual_g.size());
    for (const double residual : residual_g) {
      sizes.push_back(std::abs(residual));
    }
    outlier_limit_g = std::max(options.outlier_g, 6 * 1.4826 * median(sizes));
    bool changed = false;
    std::size_t left_out = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const char keep = std::abs(error_g[i]) <= outlier_limit_g ? 1 : 0;
      changed = changed || keep != used[i];
      used[i] = keep;
      left_out += keep == 0 ? 1 : 0;
    }
    if (left_out * 2 > blocks.size()) {
      // The fit describes less than half of the data: there is no majority to keep to.
      std::fill(used.begin(), used.end(), 1);
      changed = true;
    }
    const Calibration before = from;
    if (changed) {
      merge();
    } else {
      weigh();
    }
    if (out.cells.size() < static_cast<std::size_t>(least.model.parameters()) && !options.prior) {
      return fail(ErrorCode::bad_data, "fewer directions than constants to determine",
                  "least squares", "lay the unit still on each of its six sides for a minute");
    }
    SIXPOINT_CHECK(fit_once());
    if (!changed && round > 0 && difference_over_sphere(before, from).worst_mg < 1e-3) {
      break;
    }
  }

  look();
  look_at_cells();
  out.fit.starts = starts;
  out.fit.starts_in_basin = starts_in_basin;
  const HeldOut plain = hold_out(out.cells, sigma_g, sigma_g, out.fit, options, out.directions);
  if (plain.valid()) {
    out.held_out_rms_mg = plain.rms_mg;
    out.held_out_directions = plain.directions;
  }
  double best_mg = plain.rms_mg;
  for (const FitModel candidate :
       {FitModel{true, false}, FitModel{false, true}, FitModel{true, true}}) {
    if (!options.try_richer_models || !plain.valid() ||
        (candidate.temperature && !(out.temperature_range_c >= 5)) ||
        out.directions < candidate.parameters() + 3) {
      continue;
    }
    BlockFit::Richer richer;
    LeastSquaresOptions with_more = least;
    with_more.model = candidate;
    double structure_g2 = structural_g2;
    std::vector<double> unused;
    bool converged = true;
    for (int round = 0; round < 3 && converged; ++round) {
      const auto own_sigma_g = sigmas(structure_g2);
      std::vector<GravityPoint> points;
      for (std::size_t k = 0; k < out.cells.size(); ++k) {
        points.push_back(point_of(out.cells[k], own_sigma_g[k]));
      }
      auto fit = least_squares(points, from, with_more);
      converged = fit && fit->converged;
      if (converged) {
        richer.fit = *fit;
        structure_g2 = structure_of(richer.fit, unused);
      }
    }
    if (!converged) {
      continue;
    }
    const HeldOut held =
        hold_out(out.cells, sigmas(structure_g2), sigma_g, richer.fit, options, out.directions);
    if (held.directions >= plain.directions * 3 / 4 && held.directions > 0 &&
        held.rms_mg < options.model_gain * best_mg) {
      best_mg = held.rms_mg;
      richer.structural_mg = kMgPerG * std::sqrt(structure_g2);
      richer.held_out_rms_mg = held.rms_mg;
      richer.held_out_directions = held.directions;
      SIXPOINT_CHECK(correlate(richer.fit, structure_g2));
      out.richer = richer;
    }
  }
  ZeroDriftOptions drift_options;
  drift_options.block_sd_g = std::sqrt(block_g2);
  drift_options.misfit_sd_g =
      (out.richer ? out.richer->structural_mg : out.structural_mg) / kMgPerG;
  drift_options.cross_axis_sd = options.cross_axis_sd;
  // A week of blocks need not be gone through for an answer that is not given.
  if (blocks.back().start_time_s - blocks.front().start_time_s <= drift_options.most_span_s) {
    std::vector<DriftPoint> drift_points;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (used[i] == 0) {
        continue;
      }
      const StillBlock& block = blocks[i];
      const double temperature =
          block.temperature_c ? *block.temperature_c - out.reference_temperature_c : 0;
      drift_points.push_back(
          {block.start_time_s, out.best().calibration.to_g(block.mean_lsb),
           magnitude_g(out.best(), {block.mean_lsb, block.ramp_variance_lsb2, 1, temperature}) -
               options.gravity_g,
           out.cells[static_cast<std::size_t>(cell_of_block[i])].neighbourhood});
    }
    out.drift = zero_drift(drift_points, drift_options);
  }
  SIXPOINT_CHECK(correlate(out.fit, structural_g2));
  for (std::size_t k = 0; k < out.cells.size(); ++k) {
    out.cell_residual_mg.push_back(kMgPerG * residual_g[k]);
    out.cell_sigma_mg.push_back(kMgPerG * sigma_g[k]);
  }
  out.blocks_left_out = blocks.size() - out.blocks_used;
  if (out.blocks_left_out > 0) {
    out.left_out_reason = fmt::format(
        "{} of {} still blocks were left out: more than {:.0f} mg from the magnitude "
        "that all others agree on",
        out.blocks_left_out, blocks.size(), kMgPerG * outlier_limit_g);
  }
  return out;
}

Result<StoredConstants> round_constants(const Calibration& calibration,
                                        std::span<const DirectionCell> cells,
                                        std::span<const double> sigma_mg, double gravity_g) {
  SIXPOINT_ASSIGN(const StoredConstants nearest, nearest_stored(calibration));
  PerAxis<int> span_low{};
  PerAxis<int> zero_low{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    span_low[a] = static_cast<int>(std::floor(2 / calibration.sensitivity_g_per_lsb[a]));
    zero_low[a] = static_cast<int>(std::floor(calibration.zero_lsb[a]));
  }
  // Squares of every cell, axis and choice once; the 16^3 combinations are then sums. Per axis:
  // floor and floor + 1 of both numbers, and one further on either side.
  constexpr std::size_t kChoices = 16;
  PerAxis<std::vector<double>> squares;
  for (std::size_t a = 0; a < kAxes; ++a) {
    squares[a].resize(cells.size() * kChoices);
    for (std::size_t c = 0; c < kChoices; ++c) {
      const double s = 2.0 / std::max(1, span_low[a] - 1 + static_cast<int>(c / 4));
      const double zero = zero_low[a] - 1 + static_cast<int>(c % 4);
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
  PerAxis<std::size_t> chosen = {5, 5, 5};
  const auto try_choice = [&](std::size_t x, std::size_t y, std::size_t z) {
    double cost = 0;
    for (std::size_t k = 0; k < cells.size() && cost < best; ++k) {
      const double residual =
          std::sqrt(squares[0][k * kChoices + x] + squares[1][k * kChoices + y] +
                    squares[2][k * kChoices + z]) -
          gravity_g;
      cost += weight[k] * residual * residual;
    }
    if (cost < best) {
      best = cost;
      chosen = {x, y, z};
    }
  };
  for (std::size_t x = 0; x < kChoices; ++x) {
    for (std::size_t y = 0; y < kChoices; ++y) {
      for (std::size_t z = 0; z < kChoices; ++z) {
        try_choice(x, y, z);
      }
    }
  }
  StoredConstants out = nearest;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const int span = span_low[a] - 1 + static_cast<int>(chosen[a] / 4);
    out.zero_lsb[a] = zero_low[a] - 1 + static_cast<int>(chosen[a] % 4);
    out.positive_lsb[a] = out.negative_lsb[a] + span;
  }
  SIXPOINT_CHECK(validate(out));
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

}  // namespace sixpoint::calib

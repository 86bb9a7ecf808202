#include "calib/block_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "calib/held_out.h"

namespace sixpoint::calib {

namespace {

// Before the data say otherwise: 3 mg of misfit, so that every direction counts nearly equally, and
// 1 mg of scatter between blocks.
constexpr double kFirstStructure_g2 = 9e-6;
constexpr double kFirstBlock_g2 = 1e-6;
constexpr double kLeastVariance_g2 = 1e-14;  // rounding of the arithmetic; no sigma is zero
// Blocks beyond what the cells take: fewer say too little about their own scatter.
constexpr double kLeastBlockFreedom = 20;
// The assumed misfit counts as much as this many directions, until there are enough.
constexpr double kAssumedFreedom = 2;
constexpr int kEnoughRedundancy = 30;
constexpr int kOutlierRounds = 6;
constexpr double kOutlierSigmas = 6;
constexpr double kSdPerMedian = 1.4826;  // of the size of a normal variable
constexpr double kSettled_mg = 1e-3;
constexpr std::size_t kCellsForBasin = 256;
// A richer model needs this much of the evidence to be tried.
constexpr double kLeastTemperatureRange_c = 5;
constexpr int kSpareDirections = 3;

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

// Finite, and at least one.
Status check_blocks(std::span<const StillBlock> blocks) {
  if (blocks.empty()) {
    return fail(ErrorCode::bad_data, "no still block", "least squares",
                "lay the unit still on each of its six sides for a minute");
  }
  for (const StillBlock& block : blocks) {
    if (!all_finite(block.mean_g, block.mean_lsb, block.ramp_variance_lsb2)) {
      return fail(ErrorCode::bad_data, "a still block is not a finite number", "least squares",
                  "the recording is damaged");
    }
  }
  return {};
}

// 0 where not every block has a temperature.
double temperature_range_c(std::span<const StillBlock> blocks) {
  double coldest = 1e9;
  double warmest = -1e9;
  for (const StillBlock& block : blocks) {
    if (!block.temperature_c || !std::isfinite(*block.temperature_c)) {
      return 0;
    }
    coldest = std::min(coldest, *block.temperature_c);
    warmest = std::max(warmest, *block.temperature_c);
  }
  return warmest - coldest;
}

// The steps of one fit, over the state that they share: which blocks are used, their cells, and
// what is known of the scatter so far.
class BlockFitter {
 public:
  BlockFitter(std::span<const StillBlock> blocks, const Calibration& start,
              const BlockFitOptions& options)
      : blocks_(blocks),
        options_(options),
        start_(start),
        used_(blocks.size(), 1),
        error_g_(blocks.size()) {
    least_.gravity_g = options.gravity_g;
    least_.prior = options.prior;
    out_.temperature_range_c = temperature_range_c(blocks);
    out_.reference_temperature_c = mean_temperature_c(blocks);
  }

  Result<BlockFit> run() {
    SIXPOINT_CHECK(merge());
    SIXPOINT_CHECK(find_basin());
    const LeastSquaresFit basin = out_.fit;
    least_.starts = 1;
    SIXPOINT_CHECK(fit_cells());
    measure_noise();
    SIXPOINT_CHECK(leave_out_outliers());
    measure_blocks();
    measure_cells();
    out_.fit.starts = basin.starts;
    out_.fit.starts_in_basin = basin.starts_in_basin;
    SIXPOINT_CHECK(try_richer_models());
    find_drift();
    SIXPOINT_CHECK(widen_covariance(out_.fit, structural_g2_));
    for (const double sigma_g : sigma_g_) {
      out_.cell_sigma_mg.push_back(kMgPerG * sigma_g);
    }
    return std::move(out_);
  }

 private:
  GravityPoint point_of_block(const StillBlock& block) const {
    const double above_c =
        block.temperature_c ? *block.temperature_c - out_.reference_temperature_c.value_or(0) : 0;
    return {block.mean_lsb, block.ramp_variance_lsb2, 1, above_c};
  }

  std::size_t cell_of(std::size_t block) const {
    return static_cast<std::size_t>(cell_of_block_[block]);
  }

  // Standard deviations of the cells' magnitudes. `correlated`: the misfit of cells next to each
  // other is the same and does not average out over them.
  std::vector<double> sigmas_g(double structure_g2, bool correlated = false) const {
    const auto sizes = neighbourhood_sizes(out_.cells, out_.directions);
    std::vector<double> values;
    values.reserve(out_.cells.size());
    for (std::size_t k = 0; k < out_.cells.size(); ++k) {
      values.push_back(std::sqrt(block_g2_ / out_.cells[k].blocks +
                                 structure_g2 * (correlated ? sizes[k] : 1) + kLeastVariance_g2));
    }
    return values;
  }

  // Cells of the blocks in use. Fails where they are fewer than the constants.
  Status merge() {
    out_.cells = cells_of(blocks_, used_, &cell_of_block_);
    out_.directions = number_neighbourhoods(out_.cells, start_);
    sigma_g_ = sigmas_g(structural_g2_);
    if (out_.cells.size() < static_cast<std::size_t>(least_.model.parameters()) &&
        !options_.prior) {
      return fail(ErrorCode::bad_data, "fewer directions than constants to determine",
                  "least squares", "lay the unit still on each of its six sides for a minute");
    }
    return {};
  }

  // The right minimum from a part of the cells; its bottom is found from all of them later.
  Status find_basin() {
    std::vector<GravityPoint> part;
    for (std::size_t k = 0; k < out_.cells.size(); k += 1 + out_.cells.size() / kCellsForBasin) {
      part.push_back(point_of(out_.cells[k], sigma_g_[k]));
    }
    LeastSquaresOptions rough = least_;
    rough.relative_step = 1e-6;
    rough.relative_gradient = 1e-4;
    SIXPOINT_ASSIGN(out_.fit, least_squares(part, start_, rough));
    if (out_.fit.converged) {
      start_ = out_.fit.calibration;
    }
    return {};
  }

  Status fit_cells() {
    SIXPOINT_ASSIGN(out_.fit, least_squares(points_of(out_.cells, sigma_g_), start_, least_));
    start_ = out_.fit.calibration;
    return {};
  }

  // What the samples' own noise makes of the blocks' magnitudes.
  void measure_noise() {
    for (const StillBlock& block : blocks_) {
      double variance = 0;
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double s = out_.fit.calibration.sensitivity_g_per_lsb[a];
        const double along = out_.fit.calibration.to_g(a, block.mean_lsb[a]) * s * block.sd_lsb[a];
        variance += along * along;
      }
      noise_g2_ += variance / std::max(1, block.samples);
    }
    noise_g2_ /= static_cast<double>(blocks_.size());
    out_.noise_sd_mg = kMgPerG * std::sqrt(noise_g2_);
  }

  // Magnitude errors of all blocks, and the scatter of those in use.
  void measure_blocks() {
    std::vector<double> cell_sum(out_.cells.size(), 0);
    out_.blocks_used = 0;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      error_g_[i] = magnitude_g(out_.fit, point_of_block(blocks_[i])) - options_.gravity_g;
      if (used_[i] != 0) {
        ++out_.blocks_used;
        cell_sum[cell_of(i)] += error_g_[i];
      }
    }
    double within = 0;
    double square = 0;
    double absolute = 0;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (used_[i] != 0) {
        const double off = error_g_[i] - cell_sum[cell_of(i)] / out_.cells[cell_of(i)].blocks;
        within += off * off;
        square += error_g_[i] * error_g_[i];
        absolute += std::abs(error_g_[i]);
      }
    }
    const double freedom =
        static_cast<double>(out_.blocks_used) - static_cast<double>(out_.cells.size());
    const double pooled = freedom > 0 ? within / freedom : 0;
    block_g2_ = std::max(freedom >= kLeastBlockFreedom ? pooled : std::max(pooled, noise_g2_),
                         kLeastVariance_g2);
    const auto count = static_cast<double>(std::max<std::size_t>(1, out_.blocks_used));
    out_.block_sd_mg = kMgPerG * std::sqrt(block_g2_);
    out_.rms_mg = kMgPerG * std::sqrt(square / count);
    out_.mean_error_mg = kMgPerG * absolute / count;
  }

  std::vector<double> cell_residuals_g(const LeastSquaresFit& fit) const {
    std::vector<double> residual_g;
    for (const DirectionCell& cell : out_.cells) {
      residual_g.push_back(magnitude_g(fit, point_of(cell, 1)) - options_.gravity_g);
    }
    return residual_g;
  }

  // What the cells' scatter says about the misfit of a model, as a variance.
  double structure_g2(const LeastSquaresFit& fit, const std::vector<double>& residual_g) const {
    std::vector<double> white_g2;
    for (const DirectionCell& cell : out_.cells) {
      white_g2.push_back(block_g2_ / cell.blocks + kLeastVariance_g2);
    }
    const int redundancy = out_.directions - fit.model.parameters();
    const double estimate = paule_mandel(residual_g, white_g2, fit.model.parameters());
    if (redundancy >= kEnoughRedundancy) {
      return estimate;
    }
    const double assumed = std::pow(options_.assumed_structural_mg / kMgPerG, 2);
    const double freedom = std::max(0, redundancy);
    return (freedom * estimate + kAssumedFreedom * assumed) / (freedom + kAssumedFreedom);
  }

  void measure_cells() {
    out_.redundancy = out_.directions - out_.fit.model.parameters();
    residual_g_ = cell_residuals_g(out_.fit);
    structural_g2_ = structure_g2(out_.fit, residual_g_);
    out_.structural_mg = kMgPerG * std::sqrt(structural_g2_);
  }

  // Which blocks are in use under this limit. True where that has changed.
  bool choose_blocks(double limit_g) {
    bool changed = false;
    std::size_t left_out = 0;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      const char keep = std::abs(error_g_[i]) <= limit_g ? 1 : 0;
      changed = changed || keep != used_[i];
      used_[i] = keep;
      left_out += keep == 0 ? 1 : 0;
    }
    if (left_out * 2 > blocks_.size()) {
      // The fit describes less than half of the data: there is no majority to follow.
      std::fill(used_.begin(), used_.end(), 1);
      return true;
    }
    return changed;
  }

  // Leaves out and fits in turn, until neither changes.
  Status leave_out_outliers() {
    double limit_g = 0;
    for (int round = 0; round < kOutlierRounds; ++round) {
      measure_blocks();
      measure_cells();
      std::vector<double> sizes = residual_g_;
      std::ranges::for_each(sizes, [](double& size) { size = std::abs(size); });
      limit_g = std::max(options_.outlier_g, kOutlierSigmas * kSdPerMedian * median(sizes));
      const bool changed = choose_blocks(limit_g);
      if (changed) {
        SIXPOINT_CHECK(merge());
      } else {
        sigma_g_ = sigmas_g(structural_g2_);
      }
      const Calibration before = start_;
      SIXPOINT_CHECK(fit_cells());
      if (!changed && round > 0 && difference_over_sphere(before, start_).worst_mg < kSettled_mg) {
        break;
      }
    }
    out_.blocks_left_out = static_cast<std::size_t>(std::count(used_.begin(), used_.end(), 0));
    if (out_.blocks_left_out > 0) {
      out_.left_out_reason = fmt::format(
          "{} of {} still blocks were left out: more than {:.0f} mg from the magnitude "
          "that all others agree on",
          out_.blocks_left_out, blocks_.size(), kMgPerG * limit_g);
    }
    return {};
  }

  // Every model is judged with the plain fit's weights.
  HeldOut predict_held_out(const std::vector<double>& fit_sigma_g,
                           const LeastSquaresFit& fit) const {
    return hold_out({out_.cells, out_.directions, fit_sigma_g, sigma_g_}, fit, options_.gravity_g,
                    options_.prior);
  }

  // A fit with more terms, and its misfit as a variance; nothing where it does not converge.
  struct Candidate {
    LeastSquaresFit fit;
    double misfit_g2 = 0;
  };
  std::optional<Candidate> fit_model(FitModel model) const {
    LeastSquaresOptions options = least_;
    options.model = model;
    Candidate out{{}, structural_g2_};
    for (int round = 0; round < 3; ++round) {
      auto fit = least_squares(points_of(out_.cells, sigmas_g(out.misfit_g2)), start_, options);
      if (!fit || !fit->converged) {
        return std::nullopt;
      }
      out = {*fit, structure_g2(*fit, cell_residuals_g(*fit))};
    }
    return out;
  }

  Status try_richer_models() {
    const HeldOut plain = predict_held_out(sigma_g_, out_.fit);
    if (plain.directions == 0) {
      return {};
    }
    out_.held_out_rms_mg = plain.rms_mg;
    out_.held_out_directions = plain.directions;
    double best_mg = plain.rms_mg;
    for (const FitModel model :
         {FitModel{true, false}, FitModel{false, true}, FitModel{true, true}}) {
      if (!options_.try_richer_models ||
          (model.temperature && !(out_.temperature_range_c >= kLeastTemperatureRange_c)) ||
          out_.directions < model.parameters() + kSpareDirections) {
        continue;
      }
      auto richer = fit_model(model);
      if (!richer) {
        continue;
      }
      const HeldOut held = predict_held_out(sigmas_g(richer->misfit_g2), richer->fit);
      if (held.directions >= plain.directions * 3 / 4 && held.directions > 0 &&
          held.rms_mg < options_.model_gain * best_mg) {
        best_mg = held.rms_mg;
        SIXPOINT_CHECK(widen_covariance(richer->fit, richer->misfit_g2));
        out_.richer = {richer->fit, kMgPerG * std::sqrt(richer->misfit_g2), held.rms_mg,
                       held.directions};
      }
    }
    return {};
  }

  void find_drift() {
    ZeroDriftOptions options;
    options.block_sd_g = std::sqrt(block_g2_);
    options.misfit_sd_g = (out_.richer ? out_.richer->structural_mg : out_.structural_mg) / kMgPerG;
    options.cross_axis_sd = options_.cross_axis_sd;
    if (blocks_.back().start_time_s - blocks_.front().start_time_s > options.most_span_s) {
      return;  // zero_drift() gives no answer for it either
    }
    std::vector<DriftPoint> points;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (used_[i] != 0) {
        points.push_back({blocks_[i].start_time_s,
                          out_.best().calibration.to_g(blocks_[i].mean_lsb),
                          magnitude_g(out_.best(), point_of_block(blocks_[i])) - options_.gravity_g,
                          out_.cells[cell_of(i)].neighbourhood, blocks_[i].duration_s});
      }
    }
    out_.drift = zero_drift(points, options);
  }

  // The covariance for what is not only scatter: neighbouring cells have the same misfit, and a
  // cross-axis term changes all directions at once. The term is estimated as far as the data show
  // it and bounded by its prior where they do not.
  Status widen_covariance(LeastSquaresFit& fit, double misfit_g2) const {
    LeastSquaresOptions options = least_;
    options.model = fit.model;
    options.starts = 1;
    const bool allow_cross_axis =
        !fit.model.cross_axis &&
        std::ranges::any_of(options_.cross_axis_sd, [](double sd) { return sd > 0; });
    if (allow_cross_axis) {
      options.model.cross_axis = true;
      options.cross_axis_sd = options_.cross_axis_sd;
    }
    SIXPOINT_ASSIGN(
        const LeastSquaresFit other,
        least_squares(points_of(out_.cells, sigmas_g(misfit_g2, true)), fit.calibration, options));
    if (!allow_cross_axis) {
      fit.covariance = other.covariance;
      return {};
    }
    // The same parameters, without the three cross-axis terms.
    const auto in_other = [](std::size_t i) { return i < 6 ? i : i + kAxes; };
    const auto parameters = static_cast<std::size_t>(fit.model.parameters());
    for (std::size_t i = 0; i < parameters; ++i) {
      for (std::size_t j = 0; j < parameters; ++j) {
        fit.covariance[i * kMaxParameters + j] = other.covariance_at(in_other(i), in_other(j));
      }
    }
    // The estimate stays the plain one; how far it lies from the other one is error as well.
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
  }

  std::span<const StillBlock> blocks_;
  const BlockFitOptions& options_;
  LeastSquaresOptions least_;
  Calibration start_;       // of the next fit: the last one's answer
  std::vector<char> used_;  // of each block
  std::vector<int> cell_of_block_;
  std::vector<double> error_g_;  // of each block's magnitude
  std::vector<double> sigma_g_;  // of each cell
  std::vector<double> residual_g_;
  double structural_g2_ = kFirstStructure_g2;
  double block_g2_ = kFirstBlock_g2;
  double noise_g2_ = 0;
  BlockFit out_;
};

}  // namespace

Result<BlockFit> fit_blocks(std::span<const StillBlock> blocks, const Calibration& start,
                            const BlockFitOptions& options) {
  SIXPOINT_CHECK(check_blocks(blocks));
  return BlockFitter(blocks, start, options).run();
}

}  // namespace sixpoint::calib

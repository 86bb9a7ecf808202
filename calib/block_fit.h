// Least squares on still blocks: weights, outliers and uncertainty from the data's own scatter.
//
//   SIXPOINT_ASSIGN(const BlockFit fit, fit_blocks(blocks, file_constants));
//   const Calibration& constants = fit.best().calibration;
//   const ConstantsUncertainty uncertainty = fit.best().standard_uncertainty();
//
// Thousands of blocks of one night in one pose are not thousands of independent measurements.
// Blocks of nearly one direction are merged into a cell (direction_cells.h); the variance of a
// cell's magnitude is taken as
//
//     block_sd^2 / blocks  +  structural^2
//
// The first term is the scatter of blocks within cells and averages out. The second is what the
// model does not describe (drift, cross-axis, curvature). It does not average out, and is estimated
// from the scatter between cells (Paule and Mandel 1982). With white noise alone it is zero and
// every block has equal weight, which is optimal. With a misfit it dominates and every direction
// has equal weight, so that a night on a table does not outweigh all other directions.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "calib/direction_cells.h"
#include "calib/least_squares.h"
#include "calib/still_blocks.h"
#include "calib/zero_drift.h"

namespace sixpoint::calib {

struct BlockFitOptions {
  double gravity_g = 1.0;
  std::optional<CalibrationPrior> prior;
  bool try_richer_models = true;  // cross-axis and temperature terms, where held-out error says so
  // A block is left out when its magnitude is off by more than this and by more than six times the
  // scatter of the cells. It is the paper's limit for a still sample.
  static constexpr double outlier_g = 0.015;
  // Six directions determine six constants and leave nothing to estimate the misfit from. Then this
  // is assumed for seating, drift between sides (0.5 mg/C, ADXL362) and curvature; with up to 30
  // directions to spare it is averaged with the estimate. Cross-axis terms come on top, below.
  static constexpr double assumed_structural_mg = 1.5;
  // Cross-axis terms may be there although the data do not show them. They change all directions at
  // once, and with few directions the sensitivities take them up with next to no residual: 8
  // directions chosen at random have hidden an error of 19 mg behind a residual of 1.6 mg. The
  // stated uncertainty of the six constants therefore allows for terms xy, xz, yz of these standard
  // deviations, as far as the data do not bound them more narrowly. 0 0 0: no allowance. Source:
  // root mean squares over four units with this sensor, -2.25 0.26 0.09 and -2.39 -0.89 -0.11 % in
  // the vendor's calibration of two CentrePoint Insights (calibration.json), 2.88 -0.15 0.35 % in a
  // wGT3X-BT and -1.96 -0.02 0.74 % in a GT9X (`solve` on the public recordings). The ADXL362's
  // datasheet gives 1 % without an axis.
  PerAxis<double> cross_axis_sd = {0.024, 0.005, 0.005};
  // A richer model must lower the held-out error by this factor.
  static constexpr double model_gain = 0.9;
};

struct BlockFit {
  // Six parameters: their best over the directions that were seen.
  LeastSquaresFit fit;
  std::vector<DirectionCell> cells;  // of the blocks that were used
  std::vector<double> cell_sigma_mg;
  std::size_t blocks_used = 0;
  std::size_t blocks_left_out = 0;
  std::string left_out_reason;  // empty when none was
  double block_sd_mg = 0;       // scatter of blocks within one direction
  double noise_sd_mg = 0;       // what the samples' own noise explains of it
  double structural_mg = 0;
  int directions = 0;  // more than 12 degrees apart
  int redundancy = 0;  // directions - 6: what is left to test the fit with
  // Mean of the blocks, which the constants hold for; absent where no temperature was measured.
  std::optional<double> reference_temperature_c;
  double temperature_range_c = 0;
  double rms_mg = 0;         // of the blocks used
  double mean_error_mg = 0;  // mean absolute error of the blocks used
  // Trends of the blocks used that best() leaves within single sides.
  std::optional<ZeroDrift> drift;
  // Directions predicted from fits that have not seen them. Counted are those that the others can
  // predict to 5 mg; without any, held_out_rms_mg is absent.
  std::optional<double> held_out_rms_mg;
  int held_out_directions = 0;
  // A model with more terms, where it predicts unseen directions clearly better. Then the residual
  // of six parameters comes from the sensor's cross-axis or temperature, and not from bad data.
  struct Richer {
    LeastSquaresFit fit;
    double structural_mg = 0;
    double held_out_rms_mg = 0;
    int held_out_directions = 0;
  };
  std::optional<Richer> richer;
  // The fit whose sensitivities and zeros to apply: the richer model's where there is one. In the
  // directions that it has seen, the plain fit makes up for part of what it cannot describe, and is
  // worse in the others: over 1000 simulated units with up to 1 % of cross-axis the richer model's
  // six constants are 1 to 3 mg from the truth, the plain fit's up to 20 mg.
  const LeastSquaresFit& best() const { return richer ? richer->fit : fit; }
};

// Fails as least_squares() does, and with bad_data when there are no blocks.
Result<BlockFit> fit_blocks(std::span<const StillBlock> blocks, const Calibration& start,
                            const BlockFitOptions& options = {});

}  // namespace sixpoint::calib

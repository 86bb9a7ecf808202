// Least squares on still blocks: weights, outliers and uncertainty from the data's own scatter.
//
// Thousands of blocks of one night in one pose are not thousands of independent facts about the
// constants. Blocks of nearly one direction are merged into a cell; the variance of a cell's
// magnitude is taken as
//
//     block_sd^2 / blocks  +  structural^2
//
// The first term is the scatter of blocks within cells and averages out. The second is what the
// model does not describe (drift, cross-axis, curvature), does not average out, and is estimated
// from the scatter between cells (Paule and Mandel 1982). With white noise alone it comes out zero
// and every block has equal weight, which is optimal; with a misfit it dominates and every
// direction has equal weight, so that a night on the bedside table does not drown the rest.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "calib/least_squares.h"
#include "calib/still_blocks.h"
#include "calib/zero_drift.h"

namespace sixpoint::calib {

// All blocks of one direction (about 5.6 degrees across) and, where known, temperature.
struct DirectionCell {
  PerAxis<double> mean_lsb{};
  PerAxis<double> variance_lsb2{};
  double blocks = 0;
  double temperature_c = 0;  // above BlockFit::reference_temperature_c
  int neighbourhood = 0;     // cells within 12 degrees of one another share a number
  double first_s = 0;        // start of the earliest and the latest block
  double last_s = 0;
};

struct BlockFitOptions {
  double gravity_g = 1.0;
  std::optional<CalibrationPrior> prior;
  bool try_richer_models = true;  // cross-axis and temperature terms, where held-out error says so
  // A block is left out when its magnitude is off by more than this and by more than six times the
  // scatter of the cells. It is the paper's own limit of what a still sample may be off.
  double outlier_g = 0.015;
  // Six directions determine six constants and leave nothing to estimate the misfit from; this is
  // assumed then, and blended in up to 30 directions of redundancy: seating, drift between sides
  // (0.5 mg/C, ADXL362) and curvature. Cross-axis terms are counted apart, below.
  double assumed_structural_mg = 1.5;
  // Cross-axis terms that the evidence does not admit may be there all the same. They bend all
  // directions at once, and few directions take them for sensitivities with next to no residual: 8
  // chosen at random have hidden 19 mg behind a residual of 1.6. The stated uncertainty of the six
  // holds for terms xy, xz, yz of these standard deviations, as far as the data do not bound them
  // more narrowly: root mean squares over four units with this sensor, which are -2.25 0.26 0.09
  // and -2.39 -0.89 -0.11 % in the vendor's own calibration of two CentrePoint Insights
  // (calibration.json), 2.88 -0.15 0.35 % in a wGT3X-BT and -1.96 -0.02 0.74 % in a GT9X (solve on
  // the public recordings). The ADXL362's datasheet has 1 % without saying which. Zeros: the six
  // are believed to be all.
  PerAxis<double> cross_axis_sd = {0.024, 0.005, 0.005};
  // A richer model must lower the held-out error by this factor.
  double model_gain = 0.9;
};

struct BlockFit {
  // Six parameters: their best over the directions that were seen.
  LeastSquaresFit fit;
  std::vector<DirectionCell> cells;  // of the blocks that were used
  std::vector<double> cell_residual_mg;
  std::vector<double> cell_sigma_mg;
  std::size_t blocks_used = 0;
  std::size_t blocks_left_out = 0;
  std::string left_out_reason;  // empty when none was
  double block_sd_mg = 0;       // scatter of blocks within one direction
  double noise_sd_mg = 0;       // what the samples' own noise explains of it
  double structural_mg = 0;
  int directions = 0;                  // more than 12 degrees apart
  int redundancy = 0;                  // directions - 6: what is left to contradict the fit
  double reference_temperature_c = 0;  // mean of the blocks
  double temperature_range_c = 0;
  double rms_mg = 0;         // of the blocks used
  double mean_error_mg = 0;  // mean absolute error of the blocks used
  // Trends of the blocks used that best() leaves within single sides.
  std::optional<ZeroDrift> drift;
  // Directions predicted from fits that have not seen them. Counted are those that the others can
  // predict to 5 mg; without any, held_out_rms_mg is absent.
  std::optional<double> held_out_rms_mg;
  int held_out_directions = 0;
  // A model with more terms, where it predicts unseen directions clearly better: the evidence that
  // what six parameters leave is the sensor's cross-axis or temperature, and not bad data. Its
  // sensitivities and zeros are the sensor's own.
  struct Richer {
    LeastSquaresFit fit;
    double structural_mg = 0;
    double held_out_rms_mg = 0;
    int held_out_directions = 0;
  };
  std::optional<Richer> richer;
  // Whose sensitivities and zeros to apply: the richer model's where there is one. The plain fit
  // makes up, in the directions it has seen, for part of what it cannot describe, and pays for it
  // in the others: over 1000 simulated units with up to 1 % of cross-axis the richer model's own
  // six are 1 to 3 mg from the truth where the plain fit's are up to 20.
  const LeastSquaresFit& best() const { return richer ? richer->fit : fit; }
};

// Fails as least_squares() does, and with bad_data when there are no blocks.
Result<BlockFit> fit_blocks(std::span<const StillBlock> blocks, const Calibration& start,
                            const BlockFitOptions& options = {});

// The merging alone; `used` may be empty (all) or say for each block whether to take it.
std::vector<DirectionCell> cells_of(std::span<const StillBlock> blocks,
                                    std::span<const char> used = {},
                                    std::vector<int>* cell_of_block = nullptr);

// The nine integers for a unit's memory: among the neighbours of the estimate (difference of
// positive and negative, and zero, of every axis) those with the smallest residual over the cells.
Result<StoredConstants> round_constants(const Calibration& calibration,
                                        std::span<const DirectionCell> cells,
                                        std::span<const double> sigma_mg, double gravity_g);

// Root mean square distance of the cells' magnitude from gravity, every neighbourhood equal, in mg.
double cells_rms_mg(std::span<const DirectionCell> cells, const Calibration& calibration,
                    double gravity_g);

}  // namespace sixpoint::calib

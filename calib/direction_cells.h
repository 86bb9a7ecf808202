// Direction cells: still blocks of nearly one direction merged into one point, and the nine
// integers that fit such points best.
//
//   const std::vector<DirectionCell> cells = cells_of(blocks);
//   const double before_mg = cells_rms_mg(cells, file_constants, 1.0);
//
// A cell is about 5.6 degrees across; cells within 12 degrees of one another share the number of
// their neighbourhood, which counts as one direction. Readings are in raw counts (LSB), gravity in
// standard g, times in seconds as the blocks have them. Pure functions: any thread may call them.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "calib/constants.h"
#include "calib/least_squares.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

// All blocks of one direction and, where known, of one temperature (bins of 1 C).
struct DirectionCell {
  PerAxis<double> mean_lsb{};
  PerAxis<double> variance_lsb2{};
  double blocks = 0;
  double temperature_c = 0;  // above the mean of all blocks (mean_temperature_c)
  int neighbourhood = 0;     // set by number_neighbourhoods
};

// For least_squares(), with the standard deviation of its magnitude.
GravityPoint point_of(const DirectionCell& cell, double sigma_g);
std::vector<GravityPoint> points_of(std::span<const DirectionCell> cells,
                                    std::span<const double> sigma_g);

// Over the blocks that have a temperature; nothing if none has. Constants without temperature terms
// hold for it.
std::optional<double> mean_temperature_c(std::span<const StillBlock> blocks);

// `used` may be empty (all blocks) or hold a flag for each block. `cell_of_block` receives the
// number of each block's cell, -1 for a block that is not used.
std::vector<DirectionCell> cells_of(std::span<const StillBlock> blocks,
                                    std::span<const char> used = {},
                                    std::vector<int>* cell_of_block = nullptr);

// Numbers the neighbourhoods, beginning with the fullest cell. Returns how many there are.
int number_neighbourhoods(std::vector<DirectionCell>& cells, const Calibration& calibration);

// How many cells each cell's neighbourhood holds.
std::vector<double> neighbourhood_sizes(std::span<const DirectionCell> cells, int neighbourhoods);

// Root mean square distance of the cells' magnitude from gravity, every neighbourhood equal, in mg.
double cells_rms_mg(std::span<const DirectionCell> cells, const Calibration& calibration,
                    double gravity_g);

// The nine integers for a unit's memory: among the neighbours of the estimate (difference of
// positive and negative, and zero, of every axis) those with the smallest residual over the cells.
// `sigma_mg` weights the cells; empty: all equal. Fails as validate() does.
Result<StoredConstants> round_constants(const Calibration& calibration,
                                        std::span<const DirectionCell> cells,
                                        std::span<const double> sigma_mg, double gravity_g);

}  // namespace sixpoint::calib

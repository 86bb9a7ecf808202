// How a zero follows temperature, measured on a unit that was not moved.
//
//   if (const auto drift = temperature_drift(blocks, file_constants)) {
//     const double x_mg_per_c = drift->zero_mg_per_c[0];
//   }
//
// Gravity's magnitude shows only the drift along the vertical, and with it least squares can free
// temperature terms only where many poses meet many temperatures (FitModel::temperature). A unit in
// a chamber lies in one pose for hours; there every axis shows its own drift, as long as the unit
// is not moved. Blocks are therefore divided into stretches wherever the mean jumps from one block
// to the next. Each stretch has its own level, and all share one slope:
//
//     mean_g(block) = level(stretch) + slope * (temperature - mean temperature of the stretch)
#pragma once

#include <optional>
#include <span>

#include "base/measure.h"
#include "calib/constants.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

struct TemperatureDrift {
  int stretches = 0;
  std::size_t blocks = 0;
  PerAxis<double> zero_mg_per_c{};
  // From the stretches' disagreement with one straight line, blocks of one degree counting once:
  // what hysteresis and settling leave is not independent from block to block.
  PerAxis<double> standard_uncertainty_mg_per_c{};
  double low_c = 0;
  double high_c = 0;
};

// In order of time. Nothing when no stretch with temperatures spans least_range_c.
std::optional<TemperatureDrift> temperature_drift(std::span<const StillBlock> blocks,
                                                  const Calibration& calibration);

}  // namespace sixpoint::calib

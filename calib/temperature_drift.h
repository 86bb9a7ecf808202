// How a zero follows temperature, seen in a unit that was left where it lay.
//
// Gravity's magnitude shows only the drift along the vertical, and with it least squares can free
// temperature terms only where many poses meet many temperatures (FitModel::temperature). A unit in
// a chamber lies in one pose for hours; there every axis shows its drift by itself, as long as
// nobody touches the unit. Blocks are therefore parted into stretches wherever the mean jumps
// between one block and the next, each stretch keeps its own level, and the slopes of all of them
// are pooled:
//
//     mean_g(block) = level(stretch) + slope * (temperature - mean temperature of the stretch)
#pragma once

#include <optional>
#include <span>

#include "base/measure.h"
#include "calib/constants.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

struct TemperatureDriftOptions {
  // A jump of more than this from one block to the next on any axis: the unit was moved. Under a
  // chamber's fan (40 mg) means of 4 s scatter by 3.5 mg; 4 s of warming make 0.02 mg.
  double moved_g = 0.015;
  // A stretch must have seen this much to count: over less, settling and creep pass for drift.
  double least_range_c = 3.0;
};

struct TemperatureDrift {
  PerAxis<double> zero_mg_per_c{};
  // From the stretches' disagreement with one straight line, blocks of one degree counting once:
  // what hysteresis and settling leave is not independent from block to block.
  PerAxis<double> standard_uncertainty_mg_per_c{};
  double low_c = 0;
  double high_c = 0;
  int stretches = 0;
  std::size_t blocks = 0;
};

// In order of time. Nothing when no stretch with temperatures spans least_range_c.
std::optional<TemperatureDrift> temperature_drift(std::span<const StillBlock> blocks,
                                                  const Calibration& calibration,
                                                  const TemperatureDriftOptions& options = {});

}  // namespace sixpoint::calib

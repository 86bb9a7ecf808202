// The still periods of a plain recording (.gt3x or .agdc), with what its header says of the unit.
//
//   SIXPOINT_ASSIGN(const RecordingRests recording, read_rests(files, "unit.gt3x"));
//   for (const Rest& rest : recording.rests) {
//     const double length_g = rest.mean_g.norm();  // 1 at rest, if the constants are right
//   }
//
// A period is a block of four seconds on a fixed grid, in g by the recording's own constants.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/result.h"
#include "base/time.h"

namespace sixpoint::gap {

struct Rest {
  double time_s = 0;  // Unix time of the first sample
  Eigen::Vector3d mean_g = Eigen::Vector3d::Zero();
  std::optional<double> temperature_c;
  bool quiet = true;  // noise alone; else something hums (a climate chamber), and means still count
};

struct RecordingRests {
  std::string serial, firmware;
  std::optional<UtcTime> calibration_time;
  std::vector<Rest> rests;  // in order of time, 200,000 at most
};

// no_input, bad_data as of gt3x::Recording; bad_data for the old form without a log.
Result<RecordingRests> read_rests(FileSystem& files, const std::string& path);

}  // namespace sixpoint::gap

// Constants from six faces of known direction (the paper's third method).
#pragma once

#include <vector>

#include "calib/constants.h"
#include "station/jig_run.h"

namespace sixpoint::station {

struct PoseFit {
  // Eq. 1-3 to the letter: sensitivity from the readings at +1 g and -1 g, zero from the four poses
  // in which the axis lies level.
  calib::Calibration paper;
  // The least-squares line through all six readings of an axis: the same sensitivity, zero as their
  // mean.
  calib::Calibration least_squares;
  calib::ConstantsUncertainty uncertainty;  // of the least-squares pair
};

// bad_data unless each face is there once and every axis reads more when it points up.
Result<PoseFit> fit_poses(const std::vector<PoseReading>& faces, double gravity_g);

// The nine integers for the unit's memory: among the neighbours of the estimate those with the
// smallest residual over the faces.
Result<StoredConstants> round_for_unit(const calib::Calibration& calibration,
                                       const std::vector<PoseReading>& faces, double gravity_g);

}  // namespace sixpoint::station

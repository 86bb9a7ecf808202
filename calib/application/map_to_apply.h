// Which map a file gets: six constants, or the map with cross-axis terms.
//
//   const MapChoice choice = map_to_apply(record);
//   choice.cross_axis;  // apply record.cross_axis instead of record.calibration?
//   choice.why;         // for people; empty where the record has no cross-axis terms
//
// | record.cross_axis                           | applied       | said                      |
// |---------------------------------------------|---------------|---------------------------|
// | absent                                      | six constants | nothing                   |
// | not verified                                | six constants | that it is not verified   |
// | fewer than 3 unseen directions              | six constants | that they were not tested |
// | not better by a tenth in unseen directions  | six constants | both errors               |
// | verified, better by a tenth                 | the map       | both errors               |
//
// The six constants of a record are the best six by themselves (best_six.h): what has no place for
// more, as a unit's memory, is right with them. Pure function.
#pragma once

#include <string>

#include "calib/constants.h"

namespace sixpoint::calib {

struct MapChoice {
  bool cross_axis = false;
  std::string why;
};

MapChoice map_to_apply(const ConstantsRecord& record);

}  // namespace sixpoint::calib

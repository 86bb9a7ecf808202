// Which map a file or a unit gets: six constants, or the map with cross-axis terms.
//
//   const MapChoice choice = map_to_apply(record, MapTarget::file);
//   choice.cross_axis;  // apply record.cross_axis instead of record.calibration?
//   choice.why;         // for people; empty where the record has no cross-axis terms
//
// | record.cross_axis                 | target      | applied       | said                        |
// |-----------------------------------|-------------|---------------|-----------------------------|
// | absent                            | any         | six constants | nothing                     |
// | there                             | unit_memory | six constants | a unit cannot hold them     |
// | not verified                      | file        | six constants | that it is not verified     |
// | fewer than 3 unseen directions    | file        | six constants | that they were not tested   |
// | not better by a tenth in unseen   | file        | six constants | both errors                 |
// | directions                        |             |               |                             |
// | verified, better by a tenth       | file        | the map       | both errors                 |
//
// The six constants of a record are the best six by themselves (best_six.h). Whatever takes six
// constants is right with them. Pure function.
#pragma once

#include <string>

#include "calib/constants.h"

namespace sixpoint::calib {

enum class MapTarget {
  file,         // samples that are computed anew: any affine map will do
  unit_memory,  // nine integers
};

struct MapChoice {
  bool cross_axis = false;
  std::string why;
};

MapChoice map_to_apply(const ConstantsRecord& record, MapTarget target);

}  // namespace sixpoint::calib

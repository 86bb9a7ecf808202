// Which sides of a calibration file are asked for again, alone; what was recorded of the others
// stays.
//
//   const std::vector<device::Pose> again = sides_to_repeat(solved, /*times_asked_again=*/0, 2);
//
// | the recording                                  | times asked again | answer                      |
// |------------------------------------------------|-------------------|-----------------------------|
// | gives verified constants                       | any               | none                        |
// | lacks still readings of some sides: moved, too | below the limit   | these sides, in the order   |
// | short, another side, clipped                   |                   | of device::kPoses           |
// | lacks them                                     | the limit         | none: it is judged as it is |
// | has all six sides, and its constants are not   | any               | none: another try gives     |
// | verified                                       |                   | nothing else                |
//
// A unit that records sends no live samples: the sides are judged when the recording is there. A
// pure function.
#pragma once

#include <vector>

#include "calib/solve.h"
#include "device/jig.h"

namespace sixpoint::station {

std::vector<device::Pose> sides_to_repeat(const calib::SolveReport& solved, int times_asked_again,
                                          int most_times);

}  // namespace sixpoint::station

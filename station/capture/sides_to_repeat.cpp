#include "station/capture/sides_to_repeat.h"

#include <algorithm>

namespace sixpoint::station {

std::vector<device::Pose> sides_to_repeat(const calib::SolveReport& solved, int times_asked_again,
                                          int most_times) {
  std::vector<device::Pose> sides;
  if (solved.usable() || times_asked_again >= most_times) {
    return sides;
  }
  const auto& missing = solved.verification.missing_directions;
  for (const device::Pose side : device::kPoses) {
    if (std::find(missing.begin(), missing.end(), device::to_string(side)) != missing.end()) {
      sides.push_back(side);
    }
  }
  return sides;
}

}  // namespace sixpoint::station

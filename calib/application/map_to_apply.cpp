#include "calib/application/map_to_apply.h"

#include <fmt/format.h>

#include "calib/verify.h"

namespace sixpoint::calib {

MapChoice map_to_apply(const ConstantsRecord& record) {
  if (!record.cross_axis) {
    return {};
  }
  const CrossAxisMap& map = *record.cross_axis;
  if (!map.verified) {
    return {false, "the cross-axis terms are not verified: the six constants are used"};
  }
  if (map.unseen_directions < VerificationLimits::held_out_directions) {
    return {false,
            "the cross-axis terms were not tested on unseen directions: the six constants are "
            "used"};
  }
  const bool better = map.unseen_mg < BlockFitOptions::model_gain * map.six_unseen_mg;
  return {better,
          fmt::format("cross-axis terms are {}: in unseen directions, over the time at rest, "
                      "{:.1f} mg with them, {:.1f} mg with six constants",
                      better ? "applied" : "not applied", map.unseen_mg, map.six_unseen_mg)};
}

}  // namespace sixpoint::calib

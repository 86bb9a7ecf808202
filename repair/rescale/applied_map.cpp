#include "repair/rescale/applied_map.h"

#include <algorithm>

#include "calib/application/map_to_apply.h"
#include "calib/application/sample_uncertainty.h"

namespace sixpoint::repair {
namespace {

bool states_uncertainty(const calib::ConstantsUncertainty& uncertainty) {
  return std::ranges::max(uncertainty.zero_mg) > 0 ||
         std::ranges::max(uncertainty.sensitivity_relative) > 0;
}

}  // namespace

AppliedMap applied_map(const calib::ConstantsRecord& record, const Survey& survey) {
  const calib::MapChoice choice = calib::map_to_apply(record);
  AppliedMap out{record.calibration, {}, choice.why, std::nullopt};
  calib::RepairedBy by;
  by.constants = record.uncertainty;
  if (choice.cross_axis) {
    out.calibration = record.cross_axis->calibration;
    out.cross_axis = record.cross_axis->cross_axis;
    by.constants = record.cross_axis->uncertainty;
    by.cross_axis_sd = record.cross_axis->cross_axis_sd;
  } else if (record.cross_axis && record.cross_axis->verified) {
    by.cross_axis_ignored = record.cross_axis->cross_axis;
  }
  if (!states_uncertainty(by.constants)) {
    return out;
  }
  by.fresh = out.calibration;
  by.accel_scale_lsb_per_g = survey.accel_scale_lsb_per_g;
  by.affine = !survey.plausibility.plausible();
  for (const StoredConstants& stored : survey.constants) {
    const auto before = calib::calibration_from(stored);
    if (!before) {
      continue;  // Survey::constants_problem: such a file is not repaired
    }
    by.before = *before;
    const PerAxis<double> mg = calib::sample_uncertainty(by).mg;
    if (!out.sample_uncertainty_mg) {
      out.sample_uncertainty_mg = mg;
    }
    for (std::size_t a = 0; a < kAxes; ++a) {
      (*out.sample_uncertainty_mg)[a] = std::max((*out.sample_uncertainty_mg)[a], mg[a]);
    }
  }
  return out;
}

SensorsOwn sensors_own(const calib::Calibration& six,
                       const calib::ConstantsUncertainty& uncertainty,
                       const std::optional<calib::CrossAxisMap>& map) {
  if (map && map->verified) {
    return {map->calibration, map->uncertainty};
  }
  return {six, uncertainty};
}

}  // namespace sixpoint::repair

// The JSON of the report of solve_six_poses().
#include <nlohmann/json.hpp>

#include "calib/poses/six_pose.h"

namespace sixpoint::calib {

namespace {

using Json = nlohmann::ordered_json;

}  // namespace

Json to_json(const SixPoseSolution& solution) {
  return {{"constants", to_json(solution.calibration, solution.stored)},
          {"standard_uncertainty", to_json(solution.uncertainty)},
          {"own_rms_mg", solution.own_rms_mg},
          {"choosing_rms_mg", number_or_null(solution.choosing_rms_mg)},
          {"held_out_rms_mg", number_or_null(solution.held_out_rms_mg)},
          {"held_out_worst_mg", number_or_null(solution.held_out_worst_mg)},
          {"rounded_rms_mg", number_or_null(solution.rounded_rms_mg)}};
}

Json to_json(const AllAxesSolution& all_axes) {
  Json json = to_json(all_axes.six);
  json["lsb_per_g"] = all_axes.lsb_per_g;
  json["cross_axis"] = all_axes.cross_axis;
  json["rotation_deg"] = all_axes.rotation_deg;
  json["degrees_of_freedom"] = all_axes.degrees_of_freedom;
  return json;
}

Json to_json(const SixPoseReport& report) {
  Json json = {{"verified", report.verified},
               {"reasons", report.reasons},
               {"missing_directions", report.missing_directions},
               {"gravity_m_per_s2", report.gravity.m_per_s2}};
  if (!report.missing_directions.empty()) {
    return json;
  }
  Json poses = Json::array();
  for (const PoseResidual& pose : report.poses) {
    poses.push_back({{"pose", pose.side},
                     {"magnitude_mg", pose.magnitude_mg},
                     {"tilt_deg", pose.tilt_deg},
                     {"held_out", pose.held_out},
                     {"chose", pose.chose}});
  }
  json.update({{"chosen", to_string(report.chosen)},
               {"better_by_mg", report.better_by_mg},
               {"letter", to_json(report.as_published)},
               {"pair", to_json(report.per_axis)},
               {"vector", to_json(report.all_axes)},
               {"midpoint_minus_zero_lsb", report.midpoint_minus_zero_lsb},
               {"poses", std::move(poses)}});
  return json;
}

}  // namespace sixpoint::calib

// What is applied to one file, of constants that may hold cross-axis terms, and how sure its
// samples are then.
//
//   const AppliedMap map = applied_map(record, survey);
//   RescaledLogOptions options;
//   options.fresh = map.calibration;
//   options.cross_axis = map.cross_axis;
//   map.sample_uncertainty_mg;  // X Y Z, in the report and in the mark
//
// calib/application/map_to_apply.h decides between the six constants and the cross-axis terms,
// calib/application/sample_uncertainty.h has the formula. Where the constants state no uncertainty,
// none is stated for the samples. Where a file holds several sets of constants, the largest holds.
#pragma once

#include <optional>
#include <string>

#include "calib/constants.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

struct AppliedMap {
  calib::Calibration calibration;
  PerAxis<double> cross_axis{};  // all zero: the six constants alone
  std::string why;               // for people; empty where the constants hold no cross-axis terms
  std::optional<PerAxis<double>> sample_uncertainty_mg;

  bool has_terms() const { return cross_axis != PerAxis<double>{}; }
};

AppliedMap applied_map(const calib::ConstantsRecord& record, const Survey& survey);

// The sensor's own six constants, with their uncertainty: those of two sources are compared by
// these, because the best six of one day are not those of another (calib/best_six.h).
struct SensorsOwn {
  calib::Calibration calibration;
  calib::ConstantsUncertainty uncertainty;
};
SensorsOwn sensors_own(const calib::Calibration& six,
                       const calib::ConstantsUncertainty& uncertainty,
                       const std::optional<calib::CrossAxisMap>& map);

}  // namespace sixpoint::repair

// Diagnosis of a plain recording, without a protocol: still periods, temperatures and the header.
//
// The length of the measured vector at rest must be 1 g. That settles whether the constants belong
// to the acquisition mode in force (16CPAN03), and, where the file holds temperatures (.agdc), how
// the zero follows them. Everything else needs a protocol and is listed as not observable.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/env.h"
#include "gap/diagnose.h"
#include "gap/diagnosis.h"

namespace sixpoint::gap {

// no_input, bad_data as of gt3x::Recording; bad_data for the old form without a log.
Result<Diagnosis> diagnose_plain(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options = {});

// Gain, zero and cross-axis terms from the length of vectors at rest in many directions: `raw` in
// counts or any unit, one row per position, `gravity` in the unit wanted. Nine parameters, or six
// without the cross-axis terms, by Gauss-Newton on the length; the symmetric part only, since a
// rotation does not change lengths. bad_data for fewer than twelve positions or directions that do
// not span.
enum class CrossAxis { none, symmetric };
struct LengthFit {
  Eigen::Matrix3d sensitivity;  // symmetric: g = sensitivity * (raw - zero)
  Eigen::Vector3d zero;
  Eigen::Vector3d cross;  // yz xz xy: off-diagonal over the mean of the two diagonal terms
  Eigen::Vector3d cross_sd;
  double residual = 0;  // rms of length less gravity
};
Result<LengthFit> fit_lengths(const std::vector<Eigen::Vector3d>& raw, double gravity,
                              CrossAxis cross_axis = CrossAxis::symmetric);

}  // namespace sixpoint::gap

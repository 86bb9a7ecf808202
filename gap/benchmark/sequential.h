// Baseline: sequential residual regression. Dwell means alone, one effect after the other until
// what is left is noise, as people do it by hand.
//
//   SIXPOINT_ASSIGN(const Bundle bundle, read_bundle(env.files, "b1c2d3e4"));
//   const Answer answer = answer_by_regression(bundle, "b1c2d3e4");
//
// Means of 10 s at rest, less the pose's gravity, are regressed on a gain and an offset per axis
// (least squares, weights from 3.9 and 5.5 mg of noise and 0.17 mg of seating). While chi-square
// exceeds its expectation by more than 3 standard deviations, the effect that lowers it most joins,
// where that is more than its parameters cost (Schwarz, "Estimating the Dimension of a Model",
// 1978). What is then left beyond 5.5 standard deviations is unknown, where a cell of axis and
// segment is 3 sigma off. Ten effects of the means are known; noise, lines, timing and digital
// effects are not, nor bad samples. It shares nothing with the diagnosis but the reader of bundles.
#pragma once

#include <string>

#include "gap/benchmark/answers.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

Answer answer_by_regression(const Bundle& bundle, const std::string& name);

}  // namespace sixpoint::gap

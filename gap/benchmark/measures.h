// Measures of answers that may abstain, each in one place, with its source.
//
//   const std::vector<Ranked> known = {{0.9, true}, {0.4, false}};
//   const std::vector<double> unknown = {0.5};
//   right_above(known, unknown);  // 0.5: one of two is right, and above what is unknown
//   area_under_risk_coverage(known);
//
// Plain functions of numbers; NaN where a measure is not defined (nothing to count). A confidence
// must be finite. Ties count half.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace sixpoint::gap {

inline constexpr double kNotDefined = std::numeric_limits<double>::quiet_NaN();

struct Ranked {
  double confidence = 0;
  bool right = false;
};

// The mean over all pairs (i of `known`, j of `unknown`) of [i is right] [confidence_i > u_j].
//
// With minus the score of being unknown as confidence this is OpenAUC (Wang, Xu, Yang, He, Cao and
// Huang, "OpenAUC: Towards AUC-Oriented Open-Set Recognition", NeurIPS 2022, definition 1). With
// the confidence in the class that is named it is the area under the OSCR curve, the rate of
// correct classification over the rate of false positives (Dhamija, Guenther and Boult, "Reducing
// Network Agnostophobia", NeurIPS 2018), by trapezoids.
double right_above(std::span<const Ranked> known, std::span<const double> unknown);

// AUGRC: the area under the generalised risk (share of all answers that are accepted and wrong)
// over coverage (share that is accepted), by trapezoids between distinct confidences; 0 is best,
// 0.5 worst (Traub et al., "Overcoming Common Flaws in the Evaluation of Selective Classification
// Systems", NeurIPS 2024).
double area_under_risk_coverage(std::span<const Ranked> answers);

struct Said {
  std::string label;
  double probability = 0;
  bool right = false;
};

// The sum over labels and tenths of probability of share |mean probability - share right|.
//
// Top-label calibration: labels apart (Gupta and Ramdas, "Top-label calibration and
// multiclass-to-binary reductions", ICLR 2022, definition 2, with bins of equal width). With one
// label for all it is the expected calibration error (Guo et al., "On Calibration of Modern Neural
// Networks", ICML 2017). Few answers in a bin raise it: with n answers of a label the error of a
// perfect method is about 0.4 / sqrt(n) near probability 0.5, and less near 0 and 1.
double calibration_error(std::span<const Said> said);

struct Sized {
  double size = 0;  // over the bound; positive
  bool named = false;
};

// The size at which half are named: logit P(named) = a + b log(size), by maximum likelihood
// (Berkson 1944; Newton's steps) over sizes from 1/8 to 8, exp(-a / b). A penalty of b^2 / 200
// keeps the slope finite where all small ones are missed and all large ones named. NaN where b is
// not positive, or fewer than four are left.
double half_named_at(std::span<const Sized> effects);

// The percentile interval, 95 %, of a statistic over bundles that are drawn with replacement
// (Efron, "Bootstrap Methods: Another Look at the Jackknife", 1979). `statistic` gets the numbers
// of the bundles drawn, `count` of them. Draws without a value are left out; both ends are NaN
// where that is more than half. The same seed gives the same interval.
using Statistic = std::function<double(std::span<const std::size_t>)>;
std::array<double, 2> bootstrap_interval(std::size_t count, const Statistic& statistic,
                                         std::uint64_t seed, std::size_t draws = 1000);

}  // namespace sixpoint::gap

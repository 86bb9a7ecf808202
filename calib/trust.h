// Least squares and the genetic algorithm solve the same problem: which of the two to trust.
//
//   const Trust trust = whom_to_trust(evidence);
//   trust.trusted;  // Trusted::both where they agree to 1 mg
//   trust.why;      // one sentence for people
//
// | least squares | genetic algorithm | apart     | error over directions    | trusted           |
// |---------------|-------------------|-----------|--------------------------|-------------------|
// | not converged | not settled       | -         | -                        | neither           |
// | not converged | settled           | -         | -                        | genetic           |
// | converged     | not settled       | -         | -                        | least_squares     |
// | converged     | settled           | <= 1 mg   | -                        | both              |
// | converged     | settled           | more      | genetic's smaller by 10 %| genetic           |
// | converged     | settled           | more      | otherwise                | least_squares     |
//
// `apart` is the root mean square over the sphere of what the two make of a still unit's magnitude.
// The error is that of the still blocks by each, with cross-axis and temperature terms where they
// are admitted, every direction equal: neither of the two minimises exactly that. A trusted answer
// is not a verified one (verify.h). Pure function.
#pragma once

#include <string>
#include <string_view>

namespace sixpoint::calib {

enum class Trusted { both, least_squares, genetic, neither };
std::string_view to_string(Trusted trusted);

struct TrustEvidence {
  bool converged = false;
  bool settled = false;
  double apart_mg = 0;
  double least_squares_error_mg = 0;
  double genetic_error_mg = 0;
};

struct Trust {
  static constexpr double agreement_mg = 1.0;  // less than a standard sensor's noise in one block
  Trusted trusted = Trusted::neither;
  double apart_mg = 0;
  std::string why;
};

Trust whom_to_trust(const TrustEvidence& evidence);

}  // namespace sixpoint::calib

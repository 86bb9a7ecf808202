#include "calib/trust.h"

#include <array>

#include <fmt/format.h>

namespace sixpoint::calib {

std::string_view to_string(Trusted trusted) {
  constexpr std::array<std::string_view, 4> kNames = {"both", "least_squares", "genetic",
                                                      "neither"};
  return kNames[static_cast<std::size_t>(trusted)];
}

Trust whom_to_trust(const TrustEvidence& e) {
  constexpr double kClearlyLess = 0.9;
  const auto answer = [&](Trusted trusted, std::string why) {
    return Trust{trusted, e.apart_mg, std::move(why)};
  };
  if (!e.converged && !e.settled) {
    return answer(Trusted::neither,
                  "least squares did not converge and the genetic algorithm did not settle");
  }
  if (!e.converged) {
    return answer(Trusted::genetic, "least squares did not converge");
  }
  if (!e.settled) {
    return answer(Trusted::least_squares, "the genetic algorithm did not settle");
  }
  if (e.apart_mg <= Trust::agreement_mg) {
    return answer(
        Trusted::both,
        fmt::format("least squares and the genetic algorithm agree to {:.2f} mg", e.apart_mg));
  }
  const bool genetic = e.genetic_error_mg < kClearlyLess * e.least_squares_error_mg;
  return answer(
      genetic ? Trusted::genetic : Trusted::least_squares,
      fmt::format("least squares and the genetic algorithm differ by {:.1f} mg; trust {}: over all "
                  "directions least squares leaves {:.2f} mg and the genetic algorithm {:.2f} mg{}",
                  e.apart_mg, genetic ? "the genetic algorithm" : "least squares",
                  e.least_squares_error_mg, e.genetic_error_mg,
                  genetic ? "" : ", and least squares uses every block"));
}

}  // namespace sixpoint::calib

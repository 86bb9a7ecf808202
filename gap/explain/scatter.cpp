#include "gap/explain/scatter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "gap/explain/decisions.h"
#include "gap/features/slow_noise.h"

namespace sixpoint::gap {
namespace {

struct Kind {
  std::string_view name;
  std::vector<double> sizes;
};

// In the order of the enumeration. The sizes, from what a short protocol shows to a few times the
// largest realistic one, are conventions.
const Kind& kind_of(Scatter scatter) {
  static const std::array<Kind, 12> kKinds = {
      {{"nominal", {0}},
       {"seating", {0.007, 0.011, 0.016, 0.025, 0.04, 0.065, 0.1, 0.16, 0.25, 0.4, 0.65}},
       {"random_walk", {0.03, 0.065, 0.12, 0.2, 0.3, 0.5, 1}},
       {"flicker", {0.035, 0.09, 0.18, 0.35, 0.7, 1.4}},
       {"pose", {0.4, 1.2, 4, 12, 40, 200}},
       {"placement", {0.4, 1.2, 4, 12, 40}},
       {"session", {0.5, 2, 8, 30}},
       {"a seat that walks", {0.005, 0.01, 0.02, 0.04, 0.08, 0.16}},
       {"temperature", {0.5, 2, 8, 30}},
       {"time", {0.5, 2, 8, 30}},
       {"time, within minutes", {0.5, 2, 8, 30}},
       {"a step of the zero", {}}}};
  return kKinds.at(static_cast<std::size_t>(scatter));
}

// Correlation lengths of the smooth kinds: conventions.
constexpr double kSlow_s = 700;
constexpr double kFast_s = 90;
constexpr double kAlike_c = 10;

double gaussian(double distance, double length) {
  return std::exp(-0.5 * std::pow(distance / length, 2));
}

// 1/f noise as a sum of Ornstein-Uhlenbeck processes whose time constants are a factor e apart.
double flicker_kernel(const Block& a, const Block& b) {
  constexpr int kProcesses = 11;
  constexpr double kShortest_s = 0.5;
  double sum = 0;
  for (int k = 0; k < kProcesses; ++k) {
    const double tau = kShortest_s * std::exp(k);
    if (&a == &b) {
      const double l = std::max(1e-3, a.seconds / tau);
      sum += 2 * (1 / l - (1 - std::exp(-l)) / (l * l));
    } else {
      sum += std::exp(-std::abs(a.middle_s - b.middle_s) / tau) *
             std::min(1.0, tau / std::max(1e-3, a.seconds));
    }
  }
  return sum * flicker_density_mg2(1);
}

}  // namespace

std::string_view to_string(Scatter scatter) { return kind_of(scatter).name; }

bool in_catalogue(Scatter scatter) { return scatter <= Scatter::flicker; }

std::vector<double> sizes_of(Scatter scatter) { return kind_of(scatter).sizes; }

double scatter_log_prior(Scatter scatter) {
  // What a real unit has a little of, together, looks like a seat that walks: of 150 units on six
  // faces one was eight to ten nats likelier so. Sixty walks of five times the bound and more were
  // likelier by ten at least.
  constexpr double kWalkCost_nats = 7;
  return (in_catalogue(scatter) ? kLogPriorEffect : kLogPriorUnknown) -
         (scatter == Scatter::seat_walks ? kWalkCost_nats : 0) -
         std::log(static_cast<double>(kind_of(scatter).sizes.size()));
}

double nominal_variance_mg2(const Block& block, Eigen::Index feature) {
  return block.white_mg2(feature, feature) +
         std::pow(kNominalSeating_deg, 2) * seating_lever(block).row(feature).squaredNorm();
}

bool same_pose(const Block& a, const Block& b) {
  return (a.rotation - b.rotation).cwiseAbs().maxCoeff() < 1e-3;
}

double scatter_kernel(Scatter scatter, const Block& a, const Block& b, double start_s) {
  switch (scatter) {
    case Scatter::random_walk:
      // Variance of a walk's mean over a block; covariance: that of the earlier block's time.
      return &a == &b ? std::max(0.0, a.middle_s - a.seconds / 2 - start_s) + a.seconds / 3
                      : std::max(0.0, std::min(a.middle_s, b.middle_s) - start_s);
    case Scatter::flicker:
      return flicker_kernel(a, b);
    case Scatter::by_pose:
      return same_pose(a, b) ? 1 : 0;
    case Scatter::by_placement: {
      // Rectified vibration grows with the square of its amplitude.
      const auto weight = [](const Block& block) {
        return 1 + block.vibration_lab_g.squaredNorm() / 4;
      };
      return a.placement == b.placement ? weight(a) * weight(b) : 0;
    }
    case Scatter::by_session:
      return a.session == b.session ? 1 : 0;
    case Scatter::by_temperature:
      return gaussian(a.temperature_c - b.temperature_c, kAlike_c);
    case Scatter::by_time:
      return gaussian(std::abs(a.middle_s - b.middle_s), kSlow_s);
    case Scatter::by_time_fast:
      return gaussian(std::abs(a.middle_s - b.middle_s), kFast_s);
    default:
      return 0;
  }
}

}  // namespace sixpoint::gap

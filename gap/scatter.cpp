#include "gap/scatter.h"

#include <algorithm>
#include <cmath>

#include "gap/features/slow_noise.h"

namespace sixpoint::gap {

std::string_view to_string(Scatter scatter) {
  switch (scatter) {
    case Scatter::nominal:
      return "nominal";
    case Scatter::seating:
      return "seating";
    case Scatter::random_walk:
      return "random_walk";
    case Scatter::flicker:
      return "flicker";
    case Scatter::by_pose:
      return "pose";
    case Scatter::by_placement:
      return "placement";
    case Scatter::by_temperature:
      return "temperature";
    case Scatter::by_session:
      return "session";
    case Scatter::by_time:
      return "time";
    case Scatter::by_time_fast:
      return "time, within minutes";
    case Scatter::step:
      return "a step of the zero";
  }
  return "";
}

bool in_catalogue(Scatter scatter) { return scatter <= Scatter::flicker; }

std::vector<double> sizes_of(Scatter scatter) {
  switch (scatter) {
    case Scatter::nominal:
      return {0};
    case Scatter::seating:
      return {0.016, 0.025, 0.04, 0.065, 0.1, 0.16, 0.25, 0.4, 0.65};
    case Scatter::random_walk:
      return {0.03, 0.065, 0.12, 0.2, 0.3, 0.5};
    case Scatter::flicker:
      return {0.035, 0.09, 0.18, 0.35, 0.7, 1.4};
    case Scatter::by_pose:
      return {0.4, 1.2, 4, 12, 40, 200};
    case Scatter::by_placement:
      return {0.4, 1.2, 4, 12, 40};
    case Scatter::step:
      return {};
    case Scatter::by_session:
    case Scatter::by_temperature:
    case Scatter::by_time:
    case Scatter::by_time_fast:
      return {0.5, 2, 8, 30};
  }
  return {};
}

bool same_pose(const Block& a, const Block& b) {
  return (a.rotation - b.rotation).cwiseAbs().maxCoeff() < 1e-3;
}

double scatter_kernel(Scatter scatter, const Block& a, const Block& b, double start_s) {
  const double gap_s = std::abs(a.middle_s - b.middle_s);
  const bool same = &a == &b;
  switch (scatter) {
    case Scatter::random_walk:
      return same ? std::max(0.0, a.middle_s - a.seconds / 2 - start_s) + a.seconds / 3
                  : std::max(0.0, std::min(a.middle_s, b.middle_s) - start_s);
    case Scatter::flicker: {
      // Ornstein-Uhlenbeck processes a factor e apart add up to 1/f.
      double sum = 0;
      for (int k = 0; k < 11; ++k) {
        const double tau = 0.5 * std::exp(k);
        if (same) {
          const double l = std::max(1e-3, a.seconds / tau);
          sum += 2 * (1 / l - (1 - std::exp(-l)) / (l * l));
        } else {
          sum += std::exp(-gap_s / tau) * std::min(1.0, tau / std::max(1e-3, a.seconds));
        }
      }
      return sum * flicker_density_mg2(1);
    }
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
      return std::exp(-0.5 * std::pow((a.temperature_c - b.temperature_c) / 10, 2));
    case Scatter::by_time:
      return std::exp(-0.5 * std::pow(gap_s / 700, 2));
    case Scatter::by_time_fast:
      return std::exp(-0.5 * std::pow(gap_s / 90, 2));
    default:
      return 0;
  }
}

}  // namespace sixpoint::gap

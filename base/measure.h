// Units of measure and the three axes.
//
//   const PerAxis<double> zero_g = {0.004, -0.011, 0.020};
//   const double zero_x_mg = zero_g[0] * kMgPerG;
//   all_finite(zero_g, zero_x_mg);  // true
//
// Accelerations are in g, one g being standard gravity, 9.80665 m/s2 exactly (CGPM 1901); names
// carry their unit (`zero_lsb`, `residual_mg`, `rate_hz`). Per-axis quantities are arrays in the
// order X, Y, Z everywhere in the program; only a packed ACTIVITY record on disk has another order.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <type_traits>

namespace sixpoint {

inline constexpr double kStandardGravity_m_per_s2 = 9.80665;
inline constexpr double kMgPerG = 1000.0;
inline constexpr std::size_t kAxes = 3;

template <class T>
using PerAxis = std::array<T, kAxes>;

inline constexpr PerAxis<std::string_view> kAxisNames = {"x", "y", "z"};

// Whether all of them are finite: numbers, and arrays or vectors of numbers.
template <class... Values>
bool all_finite(const Values&... values) {
  const auto finite = [](const auto& value) {
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(value)>>) {
      return std::isfinite(value);
    } else {
      return std::ranges::all_of(value, [](double number) { return std::isfinite(number); });
    }
  };
  return (finite(values) && ...);
}

}  // namespace sixpoint

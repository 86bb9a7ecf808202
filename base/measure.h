// Units of measure and the three axes.
//
// Accelerations are in g, one g being standard gravity, 9.80665 m/s2 exactly (CGPM 1901); names
// carry their unit (`zero_lsb`, `residual_mg`, `rate_hz`). Per-axis quantities are arrays in the
// order X, Y, Z everywhere in the program; only a packed ACTIVITY record on disk has another order.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace sixpoint {

inline constexpr double kStandardGravity_m_per_s2 = 9.80665;
inline constexpr double kMgPerG = 1000.0;
inline constexpr std::size_t kAxes = 3;

template <class T>
using PerAxis = std::array<T, kAxes>;

inline constexpr PerAxis<std::string_view> kAxisNames = {"x", "y", "z"};

}  // namespace sixpoint

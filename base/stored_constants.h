// The nine integers that a unit keeps in its non-volatile memory and writes into every recording.
//
//   StoredConstants stored;
//   stored.positive_lsb = {264, 262, 259};  // X, Y, Z
//   stored.negative_lsb = {-254, -257, -251};
//   stored.zero_lsb = {5, 3, 4};
#pragma once

#include "base/measure.h"

namespace sixpoint {

// The sensor's readings, in raw counts, at +1 g, -1 g and 0 g, per axis; each in [-2048, 2047].
// They hold six degrees of freedom, not nine: the firmware uses positive and negative only through
// their difference (paper, Eq. 1-3). `zero` is measured apart and is not their midpoint.
struct StoredConstants {
  PerAxis<int> positive_lsb{};
  PerAxis<int> negative_lsb{};
  PerAxis<int> zero_lsb{};

  bool operator==(const StoredConstants&) const = default;
};

inline constexpr int kStoredConstantMin = -2048;
inline constexpr int kStoredConstantMax = 2047;

}  // namespace sixpoint

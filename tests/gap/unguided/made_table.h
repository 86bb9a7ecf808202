// A table of readings of a sensor that rests in many directions, with known gain, zero and cross
// terms.
#pragma once

#include <string>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "base/random.h"
#include "expect_result.h"
#include "gap/unguided/readings_table.h"

namespace sixpoint::tests {

struct MadeTable {
  Eigen::Vector3d cross = Eigen::Vector3d::Zero();  // yz xz xy
  int directions = 40;
  bool timed = true;
  double noise_g = 0.003;
};

// The forward model in closed form: counts = gain * (M * direction) + zero, with noise and
// rounding.
inline std::string table_of(const MadeTable& made, std::uint64_t seed) {
  Random random(seed);
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  m(1, 2) = m(2, 1) = made.cross[0];
  m(0, 2) = m(2, 0) = made.cross[1];
  m(0, 1) = m(1, 0) = made.cross[2];
  const Eigen::Vector3d gain(4100, 3900, 4000);
  const Eigen::Vector3d zero(300, -200, 50);
  std::string text = made.timed ? "time_s,x,y,z\n" : "x;y;z\n";
  double time_s = 5;
  for (int i = 0; i < made.directions; ++i) {
    Eigen::Vector3d up(random.normal(), random.normal(), random.normal());
    up.normalize();
    for (int k = 0; k < 700; ++k) {
      Eigen::Vector3d g = m * up;
      for (Eigen::Index a = 0; a < 3; ++a) {
        // The last second is the turn to the next direction.
        g[a] += (k < 600 ? made.noise_g : 0.4) * random.normal();
      }
      const Eigen::Vector3d counts = gain.cwiseProduct(g) + zero;
      if (made.timed) {
        text +=
            fmt::format("{:.4f},{:.0f},{:.0f},{:.0f}\n", time_s, counts[0], counts[1], counts[2]);
      } else {
        text += fmt::format("{:.0f};{:.0f};{:.0f}\r\n", counts[0], counts[1], counts[2]);
      }
      time_s += 0.01;
    }
  }
  return text;
}

inline Result<gap::Diagnosis> diagnosed_table(const std::string& text,
                                              const gap::DiagnoseOptions& options = {},
                                              const gap::ReadingsTableOptions& table = {}) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "t.csv", text));
  return gap::diagnose_table(memory.files, "t.csv", options, table);
}

}  // namespace sixpoint::tests

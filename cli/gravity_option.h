// --gravity, --latitude, --altitude: local gravity, for every command that computes constants.
//
//   add_gravity_options(command, options);
//   SIXPOINT_ASSIGN(const auto gravity, local_gravity(options));
//   const double gravity_g = gravity ? gravity->g() : 1.0;
#pragma once

#include <optional>

#include "calib/poses/gravity.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

struct GravityOptions {
  std::optional<double> m_per_s2;
  std::optional<double> latitude_deg;
  std::optional<double> altitude_m;  // without: sea level
};

void add_gravity_options(CLI::App& command, GravityOptions& options);

//   --gravity  --latitude  --altitude  answer
//   given      any         any         the value of --gravity
//   -          given       any         computed from both (calib/poses/gravity.h)
//   -          -           given       usage: an altitude alone says nothing
//   -          -           -           none: gravity is unknown
// usage where a value is impossible.
Result<std::optional<calib::LocalGravity>> local_gravity(const GravityOptions& options);

}  // namespace sixpoint::cli

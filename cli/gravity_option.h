// --gravity, --latitude, --altitude: local gravity, for every command that computes constants.
//
//   add_gravity_options(command, options);
//   SIXPOINT_ASSIGN(const auto gravity, local_gravity(options));
//   const double gravity_g = gravity ? gravity->g() : 1.0;
#pragma once

#include "calib/poses/gravity.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

using GravityOptions = calib::GravityGiven;
using calib::local_gravity;

void add_gravity_options(CLI::App& command, GravityOptions& options);

}  // namespace sixpoint::cli

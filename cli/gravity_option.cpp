#include "cli/gravity_option.h"

#include <CLI/App.hpp>

namespace sixpoint::cli {

void add_gravity_options(CLI::App& command, GravityOptions& options) {
  command.add_option("--gravity", options.m_per_s2,
                     "local gravity in m/s2; unknown: standard gravity, and its uncertainty");
  command.add_option("--latitude", options.latitude_deg,
                     "... or computed from the latitude in degrees");
  command.add_option("--altitude", options.altitude_m, "... and metres above sea level");
}

}  // namespace sixpoint::cli

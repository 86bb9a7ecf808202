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

Result<std::optional<calib::LocalGravity>> local_gravity(const GravityOptions& options) {
  if (options.m_per_s2) {
    return calib::gravity_entered(*options.m_per_s2);
  }
  if (options.latitude_deg) {
    return calib::gravity_at(*options.latitude_deg, options.altitude_m.value_or(0));
  }
  if (options.altitude_m) {
    return fail(ErrorCode::usage, "an altitude alone does not say what gravity is", "--altitude",
                "name the latitude too: --latitude DEGREES");
  }
  return std::nullopt;
}

}  // namespace sixpoint::cli

// A stored jig run made of numbers, for the tests of bundles and trends.
#pragma once

#include <array>
#include <string>

#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "device/jig.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::station {

// A report as a jig run leaves it: a unit with its own small turn (degrees) on a jig that tilts all
// units alike.
inline StoredRun made_run(const std::string& serial, const std::string& jig,
                          const std::array<double, 3>& unit_deg,
                          const std::array<double, 2>& jig_deg) {
  constexpr double kRad = 3.14159265358979323846 / 180;
  nlohmann::json poses = nlohmann::json::array();
  for (const device::Pose pose : device::kPoses) {
    const PerAxis<double> up = device::direction_of(pose);
    // The jig: along the next two axes of whatever face is up. The unit: a small rotation.
    PerAxis<double> reading_g = up;
    const std::size_t axis = device::axis_of(pose);
    reading_g[(axis + 1) % 3] += jig_deg[0] * kRad;
    reading_g[(axis + 2) % 3] += jig_deg[1] * kRad;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t b = (a + 1) % 3;
      const std::size_t c = (a + 2) % 3;
      reading_g[a] += kRad * (unit_deg[b] * up[c] - unit_deg[c] * up[b]);
    }
    nlohmann::json mean = nlohmann::json::array();
    for (std::size_t a = 0; a < 3; ++a) {
      mean.push_back(20.0 + 5.0 * static_cast<double>(a) + 250.0 * reading_g[a]);
    }
    poses.push_back({{"pose", device::to_string(pose)}, {"mean_lsb", mean}, {"samples", 600}});
  }
  return {"id" + serial, serial, "jig", "bench 1", jig, nlohmann::json{{"poses", poses}}.dump()};
}

}  // namespace sixpoint::station

#include "cli/gap/recorded_scenario.h"

#include <array>
#include <cmath>

#include "base/measure.h"
#include "sim/protocol_run.h"

namespace sixpoint::cli {

namespace {

Json numbers_of(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

Json segment_of(const gap::Segment& segment, std::uint64_t first_sample) {
  constexpr std::array<const char*, 4> kKinds = {"still", "vibration", "ramp", "soak"};
  Json json = {{"name", segment.name},
               {"kind", kKinds[static_cast<std::size_t>(segment.kind)]},
               {"first_sample", first_sample},
               {"samples", segment.samples},
               {"host_start_s", segment.host_start_s},
               {"rotation", Json::array()},
               {"temperature_c", {segment.temperature_start_c, segment.temperature_end_c}}};
  for (Eigen::Index row = 0; row < 3; ++row) {
    json["rotation"].push_back(numbers_of(segment.rotation.row(row).transpose()));
  }
  if (segment.vibration) {
    json["vibration"] = {{"direction_lab", numbers_of(segment.vibration->direction_lab)},
                         {"frequency_hz", segment.vibration->frequency_hz},
                         {"amplitude_g", segment.vibration->amplitude_g}};
  }
  return json;
}

// Below 0.6 counts rounding hides how large the noise is, to some 12 %: what is as near to the
// simulator's is the simulator's.
double noise_of(double measured_mg, double nominal_mg, double accel_scale_lsb_per_g) {
  constexpr double kLeast_lsb = 0.6;
  constexpr double kHidden = 0.15;
  const bool is_hidden = measured_mg * accel_scale_lsb_per_g < kLeast_lsb * kMgPerG &&
                         std::abs(measured_mg / nominal_mg - 1) < kHidden;
  return is_hidden ? nominal_mg : measured_mg;
}

}  // namespace

Json recorded_scenario(const gap::Diagnosis& diagnosis, const gap::Bundle& bundle) {
  Json json = gap::augmented_scenario(diagnosis);
  json["rate_hz"] = bundle.rate_hz;
  json["gravity_g"] = bundle.gravity_g;
  json["unit"]["accel_scale_lsb_per_g"] = bundle.accel_scale_lsb_per_g;
  const auto nominal_mg = sim::nominal_noise_mg(bundle.rate_hz);
  for (std::size_t a = 0; a < kAxes; ++a) {
    json["unit"]["noise_mg"][a] =
        noise_of(diagnosis.unit.noise_mg[a], nominal_mg[a], bundle.accel_scale_lsb_per_g);
  }
  Json segments = Json::array();
  std::uint64_t samples = 0;
  for (const gap::Segment& segment : bundle.segments) {
    segments.push_back(segment_of(segment, samples));
    samples += segment.samples;
  }
  json["protocol"] = std::move(segments);
  return json;
}

}  // namespace sixpoint::cli

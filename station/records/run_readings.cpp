#include "station/records/run_readings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "device/jig.h"

namespace sixpoint::station {

namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
// A working ADXL362 has 150 to 350 (jig_placement.cpp); other sensors are let in.
constexpr double kLeast_lsb_per_g = 50;
constexpr double kMost_lsb_per_g = 2000;
// The jig refuses a placement of 4 degrees, and a sensor of 2.8 % cross-axis reads 3.2 degrees.
constexpr double kMostSkew_deg = 10;

struct Placements {
  std::array<std::vector<PerAxis<double>>, 6> of_face;  // means, in the order of device::kPoses
  double temperature_sum_c = 0;
  std::size_t temperatures = 0;
};

std::size_t place_of(device::Pose pose) {
  return static_cast<std::size_t>(std::find(device::kPoses.begin(), device::kPoses.end(), pose) -
                                  device::kPoses.begin());
}

bool add_placements(const nlohmann::json& list, Placements& placements) {
  const auto readings = stored_readings(list);
  if (!readings) {
    return false;
  }
  for (const StoredReading& reading : *readings) {
    if (!all_finite(reading.mean_lsb)) {
      return false;
    }
    placements.of_face[place_of(reading.pose)].push_back(reading.mean_lsb);
  }
  for (const nlohmann::json& item : list) {
    if (item.contains("temperature_c") && item["temperature_c"].is_number()) {
      placements.temperature_sum_c += item["temperature_c"].get<double>();
      ++placements.temperatures;
    }
  }
  return true;
}

PerAxis<double> mean_of_placements(const std::vector<PerAxis<double>>& all) {
  PerAxis<double> mean{};
  for (const PerAxis<double>& each : all) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      mean[axis] += each[axis] / static_cast<double>(all.size());
    }
  }
  return mean;
}

double gravity_g_of(const nlohmann::json& report) {
  const auto found = report.find("gravity_m_per_s2");
  const double gravity = found != report.end() && found->is_number() ? found->get<double>() : 0;
  return gravity > 9.7 && gravity < 9.9 ? gravity / kStandardGravity_m_per_s2 : 1;
}

bool read_placements(const nlohmann::json& report, Placements& placements) {
  if (!report.is_object() || !report.contains("poses") ||
      !add_placements(report["poses"], placements)) {
    return false;
  }
  const auto verification = report.find("verification");
  return verification == report.end() || !verification->is_object() ||
         !verification->contains("poses") || add_placements((*verification)["poses"], placements);
}

}  // namespace

Result<RunReadings> readings_of_run(const StoredRun& run) {
  const auto wrong = [&](const char* what) {
    return fail(ErrorCode::bad_data, what, run.id, "leave this run out, or measure the unit again");
  };
  const auto report = parse_json<nlohmann::json>(run.document);
  Placements placements;
  RunReadings out;
  if (!read_placements(report, placements)) {
    return wrong("the run's report holds no six faces");
  }
  std::array<PerAxis<double>, 6> face{};
  out.placements = placements.of_face[0].size();
  for (std::size_t f = 0; f < face.size(); ++f) {
    out.placements = std::min(out.placements, placements.of_face[f].size());
    face[f] = mean_of_placements(placements.of_face[f]);
  }
  if (out.placements == 0) {
    return wrong("the run's report holds no six faces");
  }
  PerAxis<double> middle_lsb{};
  PerAxis<double> half_span_lsb{};
  const double gravity_g = gravity_g_of(report);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double plus = face[place_of(device::pose_of(axis, 1))][axis];
    const double minus = face[place_of(device::pose_of(axis, -1))][axis];
    middle_lsb[axis] = (plus + minus) / 2;
    half_span_lsb[axis] = (plus - minus) / 2;
    out.sensitivity_lsb_per_g[axis] = half_span_lsb[axis] / gravity_g;
    out.zero_mg[axis] = kMgPerG * middle_lsb[axis] / out.sensitivity_lsb_per_g[axis];
    if (!(out.sensitivity_lsb_per_g[axis] >= kLeast_lsb_per_g &&
          out.sensitivity_lsb_per_g[axis] <= kMost_lsb_per_g && all_finite(out.zero_mg[axis]))) {
      return wrong("no unit has the sensitivity of this run's report");
    }
  }
  std::size_t at = 0;
  for (std::size_t f = 0; f < face.size(); ++f) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (axis == device::axis_of(device::kPoses[f])) {
        continue;
      }
      const double deg_per_lsb = kDegPerRad / half_span_lsb[axis];
      out.skew_deg[at] = deg_per_lsb * (face[f][axis] - middle_lsb[axis]);
      if (!(std::abs(out.skew_deg[at]) <= kMostSkew_deg)) {
        return wrong("the faces of this run's report are too far from right angles");
      }
      ++at;
      for (const PerAxis<double>& each : placements.of_face[f]) {
        out.repeats[f].square_deg2 += std::pow(deg_per_lsb * (each[axis] - face[f][axis]), 2);
      }
      out.repeats[f].degrees_of_freedom += static_cast<double>(placements.of_face[f].size() - 1);
    }
  }
  if (placements.temperatures > 0) {
    out.temperature_c = placements.temperature_sum_c / static_cast<double>(placements.temperatures);
  }
  if (report.contains("filter") && report["filter"].is_string()) {
    out.filter = report["filter"].get<std::string>();
  }
  return out;
}

}  // namespace sixpoint::station

// Stored jig runs made of numbers, for the tests of bundles and trends: a bench of units, jigs and
// lots, by vectors and rotations. Nothing of the solver is used.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "base/random.h"
#include "device/jig.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::station {

inline constexpr double kMadeRad = 3.14159265358979323846 / 180;

// Its sensor reads map * force + zero.
struct MadeUnit {
  std::string serial;
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();   // of its axes in the case
  Eigen::Vector3d shear_deg = Eigen::Vector3d::Zero();  // between xy, xz, yz
  Eigen::Vector3d zero_mg{70, 90, 110};
  Eigen::Vector3d sensitivity_lsb_per_g{250, 252, 248};

  Eigen::Matrix3d map() const {
    const Eigen::Vector3d turn = kMadeRad * turn_deg;
    Eigen::Matrix3d shear = Eigen::Matrix3d::Identity();
    shear(0, 1) = shear(1, 0) = kMadeRad * shear_deg[0];
    shear(0, 2) = shear(2, 0) = kMadeRad * shear_deg[1];
    shear(1, 2) = shear(2, 1) = kMadeRad * shear_deg[2];
    const double angle = turn.norm();
    return sensitivity_lsb_per_g.asDiagonal() * shear *
           (angle > 0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix()
                      : Eigen::Matrix3d::Identity());
  }
};

// What it does to every unit: its nests lean along the next two axes of whatever face is up, its
// plate leans, its nest is turned, and single faces lean more and repeat worse.
struct MadeJig {
  std::string name = "jig";
  std::string station = "bench 1";
  std::array<double, 2> base_deg{};
  // Of the laboratory: its plate leans to the right and away from the person who lays the unit as the
  // table of station/run/jig_run.h says.
  std::array<double, 2> plate_deg{};
  Eigen::Vector3d nest_deg = Eigen::Vector3d::Zero();
  std::map<device::Pose, std::array<double, 2>> face_deg = {};
  std::map<device::Pose, double> face_scatter_deg = {};
};

// How the two axes that lie level read a plate that leans, by that table: (right, away) of the axis
// behind the one that is up, then of the next.
inline std::array<std::array<double, 2>, 2> made_level_axes(device::Pose pose) {
  using Axes = std::array<std::array<double, 2>, 2>;
  static const std::map<device::Pose, Axes> kTable = {
      {device::Pose::plus_z, Axes{{{1, 0}, {0, 1}}}},    // x right, y away
      {device::Pose::minus_z, Axes{{{1, 0}, {0, -1}}}},  // x right, y towards
      {device::Pose::plus_x, Axes{{{0, 1}, {-1, 0}}}},   // y away, z left
      {device::Pose::minus_x, Axes{{{0, 1}, {1, 0}}}},   // y away, z right
      {device::Pose::plus_y, Axes{{{0, -1}, {1, 0}}}},   // z towards, x right
      {device::Pose::minus_y, Axes{{{0, 1}, {1, 0}}}}};  // z away, x right
  return kTable.at(pose);
}

// What one run adds. Twice six placements, as a jig run has them; `scatter_deg` for each.
struct MadeScatter {
  double placement_deg = 0.01;
  double zero_mg = 0.3;
  double sensitivity_percent = 0.02;
};

inline StoredRun made_run(const MadeUnit& unit, const MadeJig& jig, const MadeScatter& scatter,
                          Random& random, const std::string& id = {}) {
  const auto normal3 = [&](double sd) {
    return Eigen::Vector3d(sd * random.normal(), sd * random.normal(), sd * random.normal());
  };
  MadeUnit today = unit;
  today.zero_mg += normal3(scatter.zero_mg);
  today.sensitivity_lsb_per_g.array() *= 1 + 0.01 * normal3(scatter.sensitivity_percent).array();
  const auto placement = [&](device::Pose pose) {
    const PerAxis<double> up = device::direction_of(pose);
    const auto axis = static_cast<Eigen::Index>(device::axis_of(pose));
    const auto wear = jig.face_scatter_deg.find(pose);
    const double sd =
        scatter.placement_deg + (wear == jig.face_scatter_deg.end() ? 0 : wear->second);
    std::array<double, 2> lean_deg = {jig.base_deg[0] + sd * random.normal(),
                                      jig.base_deg[1] + sd * random.normal()};
    const auto level = made_level_axes(pose);
    for (std::size_t k = 0; k < 2; ++k) {
      lean_deg[k] += level[k][0] * jig.plate_deg[0] + level[k][1] * jig.plate_deg[1];
    }
    if (const auto worn = jig.face_deg.find(pose); worn != jig.face_deg.end()) {
      lean_deg[0] += worn->second[0];
      lean_deg[1] += worn->second[1];
    }
    Eigen::Vector3d force(up[0], up[1], up[2]);
    force[(axis + 1) % 3] += std::tan(kMadeRad * lean_deg[0]);
    force[(axis + 2) % 3] += std::tan(kMadeRad * lean_deg[1]);
    force.normalize();
    const Eigen::Vector3d nest = kMadeRad * jig.nest_deg;
    if (nest.norm() > 0) {
      force = Eigen::AngleAxisd(nest.norm(), nest.normalized()) * force;
    }
    const Eigen::Vector3d lsb =
        today.map() * force +
        (today.sensitivity_lsb_per_g.array() * today.zero_mg.array() / 1000).matrix();
    return nlohmann::json{{"pose", device::to_string(pose)},
                          {"mean_lsb", {lsb[0], lsb[1], lsb[2]}},
                          {"samples", 600},
                          {"temperature_c", 24.5}};
  };
  nlohmann::json faces = nlohmann::json::array();
  nlohmann::json again = nlohmann::json::array();
  for (const device::Pose pose : device::kPoses) {
    faces.push_back(placement(pose));
    again.push_back(placement(pose));
  }
  const nlohmann::json report = {
      {"poses", faces}, {"verification", {{"poses", again}}}, {"filter", "current"}};
  return {id.empty() ? "id" + unit.serial : id,
          unit.serial,
          "jig",
          jig.station,
          jig.name,
          report.dump()};
}

// What units of one maker scatter, drawn for the tests.
inline MadeUnit made_unit(const std::string& serial, Random& random, double turn_deg = 0.3,
                          double shear_deg = 0.1) {
  MadeUnit unit;
  unit.serial = serial;
  for (Eigen::Index a = 0; a < 3; ++a) {
    unit.turn_deg[a] = turn_deg * random.normal();
    unit.shear_deg[a] = shear_deg * random.normal();
    unit.zero_mg[a] += 25 * random.normal();
    unit.sensitivity_lsb_per_g[a] *= 1 + 0.02 * random.normal();
  }
  return unit;
}

}  // namespace sixpoint::station

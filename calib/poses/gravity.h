// Gravity at a place: the reference of every still pose.
//
//   SIXPOINT_ASSIGN(const LocalGravity local, gravity_at(48.1, 520));  // degrees, m above the sea
//   const double reference_g = local.g();
//
// Normal gravity on the WGS84 ellipsoid (Somigliana's closed formula) with the free-air change with
// height to second order (NIMA TR8350.2, third edition, Eq. 4-1 and 4-3). Real gravity differs from
// it by the masses around: some 0.3 mm/s2 as a rule, below 1 mm/s2 nearly everywhere, which is
// 0.1 mg and stated as uncertainty.
#pragma once

#include <optional>

#include "base/result.h"

namespace sixpoint::calib {

struct LocalGravity {
  double m_per_s2 = 0;
  double standard_uncertainty_m_per_s2 = 0;
  double g() const;     // in standard g, the unit of all data
  double sd_g() const;  // its uncertainty in the same unit
};

// usage outside -90 .. 90 degrees or -500 .. 9000 m.
Result<LocalGravity> gravity_at(double latitude_deg, double altitude_m);
// A surveyed value that was entered; usage outside 9.76 .. 9.84 m/s2.
Result<LocalGravity> gravity_entered(double m_per_s2);
// For an unknown place, somewhere on land between equator and pole: standard gravity, known to
// 0.0150 m/s2 (a uniform distribution over 9.780 .. 9.832).
LocalGravity gravity_unknown();

// What a person gives, of the commands and packages that compute constants.
struct GravityGiven {
  std::optional<double> m_per_s2;
  std::optional<double> latitude_deg;
  std::optional<double> altitude_m;  // without: sea level
};

//   m_per_s2  latitude  altitude  answer
//   given     -         -         gravity_entered()
//   given     or given, or given  usage: two answers
//   -         given     any       gravity_at() both
//   -         -         given     usage: an altitude alone says nothing
//   -         -         -         none: gravity is unknown
// usage where a value is impossible.
Result<std::optional<LocalGravity>> local_gravity(const GravityGiven& given);

}  // namespace sixpoint::calib

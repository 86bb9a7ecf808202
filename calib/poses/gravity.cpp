#include "calib/poses/gravity.h"

#include <cmath>

#include <fmt/format.h>

#include "base/measure.h"

namespace sixpoint::calib {

double LocalGravity::g() const { return m_per_s2 / kStandardGravity_m_per_s2; }
double LocalGravity::sd_g() const {
  return standard_uncertainty_m_per_s2 / kStandardGravity_m_per_s2;
}

Result<LocalGravity> gravity_at(double latitude_deg, double altitude_m) {
  if (!(latitude_deg >= -90 && latitude_deg <= 90)) {
    return fail(ErrorCode::usage,
                fmt::format("a latitude of {} degrees is impossible", latitude_deg), "gravity",
                "give it in degrees, -90 to 90");
  }
  if (!(altitude_m >= -500 && altitude_m <= 9000)) {
    return fail(ErrorCode::usage, fmt::format("an altitude of {} m is no station's", altitude_m),
                "gravity", "give it in metres above sea level");
  }
  // WGS84.
  constexpr double kEquator_m_per_s2 = 9.7803253359;
  constexpr double kSomigliana = 0.00193185265241;
  constexpr double kFirstEccentricitySquared = 0.00669437999014;
  constexpr double kSemiMajorAxis_m = 6378137.0;
  constexpr double kFlattening = 1 / 298.257223563;
  constexpr double kCentrifugal = 0.00344978650684;  // omega^2 a^2 b / GM
  const double sine = std::sin(latitude_deg * M_PI / 180);
  const double square = sine * sine;
  const double at_sea = kEquator_m_per_s2 * (1 + kSomigliana * square) /
                        std::sqrt(1 - kFirstEccentricitySquared * square);
  const double h = altitude_m / kSemiMajorAxis_m;
  const double at_height =
      at_sea *
      (1 - 2 * (1 + kFlattening + kCentrifugal - 2 * kFlattening * square) * h + 3 * h * h);
  // Free-air anomalies: 30 mGal as a rule, more in mountains.
  return LocalGravity{at_height, 3e-4 + 1e-7 * std::abs(altitude_m)};
}

Result<LocalGravity> gravity_entered(double m_per_s2) {
  if (!(m_per_s2 >= 9.76 && m_per_s2 <= 9.84)) {
    return fail(ErrorCode::usage,
                fmt::format("{} m/s2 is no gravity of this planet's surface", m_per_s2), "gravity",
                "give local gravity in m/s2 (9.780 at the equator, 9.832 at the poles)");
  }
  return LocalGravity{m_per_s2, 1e-4};
}

Result<std::optional<LocalGravity>> local_gravity(const GravityGiven& given) {
  if (given.m_per_s2 && (given.latitude_deg || given.altitude_m)) {
    return fail(ErrorCode::usage, "gravity is given, and a place to compute it from", "gravity",
                "give one: gravity in m/s2, or the latitude with the altitude");
  }
  if (given.m_per_s2) {
    return gravity_entered(*given.m_per_s2);
  }
  if (given.latitude_deg) {
    return gravity_at(*given.latitude_deg, given.altitude_m.value_or(0));
  }
  if (given.altitude_m) {
    return fail(ErrorCode::usage, "an altitude alone does not say what gravity is", "gravity",
                "give the latitude too");
  }
  return std::nullopt;
}

LocalGravity gravity_unknown() {
  return {kStandardGravity_m_per_s2, (9.832 - 9.780) / std::sqrt(12.0)};
}

}  // namespace sixpoint::calib

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/explain/catalogue.h"
#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

// What counts as a pose, a move or a change (conventions of the catalogue, see enum Ability).
constexpr double kFace = 0.99;        // cosine of an axis with the vertical
constexpr double kMove_g = 0.2;       // a step with a transient
constexpr double kApproach_g = 0.05;  // a step with a direction

struct Range {
  double low = 1e18, high = -1e18;
  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double span() const { return high - low; }
};

// What the recording has of one direction of gravity.
struct Face {
  bool along_axis = false;
  int placements = 0;
  std::set<int> yaws;
  std::array<std::set<int>, 3> approaches;  // per axis: signs of the step before
  Range temperature_c;
};

int yaw_of(const Eigen::Matrix3d& rotation) {
  // Any angle that changes with the yaw does: quarters of a radian separate the protocol's.
  return static_cast<int>(std::lround(
      std::atan2(rotation(0, 0) + 2 * rotation(1, 0), rotation(0, 1) + 2 * rotation(1, 1)) * 4));
}

template <typename Predicate>
unsigned at_least(std::ptrdiff_t least, unsigned ability, const std::map<std::string, Face>& faces,
                  const Predicate& predicate) {
  const auto count = std::count_if(faces.begin(), faces.end(),
                                   [&](const auto& entry) { return predicate(entry.second); });
  return count >= least ? ability : 0U;
}

unsigned shaker_abilities(const Vibration& vibration) {
  constexpr double kHighShaker_g = 4, kFullScale_g = 8.5;
  return kShaker | (vibration.amplitude_g >= kHighShaker_g ? kHighShaker : 0U) |
         (vibration.amplitude_g >= kFullScale_g ? kFullScale : 0U);
}

}  // namespace

ProtocolKind protocol_kind(const Bundle& bundle) {
  unsigned abilities = bundle.host_clock.empty() ? 0U : kHostClock;
  std::map<std::string, Face> faces;
  Range time_s, temperature_c;
  int moves = 0;
  for (const Segment& s : bundle.segments) {
    const double end_s = s.host_start_s + static_cast<double>(s.samples) / bundle.rate_hz;
    time_s.add(s.host_start_s);
    time_s.add(end_s);
    if (s.vibration) {
      abilities |= shaker_abilities(*s.vibration);
      continue;
    }
    const Eigen::Vector3d up = s.rotation.col(2);
    Face& face = faces[fmt::format("{} {} {}", std::lround(3 * up[0]), std::lround(3 * up[1]),
                                   std::lround(3 * up[2]))];
    face.along_axis = face.along_axis || up.cwiseAbs().maxCoeff() > kFace;
    face.yaws.insert(yaw_of(s.rotation));
    if (s.starts_placement) {
      ++face.placements;
      moves += s.approach_g.cwiseAbs().maxCoeff() > kMove_g ? 1 : 0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double step_g = s.approach_g[static_cast<Eigen::Index>(a)];
        if (std::abs(step_g) > kApproach_g) {
          face.approaches[a].insert(step_g > 0 ? 1 : -1);
        }
      }
    }
    for (const double t : {s.host_start_s, end_s}) {
      face.temperature_c.add(bundle.temperature_at(t));
      temperature_c.add(bundle.temperature_at(t));
    }
    constexpr double kLongRecord_s = 300;
    abilities |=
        static_cast<double>(s.samples) >= kLongRecord_s * bundle.rate_hz ? kLongRecord : 0U;
  }
  constexpr double kHours_s = 1800, kProduction_s = 1200, kSpan_c = 5;
  std::ptrdiff_t both_ways = 0;
  for (const auto& [name, face] : faces) {
    both_ways += std::count_if(face.approaches.begin(), face.approaches.end(),
                               [](const std::set<int>& signs) { return signs.size() >= 2; });
  }
  abilities |=
      at_least(6, kPoses, faces, [](const Face& f) { return f.along_axis; }) |
      at_least(1, kRepeats, faces, [](const Face& f) { return f.placements >= 2; }) |
      at_least(3, kYaws, faces, [](const Face& f) { return f.yaws.size() >= 3; }) |
      at_least(4, kSoak, faces, [](const Face& f) { return f.temperature_c.span() > kSpan_c; }) |
      (moves >= 2 ? kMoves : 0U) | (both_ways >= 3 ? kBothWays : 0U) |
      (temperature_c.span() > kSpan_c ? kTemperature : 0U) |
      (time_s.span() > kHours_s ? kHours : 0U);
  constexpr unsigned kEngineering = kShaker | kTemperature;
  return {abilities, (abilities & kEngineering) == kEngineering                   ? "engineering"
                     : (abilities & kPoses) != 0 && time_s.span() < kProduction_s ? "production"
                                                                                  : "other"};
}

namespace {

// Posterior over prior standard deviation from which on the data say nothing.
constexpr double kUndetermined = 0.35;
constexpr double kPoorClock_ppm = 10;  // hundreds of ppm would still have shown

enum class Observable { yes, too_small, no };

Observable observable(const Request& request, unsigned abilities, const Records& records,
                      const Explanation& explanation, const Findings& found,
                      const CatalogueEntry& entry) {
  const std::string name(entry.name);
  const auto unless = [](bool missing) { return missing ? Observable::no : Observable::yes; };
  const bool shaker = (abilities & kShaker) != 0;
  if (name == "clock_error") {
    return unless(!shaker && (!records.host.usable || records.host.clock_sd_ppm > kPoorClock_ppm));
  }
  if (name == "dropped_samples" || name == "duplicated_samples") {
    return unless(!shaker && !records.host.usable);
  }
  if (name == "axis_rotation") {
    return unless(!records.clean.axes_decidable);
  }
  if (name == "jitter" && found.bounds.count(name) == 0) {
    return Observable::no;  // of no tone all samples have a place
  }
  if ((entry.needs & ~abilities) != 0 ||
      (name == "filter_mismatch" && request.options.uncalibrated)) {
    return Observable::no;
  }
  if (!parameter_name(name).empty() && name != "seating" && name != "random_walk" &&
      name != "flicker") {
    if (explanation.undetermined(name) > kUndetermined) {
      return Observable::no;
    }
    return explanation.expected_nats(name) < kAccept_nats ? Observable::too_small : Observable::yes;
  }
  return Observable::yes;
}

}  // namespace

void list_not_observable(const Request& request, const ProtocolKind& kind, const Records& records,
                         const Explanation& explanation, const Findings& found, Diagnosis& out) {
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string name(entry.name);
    if (found.accepted(name) || !request.allowed(name)) {
      continue;
    }
    const Observable can = observable(request, kind.abilities, records, explanation, found, entry);
    if (can != Observable::yes) {
      const std::string_view segment =
          can == Observable::too_small && !entry.finer.empty() ? entry.finer : entry.segment;
      out.not_observable.emplace_back(name, segment.empty() ? "none" : std::string(segment));
    }
  }
}

}  // namespace sixpoint::gap

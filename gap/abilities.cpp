#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

void Diagnoser::find_abilities() {
  abilities_ = 0;
  std::set<std::string> faces;
  std::map<std::string, std::set<int>> yaws;
  std::map<std::string, int> placements;
  double coldest = 1e9, hottest = -1e9;
  double first_s = 1e18, last_s = -1e18;
  std::map<std::string, std::array<double, 2>> face_temperature;
  std::map<std::string, std::set<int>> approaches;
  int moves = 0;
  for (const Segment& s : bundle_.segments) {
    const Eigen::Vector3d up = s.rotation.col(2);
    const std::string face = fmt::format("{} {} {}", std::lround(3 * up[0]), std::lround(3 * up[1]),
                                         std::lround(3 * up[2]));
    const double t = s.host_start_s;
    first_s = std::min(first_s, t);
    last_s = std::max(last_s, t + static_cast<double>(s.samples) / bundle_.rate_hz);
    if (s.vibration) {
      abilities_ |= kShaker;
      if (s.vibration->amplitude_g >= 4) {
        abilities_ |= kHighShaker;
      }
      if (s.vibration->amplitude_g >= 8.5) {
        abilities_ |= kFullScale;
      }
      continue;
    }
    if (s.starts_placement) {
      ++placements[face];
      moves += s.approach_g.cwiseAbs().maxCoeff() > 0.2 ? 1 : 0;
      for (Eigen::Index a = 0; a < 3; ++a) {
        if (std::abs(s.approach_g[a]) > 0.05) {
          approaches[face + static_cast<char>('x' + a)].insert(s.approach_g[a] > 0 ? 1 : -1);
        }
      }
    }
    if (up.cwiseAbs().maxCoeff() > 0.99) {
      faces.insert(face);
    }
    yaws[face].insert(
        static_cast<int>(std::lround(std::atan2(s.rotation(0, 0) + 2 * s.rotation(1, 0),
                                                s.rotation(0, 1) + 2 * s.rotation(1, 1)) *
                                     4)));
    const double a = bundle_.temperature_at(t);
    const double b = bundle_.temperature_at(t + static_cast<double>(s.samples) / bundle_.rate_hz);
    coldest = std::min({coldest, a, b});
    hottest = std::max({hottest, a, b});
    auto [at, fresh] = face_temperature.emplace(face, std::array<double, 2>{a, b});
    at->second = {std::min({at->second[0], a, b}), std::max({at->second[1], a, b})};
    if (static_cast<double>(s.samples) >= 300 * bundle_.rate_hz) {
      abilities_ |= kLongRecord;
    }
  }
  if (faces.size() >= 6) {
    abilities_ |= kPoses;
  }
  if (moves >= 2) {
    abilities_ |= kMoves;
  }
  for (const auto& [face, count] : placements) {
    abilities_ |= count >= 2 ? kRepeats : 0U;
  }
  int turned = 0;
  for (const auto& [face, set] : yaws) {
    turned += set.size() >= 3 ? 1 : 0;
  }
  abilities_ |= turned >= 3 ? kYaws : 0U;
  int both = 0;
  for (const auto& [key, signs] : approaches) {
    both += signs.size() >= 2 ? 1 : 0;
  }
  abilities_ |= both >= 3 ? kBothWays : 0U;
  abilities_ |= hottest - coldest > 5 ? kTemperature : 0U;
  int soaked = 0;
  for (const auto& [face, range] : face_temperature) {
    soaked += range[1] - range[0] > 5 ? 1 : 0;
  }
  abilities_ |= soaked >= 4 ? kSoak : 0U;
  abilities_ |= last_s - first_s > 1800 ? kHours : 0U;
  abilities_ |= bundle_.host_clock.empty() ? 0U : kHostClock;
  out_.protocol = (abilities_ & (kShaker | kTemperature)) == (kShaker | kTemperature)
                      ? "engineering"
                  : (abilities_ & kPoses) != 0 && last_s - first_s < 1200 ? "production"
                                                                          : "other";
}

void Diagnoser::list_not_observable() {
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string name(entry.name);
    if (accepted(name) || !allowed(name)) {
      continue;
    }
    bool missing = (entry.needs & ~abilities_) != 0;
    bool too_small = false;
    if (name == "clock_error" || name == "dropped_samples" || name == "duplicated_samples") {
      missing = !timing_.usable && (abilities_ & kShaker) == 0;
      if (name == "clock_error" && !missing) {
        const double sd = timing_.usable ? timing_.clock_sd_ppm : 1;
        missing = sd > 10 && (abilities_ & kShaker) == 0;  // hundreds of ppm would still have shown
      }
    } else if (!missing && !parameter_name(name).empty() && search_ && name != "seating" &&
               name != "random_walk" && name != "flicker") {
      missing = search_->undetermined(name) > 0.35;
      too_small = !missing && search_->expected_nats(name) < kAccept;
    }
    if (name == "filter_mismatch") {
      missing = missing || options_.uncalibrated;
    }
    if (name == "axis_rotation") {
      missing = !clean_.axes_decidable;
    }
    if (missing || too_small) {
      const std::string_view segment =
          too_small && !entry.finer.empty() ? entry.finer : entry.segment;
      out_.not_observable.emplace_back(name, segment.empty() ? "none" : std::string(segment));
    }
  }
  struct Offer {
    const char* name;
    double minutes;
    unsigned gives;
  };
  constexpr std::array<Offer, 9> kOffers = {{{"faces", 1.7, kPoses | kMoves},
                                             {"faces_reversed", 1.7, kBothWays | kRepeats},
                                             {"reseat", 2.7, kRepeats},
                                             {"yaw", 6.5, kYaws},
                                             {"shaker", 9, kShaker},
                                             {"shaker_high", 6, kHighShaker | kFullScale},
                                             {"still", 20, kLongRecord | kHours},
                                             {"ramp_up", 18, kTemperature | kHours},
                                             {"soak", 46, kSoak | kTemperature | kHours}}};
  constexpr double kEntropy = 0.135;  // nats of "is it there", at one in thirty
  for (const Offer& offer : kOffers) {
    NextSegment next{offer.name, offer.minutes, 0, {}};
    if ((offer.gives & ~abilities_) != 0) {
      for (const auto& [name, segment] : out_.not_observable) {
        if (segment == offer.name) {
          next.separates.push_back(name);
          next.expected_nats += kEntropy;
        }
      }
    }
    for (const EffectFinding& e : out_.effects) {
      for (const std::string& other : e.confounded_with) {
        const CatalogueEntry* entry = find_entry(other);
        if (entry != nullptr && entry->segment == offer.name && (offer.gives & ~abilities_) != 0) {
          next.separates.push_back(e.name + "/" + other);
          next.expected_nats += 0.69;
        }
      }
    }
    if (!next.separates.empty()) {
      out_.next_segments.push_back(std::move(next));
    }
  }
  std::sort(out_.next_segments.begin(), out_.next_segments.end(),
            [](const NextSegment& a, const NextSegment& b) {
              return a.expected_nats / a.minutes > b.expected_nats / b.minutes;
            });
}

}  // namespace sixpoint::gap

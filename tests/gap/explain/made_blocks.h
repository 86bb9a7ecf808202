// Blocks of dwells made by hand: what an explanation finds in them is known in closed form.
#pragma once

#include <functional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "gap/explain/evidence.h"
#include "gap/explain/forward.h"
#include "gap/explain/scatter.h"
#include "gap/made_bundle.h"

namespace sixpoint::tests {

inline constexpr double kMeanNoise_mg = 0.13;  // of a mean of ten seconds

// These effects of the catalogue and no others.
inline gap::EvidenceOptions only(const std::set<std::string>& effects) {
  gap::EvidenceOptions options;
  options.allowed = [effects](const std::string& name) { return effects.count(name) != 0; };
  return options;
}

// Added to the nominal unit's mean, mg.
using MadeExcess = std::function<Eigen::Vector3d(const gap::Block&)>;

// Six faces three times, a new placement each, ten seconds every `every_s`, at 20 to 30 C.
inline std::vector<gap::Block> made_dwells(const MadeExcess& excess = {}, unsigned seed = 1,
                                           double every_s = 60,
                                           double seating_deg = gap::kNominalSeating_deg) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&](double sd) {
    return Eigen::Vector3d(sd * normal(random), sd * normal(random), sd * normal(random));
  };
  std::vector<gap::Block> blocks;
  for (int i = 0; i < 18; ++i) {
    const int face = i < 6 ? i : i < 12 ? 11 - i : (5 * i + 2) % 6;
    gap::Block block;
    block.segment = static_cast<std::size_t>(i);
    block.placement = i;
    block.session = i / 6;
    block.condition = (face + 3 * block.session) % 8;
    block.seconds = 10;
    block.middle_s = 30 + every_s * i;
    block.temperature_c = 20 + 10 * std::fmod(0.37 * i, 1.0);
    block.rotation = up_along(face / 2, face % 2 == 0 ? 1 : -1, (face + i) % 4);
    block.noise_mg = {3.9, 3.9, 5.5};
    block.white_mg2 = kMeanNoise_mg * kMeanNoise_mg * Eigen::Matrix3d::Identity();
    if (!blocks.empty()) {
      block.approach_g = block.rotation.col(2) - blocks.back().rotation.col(2);
    }
    const Eigen::Vector3d up_mg = 1000 * block.rotation.col(2);
    block.value_mg = up_mg + vector(seating_deg * M_PI / 180).cross(up_mg) + vector(kMeanNoise_mg);
    if (excess) {
      block.value_mg += excess(block);
    }
    blocks.push_back(std::move(block));
  }
  return blocks;
}

}  // namespace sixpoint::tests

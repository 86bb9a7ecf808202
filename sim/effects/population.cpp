#include "sim/effects/population.h"

#include <algorithm>

namespace sixpoint::sim {

namespace {

// Streams of their own, one per effect of the catalogue.
constexpr std::uint64_t kPopulationStream = 0x706F7075;

std::uint64_t stream_of(const EffectKind& kind) {
  const auto& all = effect_catalogue();
  const auto found =
      std::ranges::find_if(all, [&](const EffectKind& k) { return k.name == kind.name; });
  return kPopulationStream + static_cast<std::uint64_t>(found - all.begin());
}

double drawn(double mean, double spread, const Parameter& parameter, Random& random) {
  const double value = mean + spread * random.normal();
  return parameter.low < 0
             ? value
             : std::clamp(value, std::min(parameter.low, mean), std::max(parameter.high, mean));
}

}  // namespace

std::vector<EffectSpec> draw_effects(const std::vector<PopulationEffect>& population,
                                     std::uint64_t unit_seed) {
  std::vector<EffectSpec> unit;
  for (const PopulationEffect& effect : population) {
    Random random(unit_seed, stream_of(*effect.kind));
    const bool there = random.uniform() < effect.share_of_units;
    EffectSpec spec{effect.kind, effect.mean};
    for (const Parameter& parameter : effect.kind->parameters) {
      std::vector<double>& numbers = spec.values.at(parameter.name);
      const std::vector<double>& spread = effect.spread.at(parameter.name);
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        numbers[i] = drawn(numbers[i], spread[i], parameter, random);
      }
    }
    if (there) {
      unit.push_back(std::move(spec));
    }
  }
  return unit;
}

std::vector<EffectSpec> mean_effects(const std::vector<PopulationEffect>& population) {
  std::vector<EffectSpec> unit;
  for (const PopulationEffect& effect : population) {
    if (effect.share_of_units >= 0.5) {
      unit.push_back({effect.kind, effect.mean});
    }
  }
  return unit;
}

}  // namespace sixpoint::sim

// One step of the diagnosis at a time, on a bundle made by hand.
#pragma once

#include <algorithm>
#include <string>
#include <utility>

#include "gap/judge/steps.h"
#include "gap/made_bundle.h"

namespace sixpoint::tests {

inline const gap::EffectFinding* effect(const gap::Findings& found, const std::string& name) {
  const auto at = std::find_if(found.effects.begin(), found.effects.end(),
                               [&](const gap::EffectFinding& e) { return e.name == name; });
  return at == found.effects.end() ? nullptr : &*at;
}

struct Made {
  explicit Made(gap::Bundle made, gap::DiagnoseOptions with = {})
      : bundle(std::move(made)), options(std::move(with)) {}
  gap::Bundle bundle;
  gap::DiagnoseOptions options;
  gap::Request request{bundle, options};
  gap::CleanSamples clean = gap::clean_samples(bundle);
  gap::NoiseSpectrum noise = gap::noise_spectrum(bundle, clean);
};

}  // namespace sixpoint::tests

// Cuts a bundle into the blocks that the forward model predicts: dwells, pieces of long records,
// tones.
#pragma once

#include <vector>

#include "gap/bundle.h"
#include "gap/clean.h"
#include "gap/features/noise.h"
#include "gap/features/response.h"
#include "gap/features/tones.h"
#include "gap/forward.h"

namespace sixpoint::gap {

// Tones with slips, a frequency of their own or clipped samples give no block. Blocks come in the
// order of the segments; `condition` is one of eight folds, whole conditions each: a pose of one
// named run, a tone's frequency, a temperature.
std::vector<Block> make_blocks(const Bundle& bundle, const CleanSamples& clean,
                               const NoiseSpectrum& noise, const std::vector<ToneFit>& tones,
                               const Response& response);

}  // namespace sixpoint::gap

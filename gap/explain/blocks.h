// Cuts a bundle into the blocks that the forward model predicts: dwells, pieces of long records,
// tones.
//
//   const std::vector<Block> blocks = make_blocks(bundle, clean, noise, tones, response);
//   const Eigen::Vector3d mean_mg = blocks.front().value_mg.head<3>();
#pragma once

#include <vector>

#include "gap/explain/forward.h"
#include "gap/features/noise.h"
#include "gap/features/response.h"
#include "gap/features/tones.h"
#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

// In the order of the segments. `tones`: one per vibration segment, in order; those with slips, a
// frequency of their own or clipped samples give no block. `condition` is one of eight folds for
// hold-out, each of whole conditions: a pose of one named run, a tone's frequency, a temperature.
std::vector<Block> make_blocks(const Bundle& bundle, const CleanSamples& clean,
                               const NoiseSpectrum& noise, const std::vector<ToneFit>& tones,
                               const Response& response);

}  // namespace sixpoint::gap

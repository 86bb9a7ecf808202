// The acquisition mode is another one than that under which the constants were measured (16CPAN03):
// a common gain, and offsets that differ between the axes. What the constants say is then applied
// to readings that they do not fit.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind filter_mismatch_kind() {
  return effect_kind(
      "filter_mismatch", Stage::sensor, "acquisition mode other than the constants'",
      [](const ParameterSet& values, Random) {
        return sensed_effect([gain = values.at("gain")[0],
                              offset_g = vector_of(values, "offset_g")](Eigen::Vector3d& sensed) {
          sensed = gain * sensed + offset_g;
        });
      },
      {parameter("gain", "1", {0.88}, 0.75, 1.3, "16CPAN03: recordings read low by 5 to 20 %"),
       parameter("offset_g", "g", {0.12, -0.12, 0.12}, -0.3, 0.3,
                 "affected recordings of real units: 0.1 to 0.2 g of either sign")});
}

}  // namespace sixpoint::sim

// The acquisition mode is another one than that under which the constants were measured (16CPAN03):
// a common gain, and offsets that differ between the axes. What the constants say is then applied
// to readings that they do not fit.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class FilterMismatch final : public Effect {
 public:
  explicit FilterMismatch(const ParameterSet& values)
      : gain_(values.at("gain")[0]), offset_g_(vector_of(values, "offset_g")) {}
  void on_sensor(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      sensed = gain_ * sensed + offset_g_;
    }
  }

 private:
  double gain_;
  Eigen::Vector3d offset_g_;
};

}  // namespace

EffectKind filter_mismatch_kind() {
  return {"filter_mismatch",
          Stage::sensor,
          "acquisition mode other than the constants'",
          {{"gain", "1", {0.88}, 0.75, 1.3, "16CPAN03: recordings read low by 5 to 20 %"},
           {"offset_g",
            "g",
            {0.12, -0.12, 0.12},
            -0.3,
            0.3,
            "affected recordings of real units: 0.1 to 0.2 g of either sign"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<FilterMismatch>(values);
          }};
}

}  // namespace sixpoint::sim

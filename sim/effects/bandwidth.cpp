// A lower anti-alias corner, on signal and noise: Butterworth low-pass at the sample rate, bilinear
// transform with the corner prewarped. A corner at or above half the sample rate does nothing.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

// Second-order section, direct form II transposed, unity gain at zero frequency.
struct Section {
  double b0 = 1, b1 = 0, b2 = 0, a1 = 0, a2 = 0;
  Eigen::Array3d s1 = Eigen::Array3d::Zero();
  Eigen::Array3d s2 = Eigen::Array3d::Zero();

  Eigen::Array3d step(const Eigen::Array3d& in) {
    Eigen::Array3d out = b0 * in + s1;
    s1 = b1 * in - a1 * out + s2;
    s2 = b2 * in - a2 * out;
    return out;
  }
  void rest_at(const Eigen::Array3d& in) {
    s2 = (b2 - a2) * in;
    s1 = (b1 - a1) * in + s2;
  }
};

class Bandwidth final : public Effect {
 public:
  explicit Bandwidth(const ParameterSet& values)
      : corner_hz_(values.at("corner_hz")[0]),
        order_(static_cast<int>(std::clamp(std::round(values.at("order")[0]), 1.0, 8.0))) {}
  void on_recording(const RecordingPlan& plan) override {
    sections_.clear();
    if (!(corner_hz_ > 0 && corner_hz_ < 0.499 * plan.rate_hz)) {
      return;
    }
    const double k = std::tan(std::numbers::pi * corner_hz_ / plan.rate_hz);
    for (int pair = 0; pair < order_ / 2; ++pair) {
      const double damping =
          2 * std::sin(std::numbers::pi * (2 * pair + 1) / (2.0 * order_));  // 1 / Q
      const double norm = 1 / (1 + damping * k + k * k);
      Section section;
      section.b0 = section.b2 = k * k * norm;
      section.b1 = 2 * section.b0;
      section.a1 = 2 * (k * k - 1) * norm;
      section.a2 = (1 - damping * k + k * k) * norm;
      sections_.push_back(section);
    }
    if (order_ % 2 == 1) {
      Section section;
      section.b0 = section.b1 = k / (1 + k);
      section.a1 = (k - 1) / (1 + k);
      sections_.push_back(section);
    }
  }
  void on_placement(const Placement& placement) override {
    fresh_ = fresh_ || !placement.contiguous;
  }
  void on_analog(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      Eigen::Array3d value = sensed.array();
      for (Section& section : sections_) {
        if (fresh_) {
          section.rest_at(value);
        }
        value = section.step(value);
      }
      fresh_ = false;
      sensed = value.matrix();
    }
  }
  bool needs_run_in() const override { return true; }

 private:
  double corner_hz_;
  int order_;
  std::vector<Section> sections_;
  bool fresh_ = true;
};

}  // namespace

EffectKind bandwidth_kind() {
  return effect_kind(
      "bandwidth", Stage::sensor, "lower anti-alias corner, on signal and noise",
      make_effect<Bandwidth>,
      {parameter(
           "corner_hz", "Hz", {25}, 5, 50,
           "ADXL362 datasheet: half or a quarter of the output data rate, 12.5 to 50 Hz at 100 Hz"),
       parameter("order", "1", {4}, 1, 8, "steepness; whole number")});
}

}  // namespace sixpoint::sim

// The entries of the catalogue, each defined in the file of its name, and what effects share.
//
//   EffectKind gain_kind() {
//     return effect_kind(
//         "gain", Stage::sensor, "a gain of all axes",
//         [](const ParameterSet& values, Random) {
//           const double gain = values.at("gain")[0];
//           return sensed_effect([gain](Eigen::Vector3d& sensed) { sensed *= gain; });
//         },
//         {parameter("gain", "1", {1}, 0.9, 1.1, "datasheet")});
//   }
//
// An effect that is one formula is made of functions (parts.h); an effect with several hooks is a
// class, made by make_effect<Class>.
#pragma once

#include <cmath>
#include <numbers>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "sim/effects/parts.h"

namespace sixpoint::sim {

EffectKind axis_rotation_kind();
EffectKind bandwidth_kind();
EffectKind charging_zeros_kind();
EffectKind clock_error_kind();
EffectKind drift_kind();
EffectKind dropped_samples_kind();
EffectKind duplicated_samples_kind();
EffectKind electrical_line_kind();
EffectKind filter_mismatch_kind();
EffectKind flicker_kind();
EffectKind floor_vibration_kind();
EffectKind hysteresis_kind();
EffectKind idle_sleep_kind();
EffectKind jitter_kind();
EffectKind local_gravity_kind();
EffectKind misalignment_kind();
EffectKind non_orthogonality_kind();
EffectKind offset_tempco_kind();
EffectKind random_walk_kind();
EffectKind rounding_floor_kind();
EffectKind saturation_kind();
EffectKind seating_kind();
EffectKind second_order_kind();
EffectKind sensitivity_tempco_kind();
EffectKind settling_kind();
EffectKind soft_mount_kind();
EffectKind third_order_kind();
EffectKind tilt_kind();
EffectKind truncation_kind();
EffectKind warm_up_kind();
EffectKind wrap_kind();

inline Parameter parameter(std::string name, std::string unit, std::vector<double> default_value,
                           double low, double high, std::string source) {
  return {std::move(name), std::move(unit), std::move(default_value), low, high, std::move(source)};
}
// A rotation about X by default, of at most `most_deg` about any axis (rotation_by_deg).
inline Parameter rotation_parameter(double about_x_deg, double most_deg, std::string source) {
  return parameter("rotation_vector_deg", "deg", {about_x_deg, 0, 0}, -most_deg, most_deg,
                   std::move(source));
}
inline EffectKind effect_kind(std::string name, Stage stage, std::string summary,
                              decltype(EffectKind::make) make,
                              std::vector<Parameter> parameters = {}) {
  return {std::move(name), stage, std::move(summary), std::move(parameters), std::move(make)};
}

// Tempcos are relative to the datasheet's reference.
inline constexpr double kReferenceTemperature_c = 25;

// The rotation by a vector in degrees: its direction is the axis, its length the angle.
Eigen::Matrix3d rotation_by_deg(const std::vector<double>& rotation_vector_deg);

// A parameter of three numbers.
Eigen::Vector3d vector_of(const ParameterSet& values, std::string_view name);

template <class E>
std::unique_ptr<Effect> make_effect(const ParameterSet& values, Random random) {
  if constexpr (std::is_constructible_v<E, const ParameterSet&, Random>) {
    return std::make_unique<E>(values, random);
  } else {
    return std::make_unique<E>(values);
  }
}

// A sine of the parameters vector_mg and frequency_hz. Its phase is drawn; it runs on between
// segments.
class Line {
 public:
  Line(const ParameterSet& values, Random& random)
      : vector_g_(vector_of(values, "vector_mg") / kMgPerG),
        omega_(2 * std::numbers::pi * values.at("frequency_hz")[0]),
        phase_rad_(random.uniform(0, 2 * std::numbers::pi)) {}
  Eigen::Vector3d at(double time_s) const {
    return std::sin(omega_ * time_s + phase_rad_) * vector_g_;
  }

 private:
  Eigen::Vector3d vector_g_;
  double omega_;
  double phase_rad_;
};

// Samples that are met one by one, each with the same probability (the parameter `rate`), and that
// shift the times of the later ones.
class RareSamples : public Effect {
 public:
  static Parameter rate();
  RareSamples(const ParameterSet& values, Random random);
  void on_recording(const RecordingPlan& plan) final { interval_s_ = 1 / plan.rate_hz; }

 protected:
  // The shift starts anew with the sample clock.
  void begin(const SimulatedBlock& block);
  // Sets until_next_, which is geometric; 0 = the very next sample.
  void draw();

  std::uint64_t until_next_ = 0;
  double interval_s_ = 0.01;
  double shift_s_ = 0;

 private:
  double rate_;
  Random random_;
  double clock_start_s_ = 0;
  bool started_ = false;
};

// Samples begin ... end - 1.
struct SampleRun {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
};

// Runs of whole seconds that together hold about `samples`, in order and apart, a second at least where
// any are asked for. configuration where not even one has room.
//
// | at_rest | runs                                         | most that is held      |
// |---------|----------------------------------------------|------------------------|
// | no      | up to six                                    | half of the recording  |
// | yes     | as many as it takes of 1 to 20 s, each       | what has room          |
// |         | within one rest, behind its first sample     |                        |
Result<std::vector<SampleRun>> draw_runs(const std::string& effect, const RecordingPlan& plan,
                                         double samples, bool at_rest, Random& random);

// Runs that are asked about by rising sample numbers.
class SampleRuns {
 public:
  SampleRuns() = default;
  explicit SampleRuns(Result<std::vector<SampleRun>> drawn) {
    if (drawn) {
      runs_ = *std::move(drawn);
    } else {
      problem_ = fail(drawn.error());
    }
  }
  // That they could not be drawn.
  const Status& problem() const { return problem_; }
  bool contain(std::uint64_t sample) {
    while (next_ < runs_.size() && sample >= runs_[next_].end) {
      ++next_;
    }
    return next_ < runs_.size() && sample >= runs_[next_].begin;
  }

 private:
  std::vector<SampleRun> runs_;
  Status problem_;
  std::size_t next_ = 0;
};

}  // namespace sixpoint::sim

// The constructors of the catalogue's entries; each is defined in the file of its name.
#pragma once

#include <string_view>
#include <vector>

#include "sim/effect.h"

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

// Tempcos are relative to the datasheet's reference.
inline constexpr double kReferenceTemperature_c = 25;

// The rotation by a vector in degrees: its direction is the axis, its length the angle.
Eigen::Matrix3d rotation_by_deg(const std::vector<double>& rotation_vector_deg);

// A parameter of three numbers.
Eigen::Vector3d vector_of(const ParameterSet& values, std::string_view name);

// Samples begin ... end - 1.
struct SampleRun {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
};

// Runs of whole seconds that together hold about `samples`, in order and apart: up to three, or, at
// rest only, as many as it takes of 1 to 20 s, each within one rest.
std::vector<SampleRun> draw_runs(const RecordingPlan& plan, double samples, bool at_rest,
                                 Random& random);

}  // namespace sixpoint::sim

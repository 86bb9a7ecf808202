// The constructors of the catalogue's entries; each is defined in the file of its name.
#pragma once

#include "sim/effect.h"

namespace sixpoint::sim {

EffectKind charging_zeros_kind();
EffectKind clock_error_kind();
EffectKind misalignment_kind();
EffectKind offset_tempco_kind();
EffectKind second_order_kind();
EffectKind tilt_kind();
EffectKind truncation_kind();

// The rotation by a vector in degrees: its direction is the axis, its length the angle.
Eigen::Matrix3d rotation_by_deg(const std::vector<double>& rotation_vector_deg);

}  // namespace sixpoint::sim

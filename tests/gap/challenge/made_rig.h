// A unit with one effect from outside the catalogue and without noise, moved by hand.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "gap/challenge/outside.h"
#include "sanitized.h"

namespace sixpoint::tests {

using Eigen::Matrix3d;
using Eigen::Vector3d;

inline constexpr double kRate_hz = 100;
inline constexpr double kLsbPerG = 256;
inline constexpr int kForms = kSanitized ? 20 : 40;

inline const gap::OutsideKind& kind_of(std::string_view name) {
  const auto& kinds = gap::outside_kinds();
  const auto found = std::find_if(kinds.begin(), kinds.end(), [&](const gap::OutsideKind& kind) {
    return kind.effect.name == name;
  });
  EXPECT_NE(found, kinds.end()) << name;
  return *found;
}

// The rotation under which `up` of the sensor's frame points up, turned by `yaw_deg` on the spot.
inline Matrix3d pose(const Vector3d& up, double yaw_deg = 0) {
  return Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), up).toRotationMatrix() *
         Eigen::AngleAxisd(yaw_deg * std::numbers::pi / 180, Vector3d::UnitZ()).toRotationMatrix();
}

// Of the forms, a part and not nearly all.
inline void expect_some(int forms) {
  EXPECT_GT(forms, kForms / 5);
  EXPECT_LT(forms, kForms * 4 / 5);
}

// A unit with one effect and without noise, moved by hand.
class Rig {
 public:
  Rig(std::string_view name, std::uint64_t form, double severity = 1)
      : effect_(kind_of(name).effect.make({{"severity", {severity}}}, Random(form, 7))) {}

  void plan(const sim::RecordingPlan& plan) { effect_->on_recording(plan); }

  void place(const Matrix3d& rotation, double pause_s = 5) {
    sim::Placement at;
    time_s_ += pause_s;
    temperature_c += ramp_c_per_s * pause_s;
    at.start_s = time_s_;
    at.previous = started_ ? rotation_ : rotation;
    at.rotation = rotation_ = rotation;
    at.anew = true;
    at.contiguous = false;
    started_ = true;
    effect_->on_placement(at);
  }

  // With a tone: along the laboratory's vertical.
  const sim::SimulatedBlock& record(std::size_t samples, double tone_g = 0, double tone_hz = 20) {
    block_.first_sample = sample_;
    block_.clock_start_s = time_s_;
    block_.time_s.clear();
    block_.temperature_c.clear();
    for (std::size_t i = 0; i < samples; ++i) {
      block_.time_s.push_back(time_s_);
      block_.temperature_c.push_back(temperature_c);
      time_s_ += 1 / kRate_hz;
      temperature_c += ramp_c_per_s / kRate_hz;
    }
    sample_ += samples;
    block_.motion.assign(samples, {rotation_, Vector3d::UnitZ()});
    for (std::size_t i = 0; i < samples; ++i) {
      block_.motion[i].force_lab_g.z() +=
          tone_g * std::sin(2 * std::numbers::pi * tone_hz * block_.time_s[i]);
    }
    effect_->on_sampling(block_);
    effect_->on_stimulus(block_);
    block_.true_g.clear();
    for (const sim::MotionState& motion : block_.motion) {
      block_.true_g.push_back(motion.rotation * motion.force_lab_g);
    }
    block_.sensed_g = block_.true_g;
    effect_->on_sensor(block_);
    effect_->on_analog(block_);
    return block_;
  }
  Vector3d change(std::size_t sample) const {
    return block_.sensed_g[sample] - block_.true_g[sample];
  }
  // What record() would give at this pose, as the change of its first sample.
  Vector3d change_here() {
    record(1);
    return change(0);
  }

  std::vector<gt3x::Counts> store(std::vector<gt3x::Counts> counts) {
    record(counts.size());
    block_.stored = std::move(counts);
    effect_->on_firmware(block_);
    return block_.stored;
  }
  sim::Tone tone(double frequency_hz) const {
    sim::Tone made{Vector3d::UnitZ(), frequency_hz, 1, 0};
    effect_->on_tone(made);
    return made;
  }

  double temperature_c = 23;
  double ramp_c_per_s = 0;

 private:
  std::unique_ptr<sim::Effect> effect_;
  sim::SimulatedBlock block_;
  Matrix3d rotation_ = Matrix3d::Identity();
  std::uint64_t sample_ = 0;
  double time_s_ = 30;
  bool started_ = false;
};

inline int forms_where(std::string_view kind, const std::function<bool(Rig&)>& holds) {
  int count = 0;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig(kind, form);
    count += holds(rig) ? 1 : 0;
  }
  return count;
}

}  // namespace sixpoint::tests

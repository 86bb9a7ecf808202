#include "sim/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"

namespace sixpoint::sim {

namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

// 0 at 0, 1 at 1, with no velocity at both ends.
double smooth_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

Eigen::Vector3d random_direction(Random& random) {
  Eigen::Vector3d direction;
  do {
    direction = {random.normal(), random.normal(), random.normal()};
  } while (direction.norm() < 1e-3);
  return direction.normalized();
}

class Still final : public Motion {
 public:
  Still(const Eigen::Matrix3d& rotation, double gravity_g) : state_{rotation, {0, 0, gravity_g}} {}
  void at(double /*time_s*/, MotionState& state) override { state = state_; }

 private:
  MotionState state_;
};

class Turn final : public Motion {
 public:
  Turn(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to, double duration_s,
       std::uint64_t seed, double gravity_g)
      : from_(from), to_(to), duration_s_(duration_s), gravity_g_(gravity_g) {
    Random random(seed, 0x7475726E);
    for (Tone& tone : tremor_) {
      tone = {random_direction(random), random.uniform(3, 9), 0.05, random.uniform(0, kTwoPi)};
    }
  }
  void at(double time_s, MotionState& state) override {
    const double part = duration_s_ > 0 ? time_s / duration_s_ : 1;
    state.rotation = from_.slerp(smooth_step(part), to_).toRotationMatrix();
    state.force_lab_g = {0, 0, gravity_g_};
    if (part > 0 && part < 1) {
      const double fade = std::sin(std::numbers::pi * part);
      for (const Tone& tone : tremor_) {
        state.force_lab_g += fade * tone.amplitude_g *
                             std::sin(kTwoPi * tone.frequency_hz * time_s + tone.phase_rad) *
                             tone.direction_lab;
      }
    }
  }

 private:
  Eigen::Quaterniond from_;
  Eigen::Quaterniond to_;
  double duration_s_;
  double gravity_g_;
  std::array<Tone, 3> tremor_;
};

class Shaker final : public Motion {
 public:
  Shaker(const Eigen::Matrix3d& rotation, const Tone& tone, double gravity_g)
      : rotation_(rotation), tone_(tone), gravity_g_(gravity_g) {
    tone_.direction_lab.normalize();
  }
  void at(double time_s, MotionState& state) override {
    state.rotation = rotation_;
    state.force_lab_g = Eigen::Vector3d(0, 0, gravity_g_) +
                        tone_.amplitude_g *
                            std::sin(kTwoPi * tone_.frequency_hz * time_s + tone_.phase_rad) *
                            tone_.direction_lab;
  }

 private:
  Eigen::Matrix3d rotation_;
  Tone tone_;
  double gravity_g_;
};

class FreeLiving final : public Motion {
 public:
  FreeLiving(double duration_s, std::uint64_t seed, double gravity_g) : gravity_g_(gravity_g) {
    Random random(seed, 0x66726565);
    Eigen::Quaterniond pose(rotation_with_up(random_direction(random)));
    double at_s = 0;
    do {
      Bout bout;
      bout.start_s = at_s;
      bout.moving = random.uniform() < 0.6;
      bout.end_s = at_s + (bout.moving ? random.uniform(10, 60) : random.uniform(15, 90));
      bout.from = pose;
      if (bout.moving) {
        pose = Eigen::Quaterniond(rotation_with_up(random_direction(random)));
        bout.swing_axis = random_direction(random);
        bout.swing_rad = random.uniform(0.1, 0.7);
        const double step_hz = random.uniform(0.7, 2.5);
        const double amplitude_g = random.uniform(0.1, 1.2);
        for (std::size_t i = 0; i < bout.tones.size(); ++i) {
          const double order = static_cast<double>(i) + 1;
          bout.tones[i] = {random_direction(random), step_hz * order, amplitude_g / order,
                           random.uniform(0, kTwoPi)};
        }
      }
      bout.to = pose;
      at_s = bout.end_s;
      bouts_.push_back(bout);
    } while (at_s < duration_s);
  }

  void at(double time_s, MotionState& state) override {
    while (last_ > 0 && time_s < bouts_[last_].start_s) {
      --last_;
    }
    while (last_ + 1 < bouts_.size() && time_s >= bouts_[last_].end_s) {
      ++last_;
    }
    const Bout& bout = bouts_[last_];
    state.force_lab_g = {0, 0, gravity_g_};
    if (!bout.moving) {
      state.rotation = bout.from.toRotationMatrix();
      return;
    }
    const double local_s = time_s - bout.start_s;
    const double part = local_s / (bout.end_s - bout.start_s);
    const double fade = std::min(smooth_step(local_s), smooth_step(bout.end_s - time_s));
    const Tone& first = bout.tones[0];
    const double swing =
        fade * bout.swing_rad * std::sin(kTwoPi * first.frequency_hz * local_s + first.phase_rad);
    state.rotation =
        (Eigen::AngleAxisd(swing, bout.swing_axis) * bout.from.slerp(smooth_step(part), bout.to))
            .toRotationMatrix();
    for (const Tone& tone : bout.tones) {
      state.force_lab_g += fade * tone.amplitude_g *
                           std::sin(kTwoPi * tone.frequency_hz * local_s + tone.phase_rad) *
                           tone.direction_lab;
    }
  }

 private:
  struct Bout {
    double start_s = 0;
    double end_s = 0;
    bool moving = false;
    Eigen::Quaterniond from = Eigen::Quaterniond::Identity();
    Eigen::Quaterniond to = Eigen::Quaterniond::Identity();
    Eigen::Vector3d swing_axis = Eigen::Vector3d::UnitX();
    double swing_rad = 0;
    std::array<Tone, 3> tones;
  };
  double gravity_g_;
  std::vector<Bout> bouts_;
  std::size_t last_ = 0;
};

}  // namespace

Eigen::Matrix3d rotation_with_up(const Eigen::Vector3d& direction) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction.normalized())
      .toRotationMatrix();
}

std::unique_ptr<Motion> still(const Eigen::Matrix3d& rotation, double gravity_g) {
  return std::make_unique<Still>(rotation, gravity_g);
}

std::unique_ptr<Motion> turn(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to,
                             double duration_s, std::uint64_t seed, double gravity_g) {
  return std::make_unique<Turn>(from, to, duration_s, seed, gravity_g);
}

std::unique_ptr<Motion> shaker(const Eigen::Matrix3d& rotation, const Tone& tone,
                               double gravity_g) {
  return std::make_unique<Shaker>(rotation, tone, gravity_g);
}

std::unique_ptr<Motion> free_living(double duration_s, std::uint64_t seed, double gravity_g) {
  return std::make_unique<FreeLiving>(duration_s, seed, gravity_g);
}

void MotionSequence::add(std::unique_ptr<Motion> motion, double duration_s) {
  const double start_s = this->duration_s();
  parts_.push_back({std::move(motion), start_s, start_s + duration_s});
}

void MotionSequence::at(double time_s, MotionState& state) {
  if (parts_.empty()) {
    state = MotionState{};
    return;
  }
  while (last_ > 0 && time_s < parts_[last_].start_s) {
    --last_;
  }
  while (last_ + 1 < parts_.size() && time_s >= parts_[last_].end_s) {
    ++last_;
  }
  parts_[last_].motion->at(time_s - parts_[last_].start_s, state);
}

}  // namespace sixpoint::sim

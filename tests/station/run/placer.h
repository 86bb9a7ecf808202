// A unit that is turned and laid down, for tests of the state machine.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "station/run/jig_run.h"

namespace sixpoint::station {

// Feeds the machine with samples as a person does who turns and lays down a unit, and records its
// actions. The sensor differs from the approximation as unit 16CPAN03 does: 10 % and 0.15 g.
class Placer {
 public:
  explicit Placer(JigRunOptions options = {}, std::uint64_t seed = 1)
      : Placer(options, seed, approximation(), truth_of_16cpan03()) {}
  Placer(const JigRunOptions& options, std::uint64_t seed, const calib::Calibration& first,
         const calib::Calibration& truth)
      : options_(options), truth_(truth), run(options, first), random(seed) {
    keep(run.start(0));
  }
  static calib::Calibration approximation() {
    calib::Calibration calibration;
    calibration.sensitivity_g_per_lsb.fill(1 / 260.0);
    calibration.zero_lsb = {50, 40, 30};
    return calibration;
  }
  static calib::Calibration truth_of_16cpan03() {
    calib::Calibration calibration;
    calibration.sensitivity_g_per_lsb.fill(1 / 234.0);
    calibration.zero_lsb = {50 + 39.0, 40 - 39.0, 30 + 35.0};
    return calibration;
  }

  const calib::Calibration& truth() const { return truth_; }

  void sample(const PerAxis<double>& force_g) {
    time_s += 1.0 / options_.rate_hz;
    Sample sample;
    sample.time_s = time_s;
    sample.temperature_c = 25;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double g = force_g[axis] + noise_mg / 1000 * random.normal();
      const double lsb = g / truth().sensitivity_g_per_lsb[axis] + truth().zero_lsb[axis];
      sample.counts[axis] =
          static_cast<std::int16_t>(std::clamp<double>(std::round(lsb), -2048, 2047));
    }
    if (stuck) {
      sample.counts[2] = 77;
    }
    keep(run.on_sample(sample));
    keep(run.on_time(time_s));
  }
  void shake(double seconds) {
    for (int i = 0; i < seconds * options_.rate_hz; ++i) {
      const double phase = 20 * time_s;
      sample({0.5 * std::sin(phase), 0.5 * std::cos(phase), 0.7});
    }
  }
  void rest(PerAxis<double> force_g, double seconds) {
    for (int i = 0; i < seconds * options_.rate_hz; ++i) {
      sample(force_g);
    }
  }
  // Turns and rests until something is decided, or 10 s.
  void place(Pose pose, double tilt_deg = 0, double direction_deg = 30) {
    shake(1.5);
    const std::size_t before = decided;
    const std::size_t asked_before = asked;
    const double tilt = tilt_deg / 180 * std::acos(-1.0);
    const double direction = direction_deg / 180 * std::acos(-1.0);
    PerAxis<double> force_g{};
    const std::size_t axis = device::axis_of(pose);
    force_g[axis] = device::sign_of(pose) * std::cos(tilt);
    force_g[(axis + 1) % 3] = std::sin(tilt) * std::cos(direction);
    force_g[(axis + 2) % 3] = std::sin(tilt) * std::sin(direction);
    for (int i = 0; i < 10 * options_.rate_hz && decided == before && asked == asked_before; ++i) {
      sample(force_g);
    }
  }
  // Both rounds of verification, as they are asked for.
  void verify() {
    while (run.phase() == JigPhase::verifying || run.phase() == JigPhase::reseating) {
      place(wanted);
    }
  }
  void keep(const std::vector<JigAction>& actions) {
    for (const JigAction& action : actions) {
      last = action.kind == JigAction::Kind::place ? last : action;
      // A new question counts as a decision: a detour ends with nothing else.
      if (action.kind == JigAction::Kind::place) {
        wanted = action.pose;
        ++asked;
      }
      log.push_back(action);
      decided += action.kind == JigAction::Kind::accepted ||
                         action.kind == JigAction::Kind::refused ||
                         action.kind == JigAction::Kind::finished
                     ? 1
                     : 0;
    }
  }
  int count(JigAction::Kind kind) const {
    return static_cast<int>(std::count_if(
        log.begin(), log.end(), [kind](const JigAction& action) { return action.kind == kind; }));
  }
  std::string last_refusal() const {
    for (auto action = log.rbegin(); action != log.rend(); ++action) {
      if (action->kind == JigAction::Kind::refused) {
        return action->text;
      }
    }
    return {};
  }

 private:
  JigRunOptions options_;
  calib::Calibration truth_;

 public:
  JigRun run;
  Random random;
  double time_s = 0;
  double noise_mg = 4;
  bool stuck = false;
  std::size_t decided = 0;
  std::size_t asked = 0;
  Pose wanted = Pose::plus_z;
  JigAction last;
  std::vector<JigAction> log;
};

}  // namespace sixpoint::station

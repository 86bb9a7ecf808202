#include "sim/scenario.h"

#include <cmath>
#include <utility>

#include "sim/firmware.h"

namespace sixpoint::sim {

namespace {

Tone tone_under(Tone tone, const std::vector<std::unique_ptr<Effect>>& effects) {
  for (const auto& effect : effects) {
    effect->on_tone(tone);
  }
  return tone;
}

}  // namespace

FilterConfiguration Scenario::filter_in_force() const {
  return filter.value_or(filter_of_recording(unit.serial, unit.firmware, unit.calibrated));
}

std::vector<Placement> Scenario::placements() const {
  std::vector<Placement> list;
  double at_s = 0;
  const Eigen::Matrix3d* before = nullptr;
  for (const MotionSpec& spec : motions) {
    if (before != nullptr) {
      at_s += turn_s;
    }
    // Free-living motion begins where it likes; for history it counts as the pose before it.
    const Eigen::Matrix3d& pose =
        spec.kind == MotionKind::free_living && before != nullptr ? *before : spec.rotation;
    const bool same = before != nullptr && pose == *before;
    list.push_back({at_s, pose, before == nullptr ? pose : *before, !same, same && turn_s == 0});
    before = &pose;
    at_s += spec.duration_s;
  }
  return list;
}

RecordingPlan Scenario::plan() const {
  RecordingPlan plan;
  plan.rate_hz = rate_hz;
  double at_s = 0;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    at_s += i > 0 ? turn_s : 0;
    const auto first = static_cast<std::uint64_t>(std::ceil(at_s * rate_hz));
    at_s += motions[i].duration_s;
    const auto end = static_cast<std::uint64_t>(std::floor(at_s * rate_hz));
    if (motions[i].kind == MotionKind::still && end > first) {
      plan.rests.push_back({first, end - first});
    }
  }
  plan.samples = static_cast<std::uint64_t>(std::floor(at_s)) * static_cast<std::uint64_t>(rate_hz);
  return plan;
}

std::unique_ptr<MotionSequence> Scenario::motion() const {
  auto sequence = std::make_unique<MotionSequence>();
  std::uint64_t turn_seed = seed;
  const auto running = make_effects(effects, seed);
  for (const MotionSpec& spec : motions) {
    std::unique_ptr<Motion> next;
    switch (spec.kind) {
      case MotionKind::still:
        next = still(spec.rotation, gravity_g);
        break;
      case MotionKind::shaker:
        next = shaker(spec.rotation, tone_under(spec.tone, running), gravity_g);
        break;
      case MotionKind::free_living:
        next = free_living(spec.duration_s, spec.seed, gravity_g);
        break;
    }
    if (turn_s > 0 && sequence->duration_s() > 0) {
      MotionState before;
      MotionState after;
      sequence->at(sequence->duration_s(), before);
      next->at(0, after);
      sequence->add(turn(before.rotation, after.rotation, turn_s, ++turn_seed, gravity_g), turn_s);
    }
    sequence->add(std::move(next), spec.duration_s);
  }
  return sequence;
}

}  // namespace sixpoint::sim

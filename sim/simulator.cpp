#include "sim/simulator.h"

#include <algorithm>

namespace sixpoint::sim {

namespace {

constexpr std::uint64_t kSensorNoiseStream = 0x6E6F6973;

NumberFormat format_under(const std::vector<std::unique_ptr<Effect>>& effects) {
  NumberFormat format;
  for (const auto& effect : effects) {
    effect->on_digital(format);
  }
  return format;
}

}  // namespace

Simulator::Simulator(const UnitTruth& unit, const SimulatorOptions& options, Motion& motion,
                     std::vector<std::unique_ptr<Effect>> effects)
    : options_(options),
      motion_(motion),
      effects_(std::move(effects)),
      sensor_(unit, options.filter, Random(options.seed, kSensorNoiseStream),
              format_under(effects_)),
      firmware_(unit, options.stored_bits, format_under(effects_)) {
  options_.plan.rate_hz = options_.rate_hz;
  for (const auto& effect : effects_) {
    effect->on_recording(options_.plan);
  }
  if (options_.placements.empty()) {
    MotionState state;
    motion_.at(options_.start_s, state);
    options_.placements.push_back({options_.start_s, state.rotation, state.rotation, true, false});
  }
}

void Simulator::next(std::size_t samples, SimulatedBlock& block) {
  block.first_sample = done_;
  block.clock_start_s = options_.start_s;
  block.time_s.resize(samples);
  for (std::size_t i = 0; i < samples; ++i) {
    block.time_s[i] = nominal_time_s(done_ + i);
  }
  for (const auto& effect : effects_) {
    effect->on_sampling(block);
  }
  const auto due = [&](double time_s) {
    return next_placement_ < options_.placements.size() &&
           options_.placements[next_placement_].start_s <= time_s;
  };
  const auto place = [&](double time_s) {
    while (due(time_s)) {
      for (const auto& effect : effects_) {
        effect->on_placement(options_.placements[next_placement_]);
      }
      ++next_placement_;
    }
  };
  if (samples > 0) {
    place(block.time_s.front());
  }
  if (samples == 0 || !due(*std::max_element(block.time_s.begin(), block.time_s.end()))) {
    make(block);
    done_ += samples;
    return;
  }
  // Somewhere inside a pose begins: piece by piece.
  const std::vector<double> times = block.time_s;
  block.motion.clear();
  block.true_g.clear();
  block.sensed_g.clear();
  block.temperature_c.clear();
  block.raw_lsb.clear();
  block.stored.clear();
  for (std::size_t begin = 0; begin < samples;) {
    place(times[begin]);
    std::size_t end = begin + 1;
    while (end < samples && !due(times[end])) {
      ++end;
    }
    part_.first_sample = done_ + begin;
    part_.clock_start_s = block.clock_start_s;
    part_.time_s.assign(times.begin() + static_cast<std::ptrdiff_t>(begin),
                        times.begin() + static_cast<std::ptrdiff_t>(end));
    make(part_);
    const auto append = [](auto& to, const auto& from) {
      to.insert(to.end(), from.begin(), from.end());
    };
    append(block.motion, part_.motion);
    append(block.true_g, part_.true_g);
    append(block.sensed_g, part_.sensed_g);
    append(block.temperature_c, part_.temperature_c);
    append(block.raw_lsb, part_.raw_lsb);
    append(block.stored, part_.stored);
    begin = end;
  }
  done_ += samples;
}

void Simulator::make(SimulatedBlock& block) {
  const std::size_t samples = block.size();
  block.motion.resize(samples);
  block.true_g.resize(samples);
  block.raw_lsb.resize(samples);
  block.stored.resize(samples);
  block.temperature_c.assign(samples, options_.temperature_c);
  for (std::size_t i = 0; i < samples; ++i) {
    motion_.at(block.time_s[i], block.motion[i]);
  }
  for (const auto& effect : effects_) {
    effect->on_stimulus(block);
  }
  for (std::size_t i = 0; i < samples; ++i) {
    block.true_g[i] = block.motion[i].rotation * block.motion[i].force_lab_g;
  }
  block.sensed_g = block.true_g;
  for (const auto& effect : effects_) {
    effect->on_sensor(block);
  }
  for (Eigen::Vector3d& sensed : block.sensed_g) {
    sensor_.add_noise(sensed);
  }
  for (const auto& effect : effects_) {
    effect->on_analog(block);
  }
  for (std::size_t i = 0; i < samples; ++i) {
    block.raw_lsb[i] = sensor_.read(block.sensed_g[i]);
    block.stored[i] = firmware_.store(block.raw_lsb[i]);
  }
  for (const auto& effect : effects_) {
    effect->on_firmware(block);
  }
}

}  // namespace sixpoint::sim

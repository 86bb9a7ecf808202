#include "sim/simulator.h"

namespace sixpoint::sim {

namespace {

constexpr std::uint64_t kNoiseStream = 0x6E6F6973;

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
      sensor_(unit, options.filter, Random(options.seed, kNoiseStream)),
      firmware_(unit, options.stored_bits, format_under(effects_)) {}

void Simulator::next(std::size_t samples, SimulatedBlock& block) {
  block.first_sample = done_;
  block.time_s.resize(samples);
  block.motion.resize(samples);
  block.true_g.resize(samples);
  block.sensed_g.resize(samples);
  block.raw_lsb.resize(samples);
  block.stored.resize(samples);
  block.temperature_c.assign(samples, options_.temperature_c);
  for (std::size_t i = 0; i < samples; ++i) {
    block.time_s[i] = nominal_time_s(done_ + i);
  }
  for (const auto& effect : effects_) {
    effect->on_sampling(block);
  }
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
  for (std::size_t i = 0; i < samples; ++i) {
    block.raw_lsb[i] = sensor_.read(block.sensed_g[i]);
    block.stored[i] = firmware_.store(block.raw_lsb[i]);
  }
  for (const auto& effect : effects_) {
    effect->on_firmware(block);
  }
  done_ += samples;
}

}  // namespace sixpoint::sim

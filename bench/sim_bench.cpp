// How fast is the simulator? Baseline: real time at 100 Hz; and the same run without effects.
#include <chrono>
#include <cstdio>
#include <functional>

#include "base/memory_env.h"
#include "sim/bundle_writer.h"
#include "sim/protocol_run.h"
#include "sim/recording.h"
#include "sim/scenario.h"
#include "sim/standard_protocol.h"

namespace {

using sixpoint::sim::EffectSpec;

std::vector<EffectSpec> all_effects() {
  std::vector<EffectSpec> list;
  for (const auto& kind : sixpoint::sim::effect_catalogue()) {
    list.push_back({&kind, *sixpoint::sim::complete_parameters(kind, {})});
  }
  return list;
}

double best_of(int times, const std::function<void()>& work) {
  double best = 1e9;
  for (int i = 0; i < times; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(
        best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

void print(const char* what, double seconds, double simulated_s, double baseline) {
  std::printf("%-46s %8.3f s  %9.0f x real time  %5.2f x without effects\n", what, seconds,
              simulated_s / seconds, seconds / baseline);
}

}  // namespace

int main() {
  using namespace sixpoint;
  sim::ProtocolRun run;
  run.segments = sim::draw_protocol(sim::StandardProtocol::engineering, 1);
  run.temperature = sim::unit_temperature(run.segments, run.rate_hz);
  const double bundle_s =
      static_cast<double>(run.segments.back().first_sample + run.segments.back().samples) /
      run.rate_hz;
  const double plain = best_of(5, [&] { (void)sim::run_protocol(run); });
  run.effects = all_effects();
  const double full = best_of(5, [&] { (void)sim::run_protocol(run); });
  print("run_protocol, engineering, nominal", plain, bundle_s, plain);
  print("run_protocol, engineering, all effects", full, bundle_s, plain);

  sim::Scenario scenario = *sim::parse_scenario(
      R"({"rate_hz": 100, "motions": [{"kind": "still", "duration_s": 5000},
          {"kind": "shaker", "duration_s": 5000}]})");
  const double length_s = 10'002;
  const auto simulate = [&] {
    MemoryEnv memory;
    (void)sim::write_recording(memory.env.files, "/r.gt3x", scenario);
  };
  const double recording = best_of(3, simulate);
  scenario.effects = all_effects();
  const double recording_full = best_of(3, simulate);
  print("simulate, plain recording, nominal", recording, length_s, recording);
  print("simulate, plain recording, all effects", recording_full, length_s, recording);

  sim::Scenario bundle = *sim::parse_scenario(R"({"protocol": "engineering"})");
  const auto write = [&] {
    MemoryEnv memory;
    (void)sim::write_bundle(memory.env.files, "/b", bundle);
  };
  const double bundled = best_of(3, write);
  bundle.protocol->effects = all_effects();
  const double bundled_full = best_of(3, write);
  print("simulate, engineering bundle, nominal", bundled, bundle_s, bundled);
  print("simulate, engineering bundle, all effects", bundled_full, bundle_s, bundled);
  return 0;
}

// Wrong verdicts: units at the limits and units as they come, each through a whole jig run, with
// and without the guard band. Truth is the virtual unit's. No slips, no faults: these are the run's
// part.
//
//   verdict_bench [UNITS]       default 1000 of each
//
// Baseline: simple acceptance (guard factor 0), which passes half of what lies just outside.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "base/memory_env.h"
#include "base/random.h"
#include "device/wire/wire_unit.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_jig.h"
#include "station/run/jig_session.h"

namespace {

using namespace sixpoint;  // NOLINT(google-build-using-namespace)
using station::JigVerdict;

struct Counts {
  int units = 0;
  int outside = 0;  // truly
  int wrong_pass = 0;
  int wrong_pass_conditional = 0;
  int wrong_fail = 0;
  int wrong_fail_conditional = 0;
  std::array<int, 6> verdicts{};
};

// Truly inside all limits, by the sensor under `current`. Noise is far from its limit.
bool is_inside(const sim::SensorTruth& truth, const station::Limits& limits) {
  const station::Limit& zero = limits.of("zero_offset_mg");
  const station::Limit& sensitivity = limits.of("sensitivity_deviation_percent");
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double zero_mg = kMgPerG * truth.zero_lsb[axis] / truth.sensitivity_lsb_per_g[axis];
    const double percent = 100 * (1 / (0.004 * truth.sensitivity_lsb_per_g[axis]) - 1);
    if (zero_mg < *zero.low || zero_mg > *zero.high || percent < *sensitivity.low ||
        percent > *sensitivity.high) {
      return false;
    }
  }
  return true;
}

void measure(std::uint64_t seed, const sim::GivenProperties& given,
             const station::JigSessionOptions& options, Counts& counts) {
  mocks::VirtualUnitOptions unit_options;
  unit_options.seed = seed;
  unit_options.truth = sim::draw_unit(seed, given);
  auto plugged =
      std::make_shared<mocks::PluggedUnit>(unit_options, std::make_shared<ManualClock>());
  mocks::VirtualJig jig(plugged);
  auto unit = device::WireUnit::open(mocks::link_to(plugged, false));
  MemoryEnv env;
  const auto report = station::run_jig({unit->get(), &jig}, env.env, options, {});
  if (!report) {
    std::fprintf(stderr, "%s\n", report.error().brief().c_str());
    std::exit(70);
  }
  const bool inside = is_inside(plugged->unit.truth().current, options.limits);
  ++counts.units;
  counts.outside += inside ? 0 : 1;
  ++counts.verdicts[static_cast<std::size_t>(report->verdict)];
  counts.wrong_pass += !inside && report->verdict == JigVerdict::pass ? 1 : 0;
  counts.wrong_pass_conditional +=
      !inside && report->verdict == JigVerdict::conditional_pass ? 1 : 0;
  counts.wrong_fail += inside && report->verdict == JigVerdict::fail ? 1 : 0;
  counts.wrong_fail_conditional +=
      inside && report->verdict == JigVerdict::conditional_fail ? 1 : 0;
}

// One quantity of one axis lies within `spread` of one of its limits.
sim::GivenProperties at_the_limit(Random& random, const station::Limits& limits, bool zero) {
  sim::GivenProperties given;
  PerAxis<double> sensitivity{};
  PerAxis<double> zeros{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    sensitivity[axis] = random.uniform(215, 260);
    zeros[axis] = random.uniform(-40, 60);
  }
  const auto axis = static_cast<std::size_t>(random.below(3));
  const bool high = random.below(2) == 1;
  if (zero) {
    const station::Limit& limit = limits.of("zero_offset_mg");
    const double zero_mg = (high ? *limit.high : *limit.low) + random.uniform(-1.5, 1.5);
    zeros[axis] = zero_mg / kMgPerG * sensitivity[axis];
  } else {
    const station::Limit& limit = limits.of("sensitivity_deviation_percent");
    const double percent = (high ? *limit.high : *limit.low) + random.uniform(-0.25, 0.25);
    sensitivity[axis] = 1 / (0.004 * (1 + percent / 100));
  }
  given.current_sensitivity_lsb_per_g = sensitivity;
  given.current_zero_lsb = zeros;
  return given;
}

void print(const char* name, const Counts& counts) {
  std::printf("%-34s %5d %7d %10d %12d %10d %12d   %d/%d/%d/%d/%d\n", name, counts.units,
              counts.outside, counts.wrong_pass, counts.wrong_pass_conditional, counts.wrong_fail,
              counts.wrong_fail_conditional, counts.verdicts[0], counts.verdicts[1],
              counts.verdicts[2], counts.verdicts[3], counts.verdicts[4]);
}

}  // namespace

int main(int argc, char** argv) {
  const int units = argc > 1 ? std::atoi(argv[1]) : 1000;
  std::printf("%-34s %5s %7s %10s %12s %10s %12s   %s\n", "", "units", "outside", "wrong pass",
              "(condition.)", "wrong fail", "(condition.)",
              "pass/cond. pass/cond. fail/fail/inconclusive");
  for (const bool guarded : {true, false}) {
    for (const char* where : {"zero at the limit", "sensitivity at the limit", "as they come"}) {
      Random random(20140324);
      station::JigSessionOptions options;
      options.gravity = calib::LocalGravity{kStandardGravity_m_per_s2, 3e-4};
      options.limits.decision.guard_factor = guarded ? 1 : 0;
      Counts counts;
      for (int i = 0; i < units; ++i) {
        const bool zero = where[0] == 'z';
        const sim::GivenProperties given =
            where[0] == 'a' ? sim::GivenProperties() : at_the_limit(random, options.limits, zero);
        measure(static_cast<std::uint64_t>(i) + 1, given, options, counts);
      }
      print((std::string(where) + (guarded ? "" : ", no guard band")).c_str(), counts);
    }
  }
  return 0;
}

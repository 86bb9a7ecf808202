// A test of a driver without a real unit: Sixpoint's virtual unit answers, first without faults,
// then with every fifth report damaged.
#include <cmath>
#include <cstdio>
#include <memory>

#include "base/memory_env.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "mocks/faults/fault_plan.h"
#include "mocks/in_process/in_process.h"
#include "sim/unit_truth.h"

using namespace sixpoint;

namespace {

int failures = 0;

void expect(bool holds, const char* what) {
  if (!holds) {
    std::printf("FAILED: %s\n", what);
    ++failures;
  }
}

// This stands for your own driver: the mean of z over one second, in raw counts.
Result<double> mean_of_z(device::Unit& unit) {
  SIXPOINT_CHECK(unit.set_filter(device::FilterConfiguration::current));
  SIXPOINT_CHECK(unit.start_stream(100));
  double sum = 0;
  int count = 0;
  while (count < 100) {
    SIXPOINT_ASSIGN(const auto block, unit.next_samples(std::chrono::seconds(1)));
    if (!block) {
      return fail(ErrorCode::device_unavailable, "the unit is silent", unit.address(),
                  "plug it in again");
    }
    for (const auto& counts : block->counts) {
      sum += counts[2];
      ++count;
    }
  }
  SIXPOINT_CHECK(unit.stop_stream());
  return sum / count;
}

void measure(const char* name, mocks::FaultPlan plan) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  const auto plugged = std::make_shared<mocks::PluggedUnit>(options, std::move(plan),
                                                            std::make_shared<ManualClock>());
  auto unit = device::WireUnit::open(mocks::link_to(plugged, false));
  expect(unit.has_value(), "the unit is identified");
  if (!unit) {
    return;
  }
  const auto mean = mean_of_z(**unit);
  expect(mean.has_value(), "a second of samples comes");
  // The unit lies with z up; the mock knows sensitivity and zero of its sensor.
  const sim::SensorTruth& sensor = options.truth.current;
  const double expected = sensor.sensitivity_lsb_per_g[2] + sensor.zero_lsb[2];
  expect(mean && std::abs(*mean - expected) < 1, "z reads 1 g");
  std::printf("%s: %.2f, expected %.2f; %d damaged reports\n", name, mean.value_or(0), expected,
              static_cast<int>((*unit)->stream_statistics().damaged_reports));
}

}  // namespace

int main() {
  measure("all is well", {});
  const auto plan = mocks::parse_fault_plan(
      R"({"schema": "sixpoint/faults/1",
          "faults": [{"fault": "bit_flip", "at_report": 3, "every": 5}]})");
  expect(plan.has_value(), "the fault plan is read");
  if (plan) {
    measure("a bad cable", *plan);
  }
  return failures == 0 ? 0 : 1;
}

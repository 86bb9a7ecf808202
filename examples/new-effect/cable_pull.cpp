// A new effect in one file: the cable of the jig pulls the sensor's zero along x, until it is taken
// off. The program makes a protocol run with it and without it, and compares.
//
// To make it one of the catalogue: move the class and cable_pull_kind() to
// sim/effects/cable_pull.cpp and add the kind to sim/effects/kinds.h and to the list in
// sim/effects/effect.cpp. The diagnosis, `gap challenge`, `simulate` and `virtual:` then know it by
// its name.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "sim/effects/kinds.h"
#include "sim/protocol_run.h"
#include "sim/standard_protocol.h"

namespace {

using namespace sixpoint;

class CablePull final : public sim::Effect {
 public:
  CablePull(double pull_mg, double minutes) : pull_mg_(pull_mg), until_s_(60 * minutes) {}

  // The stage "sensor": what the sensor element feels, in g, before noise and rounding.
  void on_sensor(sim::SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.time_s[i] < until_s_) {
        block.sensed_g[i].x() += pull_mg_ / 1000;
      }
    }
  }

 private:
  double pull_mg_;
  double until_s_;
};

sim::EffectKind cable_pull_kind() {
  return {"cable_pull",
          sim::Stage::sensor,
          "the cable pulls along x until it is taken off",
          {sim::parameter("pull_mg", "mg", {20}, 0, 50, "this example"),
           sim::parameter("minutes", "min", {1}, 0, 60, "this example")},
          [](const sim::ParameterSet& values, Random) -> std::unique_ptr<sim::Effect> {
            return std::make_unique<CablePull>(values.at("pull_mg")[0], values.at("minutes")[0]);
          }};
}

// The mean of x over a segment, in counts of the record.
double mean_x_lsb(const std::vector<gt3x::Counts>& counts, const sim::ProtocolSegment& segment) {
  double sum = 0;
  for (std::uint64_t i = 0; i < segment.samples; ++i) {
    sum += counts[segment.first_sample + i][0];
  }
  return sum / static_cast<double>(segment.samples);
}

int failed(const Error& error) {
  std::fprintf(stderr, "%s\n", error.brief().c_str());
  return 1;
}

}  // namespace

int main() {
  const sim::EffectKind kind = cable_pull_kind();
  const auto values = sim::complete_parameters(kind, {{"pull_mg", {30}}});
  if (!values) {
    return failed(values.error());
  }
  sim::ProtocolRun run;
  run.segments = sim::draw_protocol(sim::StandardProtocol::production, 7);
  const auto without = sim::run_protocol(run);
  run.effects = {{&kind, *values}};
  const auto with = sim::run_protocol(run);
  if (!without || !with) {
    return failed(without ? with.error() : without.error());
  }
  bool right = true;
  for (const sim::ProtocolSegment& segment : run.segments) {
    const double seen_mg = (mean_x_lsb(*with, segment) - mean_x_lsb(*without, segment)) /
                           run.accel_scale_lsb_per_g * 1000;
    // Oracle: 30 mg for the share of the segment that lies before the minute; a count is 4 mg, but
    // the noise spreads the mean over less than 0.3 mg.
    const double end_s = segment.host_start_s + static_cast<double>(segment.samples) / run.rate_hz;
    const double before_s =
        std::clamp(60 - segment.host_start_s, 0.0, end_s - segment.host_start_s);
    const double made_mg = 30 * before_s / (end_s - segment.host_start_s);
    std::printf("%-6s x moves by %6.2f mg (made: %6.2f)\n", segment.name.c_str(), seen_mg, made_mg);
    right = right && std::abs(seen_mg - made_mg) < 0.3;
  }
  return right ? 0 : 1;
}

#include "gap/explain/temperature_lag.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace sixpoint::gap {
namespace {

constexpr double kStep_s = 10;
// Lags that are tried (conventions): a sensor on a board follows in seconds, a unit in its case in
// minutes.
constexpr double kLeastLag_s = 10;
constexpr double kFactor = 1.5;
constexpr int kLags = 12;  // to 865 s
constexpr double kTwentyTimes_nats = 3;
constexpr double kChanges_c = 2;
constexpr double kLongest_s = 30 * 86400;  // what a protocol says is another's word

double end_s(const Segment& segment, const Bundle& bundle) {
  return segment.host_start_s + static_cast<double>(segment.samples) / bundle.rate_hz;
}

double span_s(const Bundle& bundle) {
  return end_s(bundle.segments.back(), bundle) - bundle.segments.front().host_start_s;
}

bool changes(const Bundle& bundle) {
  double coldest_c = bundle.segments.front().temperature_start_c;
  double warmest_c = coldest_c;
  for (const Segment& segment : bundle.segments) {
    for (const double commanded_c : {segment.temperature_start_c, segment.temperature_end_c}) {
      coldest_c = std::min(coldest_c, commanded_c);
      warmest_c = std::max(warmest_c, commanded_c);
    }
  }
  return warmest_c - coldest_c > kChanges_c;
}

// One group of each effect, of its typical size; none of what has several shapes.
std::vector<int> usual_groups(const EvidenceModel& model) {
  constexpr std::array<std::string_view, 8> kUsual = {
      "tilt",        "misalignment",  "non_orthogonality",  "second_order",
      "third_order", "offset_tempco", "sensitivity_tempco", "drift"};
  std::vector<int> groups;
  for (const std::string_view effect : kUsual) {
    if (const auto own = model.groups_of(std::string(effect)); !own.empty()) {
      groups.push_back(own.front());
    }
  }
  std::ranges::sort(groups);
  return groups;
}

}  // namespace

TemperatureLog following_temperature(const Bundle& bundle, double lag_s) {
  TemperatureLog log;
  const double start_s = bundle.segments.front().host_start_s;
  double unit_c = bundle.segments.front().temperature_start_c;
  const double kept = lag_s > 0 ? std::exp(-kStep_s / lag_s) : 0;
  auto segment = bundle.segments.begin();
  const double length_s = std::clamp(span_s(bundle), 0.0, kLongest_s);
  const int steps = 1 + static_cast<int>(std::ceil(length_s / kStep_s));
  for (int step = 0; step < steps; ++step) {
    const double time_s = start_s + kStep_s * step;
    while (segment + 1 != bundle.segments.end() && time_s > end_s(*segment, bundle)) {
      ++segment;
    }
    const double share =
        std::clamp((time_s - segment->host_start_s) * bundle.rate_hz /
                       static_cast<double>(std::max<std::size_t>(1, segment->samples)),
                   0.0, 1.0);
    const double commanded_c =
        segment->temperature_start_c * (1 - share) + segment->temperature_end_c * share;
    unit_c = kept * unit_c + (1 - kept) * commanded_c;
    log.host_time_s.push_back(time_s);
    log.temperature_c.push_back(unit_c);
  }
  return log;
}

double likeliest_lag_s(const Bundle& bundle, std::vector<Block> blocks,
                       const EvidenceOptions& options) {
  if (!bundle.temperature.empty() || bundle.segments.empty() || blocks.empty() ||
      !changes(bundle) || !(span_s(bundle) <= kLongest_s)) {
    return 0;
  }
  const auto nats_of = [&](double lag_s) {
    Bundle followed;
    followed.temperature = following_temperature(bundle, lag_s);
    for (Block& block : blocks) {
      block.temperature_c = followed.temperature_at(block.middle_s);
    }
    const EvidenceModel model(blocks, options);
    const Whitened w = model.whiten(model.linearise(model.first_guess()), Scatter::nominal, 0);
    // The likelihood, and not the evidence: that rises where temperature hardly moves, for what it
    // then can't explain costs less.
    const Solution solved = model.solve(w.sums, usual_groups(model));
    return solved.nats + half_log_determinant(solved.normal);
  };
  const double none_nats = nats_of(0);
  double best_s = 0;
  double best_nats = none_nats + kTwentyTimes_nats;
  const auto try_lag = [&](double lag_s) {
    if (const double nats = nats_of(lag_s); nats > best_nats) {
      best_nats = nats;
      best_s = lag_s;
    }
  };
  for (int i = 0; i < kLags; ++i) {
    try_lag(kLeastLag_s * std::pow(kFactor, i));
  }
  double factor = kFactor;
  for (int halving = 0; halving < 6 && best_s > 0; ++halving) {
    factor = std::sqrt(factor);
    const double centre_s = best_s;
    try_lag(centre_s / factor);
    try_lag(centre_s * factor);
  }
  return best_s;
}

}  // namespace sixpoint::gap

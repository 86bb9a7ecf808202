#include "sim/effects/effect.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

std::string_view to_string(Stage stage) {
  constexpr std::array<std::string_view, 5> kNames = {"stimulus", "sensor", "sampling", "digital",
                                                      "firmware"};
  return kNames[static_cast<std::size_t>(stage)];
}

const std::vector<EffectKind>& effect_catalogue() {
  static const std::vector<EffectKind> kCatalogue = {
      tilt_kind(),
      seating_kind(),
      settling_kind(),
      floor_vibration_kind(),
      soft_mount_kind(),
      local_gravity_kind(),
      misalignment_kind(),
      non_orthogonality_kind(),
      second_order_kind(),
      third_order_kind(),
      hysteresis_kind(),
      offset_tempco_kind(),
      sensitivity_tempco_kind(),
      warm_up_kind(),
      drift_kind(),
      filter_mismatch_kind(),
      bandwidth_kind(),
      flicker_kind(),
      random_walk_kind(),
      electrical_line_kind(),
      axis_rotation_kind(),
      clock_error_kind(),
      jitter_kind(),
      dropped_samples_kind(),
      duplicated_samples_kind(),
      truncation_kind(),
      rounding_floor_kind(),
      saturation_kind(),
      wrap_kind(),
      idle_sleep_kind(),
      charging_zeros_kind(),
  };
  return kCatalogue;
}

Result<const EffectKind*> find_effect(std::string_view name) {
  std::vector<std::string_view> names;
  for (const EffectKind& kind : effect_catalogue()) {
    if (kind.name == name) {
      return &kind;
    }
    names.push_back(kind.name);
  }
  return fail(ErrorCode::configuration, fmt::format("there is no effect '{}'", printable(name, 60)),
              {}, fmt::format("use one of: {}", fmt::join(names, ", ")));
}

Result<ParameterSet> complete_parameters(const EffectKind& kind, const ParameterSet& given) {
  ParameterSet values;
  for (const Parameter& parameter : kind.parameters) {
    values[parameter.name] = parameter.default_value;
  }
  for (const auto& [name, numbers] : given) {
    const auto value = values.find(name);
    if (value == values.end()) {
      return fail(
          ErrorCode::configuration,
          fmt::format("the effect '{}' has no parameter '{}'", kind.name, printable(name, 60)), {},
          "docs/scenario.md lists the parameters of every effect");
    }
    if (numbers.size() != value->second.size() ||
        !std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) {
      return fail(ErrorCode::configuration,
                  fmt::format("'{}' of the effect '{}' takes {} finite number(s)", name, kind.name,
                              value->second.size()),
                  {}, "docs/scenario.md lists the parameters of every effect");
    }
    value->second = numbers;
  }
  return values;
}

std::vector<std::unique_ptr<Effect>> make_effects(const std::vector<EffectSpec>& specs,
                                                  std::uint64_t seed) {
  std::vector<std::unique_ptr<Effect>> effects;
  effects.reserve(specs.size());
  for (std::size_t i = 0; i < specs.size(); ++i) {
    effects.push_back(specs[i].kind->make(specs[i].values, Random(seed, 100 + i)));
  }
  return effects;
}

Status check_effects(const std::vector<std::unique_ptr<Effect>>& effects) {
  for (const auto& effect : effects) {
    SIXPOINT_CHECK(effect->problem());
  }
  return {};
}

Eigen::Matrix3d rotation_by_deg(const std::vector<double>& rotation_vector_deg) {
  const Eigen::Vector3d vector =
      Eigen::Vector3d(rotation_vector_deg[0], rotation_vector_deg[1], rotation_vector_deg[2]) *
      (std::numbers::pi / 180);
  const double angle = vector.norm();
  return angle == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                    : Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

Eigen::Vector3d vector_of(const ParameterSet& values, std::string_view name) {
  const std::vector<double>& numbers = values.find(name)->second;
  return {numbers[0], numbers[1], numbers[2]};
}

Parameter RareSamples::rate() {
  return parameter("rate", "1", {0.002}, 0, 0.02,
                   "share of samples; a full buffer or a slow flash: 1e-4 to 1e-2");
}

RareSamples::RareSamples(const ParameterSet& values, Random random)
    : rate_(std::clamp(values.at("rate")[0], 0.0, 0.5)), random_(random) {
  draw();
}

void RareSamples::begin(const SimulatedBlock& block) {
  if (!started_ || block.clock_start_s != clock_start_s_) {
    started_ = true;
    clock_start_s_ = block.clock_start_s;
    shift_s_ = 0;
  }
}

void RareSamples::draw() {
  until_next_ = ~std::uint64_t{0};
  if (rate_ > 0) {
    until_next_ = static_cast<std::uint64_t>(
        std::min(1e15, std::floor(std::log(1 - random_.uniform()) / std::log(1 - rate_))));
  }
}

namespace {

// Seconds of the recording, by number, that a run may hold: it stays within one stretch.
struct Stretch {
  std::uint64_t first = 0;
  std::uint64_t count = 0;
  std::uint64_t before = 0;  // seconds of the stretches before it
};

std::vector<Stretch> stretches_of(const RecordingPlan& plan, bool at_rest,
                                  std::uint64_t per_second) {
  if (!at_rest || plan.rests.empty()) {
    return {{0, plan.length() / per_second, 0}};
  }
  std::vector<Stretch> stretches;
  std::uint64_t before = 0;
  for (const RecordingPlan::Stretch& rest : plan.rests) {
    // Behind its first sample, which is what is held.
    const std::uint64_t first = rest.first_sample / per_second + 1;
    const std::uint64_t end = (rest.first_sample + rest.samples) / per_second;
    if (first < end) {
      stretches.push_back({first, end - first, before});
      before += end - first;
    }
  }
  return stretches;
}

}  // namespace

Result<std::vector<SampleRun>> draw_runs(const std::string& effect, const RecordingPlan& plan,
                                         double samples, bool at_rest, Random& random) {
  const auto per_second = static_cast<std::uint64_t>(std::max(1.0, std::round(plan.rate_hz)));
  const auto length_s = static_cast<double>(plan.length()) / static_cast<double>(per_second);
  double asked_s = std::max(1.0, std::round(samples / static_cast<double>(per_second)));
  if (!at_rest) {
    asked_s = std::min(asked_s, std::max(1.0, std::floor(length_s / 2)));
  }
  const std::vector<Stretch> stretches = stretches_of(plan, at_rest, per_second);
  const double room_s =
      stretches.empty() ? 0 : static_cast<double>(stretches.back().before + stretches.back().count);
  const double longest_s = at_rest ? 20 : std::max(1.0, std::ceil(asked_s / 3));
  double left_s = samples > 0 ? asked_s : 0;
  std::map<std::uint64_t, std::uint64_t> runs;  // begin and end, in seconds
  constexpr int kMostFailures = 100'000;        // one after another: nothing more fits in
  for (int failures = 0; left_s >= 1 && room_s > 0 && failures < kMostFailures; ++failures) {
    const double wanted_s = std::min(
        left_s, std::max(1.0, std::round(longest_s * random.uniform(at_rest ? 0.05 : 0.6, 1))));
    const auto at = static_cast<std::uint64_t>(random.uniform() * room_s);
    const auto stretch = std::prev(std::ranges::upper_bound(stretches, at, {}, &Stretch::before));
    const std::uint64_t begin = stretch->first + (at - stretch->before);
    const std::uint64_t end = begin + static_cast<std::uint64_t>(wanted_s);
    const auto next = runs.lower_bound(begin);
    const bool apart = (next == runs.end() || end < next->first) &&
                       (next == runs.begin() || std::prev(next)->second < begin);
    if (apart && end <= stretch->first + stretch->count) {
      runs.emplace(begin, end);
      left_s -= wanted_s;
      failures = 0;
    }
  }
  if (left_s >= 1 && runs.empty()) {
    return fail(ErrorCode::configuration,
                fmt::format("the recording has no room for the effect '{}'", effect), {},
                at_rest
                    ? "it holds whole seconds of one rest, behind the rest's first sample: give "
                      "longer rests"
                    : "give a longer recording");
  }
  std::vector<SampleRun> drawn;
  drawn.reserve(runs.size());
  for (const auto& [begin, end] : runs) {
    drawn.push_back({begin * per_second, end * per_second});
  }
  return drawn;
}

}  // namespace sixpoint::sim

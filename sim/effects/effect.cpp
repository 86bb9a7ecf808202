#include "sim/effects/effect.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
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

std::vector<SampleRun> draw_runs(const RecordingPlan& plan, double samples, bool at_rest,
                                 Random& random) {
  const double per_second = std::max(1.0, std::round(plan.rate_hz));
  const auto length = static_cast<double>(plan.length());
  double left_s = std::min(std::round(samples / per_second), std::floor(length / per_second / 2));
  const double longest_s = at_rest ? 20 : std::max(1.0, std::ceil(left_s / 3));
  std::vector<SampleRun> runs;
  constexpr int kMostTries = 100'000;
  for (int attempt = 0; left_s >= 1 && attempt < kMostTries; ++attempt) {
    const double wanted_s = std::min(
        left_s, std::max(1.0, std::round(longest_s * random.uniform(at_rest ? 0.05 : 0.6, 1))));
    const double begin = std::floor(random.uniform() * length / per_second) * per_second;
    const SampleRun run{static_cast<std::uint64_t>(begin),
                        static_cast<std::uint64_t>(begin + wanted_s * per_second)};
    const bool inside =
        !at_rest || plan.rests.empty()
            ? run.end <= plan.length()
            : std::any_of(plan.rests.begin(), plan.rests.end(), [&](const auto& rest) {
                return run.begin >= rest.first_sample + 1 &&
                       run.end <= rest.first_sample + rest.samples;
              });
    const bool apart = std::none_of(runs.begin(), runs.end(), [&](const SampleRun& other) {
      return run.begin <= other.end && other.begin <= run.end;
    });
    if (inside && apart) {
      runs.push_back(run);
      left_s -= wanted_s;
    }
  }
  std::sort(runs.begin(), runs.end(),
            [](const SampleRun& a, const SampleRun& b) { return a.begin < b.begin; });
  return runs;
}

}  // namespace sixpoint::sim

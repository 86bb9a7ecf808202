#include "gap/challenge/trials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/random.h"
#include "gap/challenge/outside.h"

namespace sixpoint::gap {

namespace {

using sim::EffectKind;
using sim::EffectSpec;
using sim::ParameterSet;

constexpr std::uint64_t kTrialStream = 0x74726961;

class Drawing {
 public:
  Drawing(std::uint64_t seed, std::uint64_t index)
      : random_(seed + 0x9E3779B97F4A7C15ULL * (index + 1), kTrialStream) {}

  Random& random() { return random_; }

  double severity(bool faint = false) {
    return faint ? log_uniform(0.005, 0.3) : log_uniform(0.3, 3);
  }

  double log_uniform(double low, double high) {
    return std::exp(random_.uniform(std::log(low), std::log(high)));
  }

  // Names and severities of a realistic unit, the dominant one first. `gradual`: those that a unit
  // may have a little of; of them the first ten are what every unit has.
  std::vector<TrialEffect> realistic(const std::vector<std::string>& gradual) {
    constexpr std::size_t kEveryUnit = 10;
    std::vector<std::string> names = gradual;
    const auto shuffle = [&](std::size_t count) {
      for (std::size_t i = count; i > 1; --i) {
        std::swap(names[i - 1], names[static_cast<std::size_t>(random_.below(i))]);
      }
    };
    if (random_.uniform() < 0.5) {
      names.resize(std::min(names.size(), kEveryUnit));
      shuffle(names.size());
    } else {
      shuffle(names.size());
      names.resize(std::min<std::size_t>(names.size(), 4 + random_.below(5)));
    }
    // The one that dominates the recording: others move too little even when they are large.
    const auto dominant = std::find_if(names.begin(), names.end(), [](const std::string& name) {
      constexpr std::array kCan = {"non_orthogonality", "misalignment", "offset_tempco",
                                   "warm_up",           "settling",     "floor_vibration",
                                   "electrical_line",   "seating",      "tilt"};
      return std::find(kCan.begin(), kCan.end(), name) != kCan.end();
    });
    if (dominant != names.end()) {
      std::rotate(names.begin(), dominant, dominant + 1);
    }
    std::vector<TrialEffect> drawn;
    for (const std::string& name : names) {
      // 5 to 40 ppm of 500
      const bool clock = name == "clock_error";
      drawn.push_back({name, drawn.empty() ? log_uniform(3, 6)
                             : clock       ? log_uniform(0.01, 0.08)
                                           : log_uniform(0.05, 0.5)});
    }
    return drawn;
  }

  double sign() { return random_.uniform() < 0.5 ? -1 : 1; }

  // Three numbers whose largest is `size`, either sign.
  std::vector<double> axes(double size) {
    std::vector<double> numbers(kAxes);
    double most = 0;
    for (double& x : numbers) {
      x = random_.uniform(-1, 1);
      most = std::max(most, std::abs(x));
    }
    for (double& x : numbers) {
      x *= size / std::max(most, 1e-6);
    }
    return numbers;
  }

  // What one effect of the catalogue consists of in this trial: mostly one, with a by-product where
  // real ones have it.
  Result<std::vector<EffectSpec>> effect(const std::string& name, double severity) {
    std::vector<EffectSpec> list;
    for (const auto& [kind_name, given] : parts(name, severity)) {
      SIXPOINT_ASSIGN(const EffectKind* kind, sim::find_effect(kind_name));
      SIXPOINT_ASSIGN(ParameterSet values, sim::complete_parameters(*kind, given));
      list.push_back({kind, std::move(values)});
    }
    return list;
  }

 private:
  using Parts = std::vector<std::pair<std::string, ParameterSet>>;

  static std::vector<double> times(std::vector<double> numbers, double factor) {
    for (double& x : numbers) {
      x *= factor;
    }
    return numbers;
  }

  Parts parts(const std::string& name, double s) {
    if (name == "floor_vibration" || name == "electrical_line") {
      const std::vector<double> vector_mg = axes(1.5 * s);
      const double frequency_hz = random_.uniform(5, 30);
      Parts line = {{name, {{"vector_mg", vector_mg}, {"frequency_hz", {frequency_hz}}}}};
      if (random_.uniform() < 0.5 && frequency_hz < 24) {
        line.push_back(
            {name, {{"vector_mg", times(vector_mg, 0.2)}, {"frequency_hz", {2 * frequency_hz}}}});
      }
      return line;
    }
    if (name == "warm_up") {
      const double tau_s = random_.uniform(120, 600);
      const std::vector<double> mg = axes(4 * s);
      std::vector<double> quick = mg;
      for (double& x : quick) {
        x *= random_.uniform(0, 0.2);
      }
      return {{name, {{"mg", mg}, {"tau_s", {tau_s}}}},
              {name, {{"mg", quick}, {"tau_s", {tau_s / 4}}}}};
    }
    if (name == "drift") {
      const std::vector<double> mg_per_h = axes(3 * s);
      if (random_.uniform() < 0.5) {
        return {{name, {{"mg_per_h", mg_per_h}}}};
      }
      constexpr double kTau_h = 12;  // slows down over half a day
      return {{"warm_up", {{"mg", times(mg_per_h, -kTau_h)}, {"tau_s", {kTau_h * 3600}}}}};
    }
    return {{name, parameters(name, s)}};
  }

  ParameterSet parameters(const std::string& name, double s) {
    if (name == "tilt") {
      const double direction = random_.uniform(0, 2 * std::numbers::pi);
      return {{"rotation_vector_deg",
               {0.2 * s * std::cos(direction), 0.2 * s * std::sin(direction), 0}}};
    }
    if (name == "settling") {
      return {{"amplitude", {0.03 * s}},
              {"frequency_hz", {random_.uniform(3, 12)}},
              {"decay_s", {random_.uniform(0.2, 0.6)}},
              {"second_share", {random_.uniform(0, 0.35)}},
              {"second_ratio", {random_.uniform(1.7, 2.6)}}};
    }
    if (name == "soft_mount") {
      return {{"frequency_hz", {random_.uniform(8, 25)}}, {"q", {random_.uniform(1.5, 4)}}};
    }
    if (name == "filter_mismatch") {
      std::vector<double> offset_g(kAxes);
      for (double& x : offset_g) {
        x = sign() * random_.uniform(0.05, 0.2);
      }
      return {{"gain", {1 - std::min(0.25, 0.12 * std::max(0.4, s))}}, {"offset_g", offset_g}};
    }
    if (name == "bandwidth") {
      return {{"corner_hz", {std::clamp(25 / std::sqrt(s), 12.5, 45.0)}},
              {"order", {2.0 * static_cast<double>(1 + random_.below(3))}}};
    }
    if (name == "local_gravity") {
      return {{"ratio", {1 + sign() * std::min(0.0027, 0.0015 * s)}}};
    }
    if (name == "axis_rotation") {
      return {{"matrix", turn()}};
    }
    if (name == "clock_error") {
      return {{"ppm", {sign() * 500 * s}}};
    }
    if (name == "saturation") {
      return {{"level_g", {random_.uniform(5, 7.5)}}};
    }
    if (name == "charging_zeros") {
      return {{"seconds", {std::max(2.0, 40 * s)}}};
    }
    return sized(name, s);
  }

  // Effects of one parameter: its size at severity 1, per axis or one for all.
  ParameterSet sized(const std::string& name, double s) {
    struct Size {
      const char* effect;
      const char* parameter;
      double size;
      bool per_axis;
    };
    static constexpr std::array kSizes = {
        Size{"seating", "sd_deg", 0.1, false},
        Size{"misalignment", "rotation_vector_deg", 0.4, true},
        Size{"non_orthogonality", "yz_xz_xy", 0.005, true},
        Size{"second_order", "mg_per_g2", 0.4, true},
        Size{"third_order", "mg_per_g3", 0.04, true},
        Size{"hysteresis", "mg", 0.8, true},
        Size{"offset_tempco", "mg_per_c", 0.4, true},
        Size{"sensitivity_tempco", "percent_per_c", 0.03, true},
        Size{"flicker", "mg", 0.5, false},
        Size{"random_walk", "mg_per_sqrt_s", 0.2, false},
        Size{"jitter", "rms_ms", 0.7, false},
        Size{"dropped_samples", "rate", 0.002, false},
        Size{"duplicated_samples", "rate", 0.002, false},
        Size{"idle_sleep", "fraction", 0.05, false},
    };
    for (const Size& size : kSizes) {
      if (name == size.effect) {
        return {{size.parameter,
                 size.per_axis ? axes(size.size * s) : std::vector<double>{size.size * s}}};
      }
    }
    return {};
  }

  // A signed permutation without reflection that is not the identity.
  std::vector<double> turn() {
    for (;;) {
      std::array<std::size_t, kAxes> order = {0, 1, 2};
      for (std::size_t i = kAxes; i > 1; --i) {
        std::swap(order[i - 1], order[static_cast<std::size_t>(random_.below(i))]);
      }
      Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
      for (std::size_t row = 0; row < kAxes; ++row) {
        matrix(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(order[row])) = sign();
      }
      if (matrix.determinant() > 0 && !matrix.isIdentity()) {
        std::vector<double> rows;
        for (Eigen::Index row = 0; row < 3; ++row) {
          for (Eigen::Index column = 0; column < 3; ++column) {
            rows.push_back(matrix(row, column));
          }
        }
        return rows;
      }
    }
  }

  Random random_;
};

}  // namespace

const std::vector<std::string>& gradual_effects() {
  static const std::vector<std::string> kNames = {"non_orthogonality",
                                                  "misalignment",
                                                  "offset_tempco",
                                                  "sensitivity_tempco",
                                                  "second_order",
                                                  "third_order",
                                                  "seating",
                                                  "clock_error",
                                                  "drift",
                                                  "floor_vibration",
                                                  "warm_up",
                                                  "settling",
                                                  "electrical_line",
                                                  "tilt",
                                                  "hysteresis"};
  return kNames;
}

std::string_view to_string(TrialKind kind) {
  constexpr std::array<std::string_view, 5> kNames = {"none", "single", "pair", "outside",
                                                      "realistic"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view family_of(std::string_view effect) {
  static const std::map<std::string_view, std::string_view> kFamilies = {
      {"tilt", "geometry"},
      {"misalignment", "geometry"},
      {"non_orthogonality", "geometry"},
      {"second_order", "curvature"},
      {"third_order", "curvature"},
      {"wrap", "range"},
      {"saturation", "range"},
      {"truncation", "rounding"},
      {"rounding_floor", "rounding"},
      {"floor_vibration", "line"},
      {"electrical_line", "line"},
      {"clock_error", "timing"},
      {"jitter", "timing"},
      {"dropped_samples", "timing"},
      {"duplicated_samples", "timing"},
      {"soft_mount", "response"},
      {"bandwidth", "response"},
      {"flicker", "slow"},
      {"random_walk", "slow"},
      {"drift", "slow"},
      {"warm_up", "slow"},
      {"offset_tempco", "slow"},
      {"seating", "repeat"},
      {"hysteresis", "repeat"},
      {"local_gravity", "gain"},
      {"filter_mismatch", "gain"},
      {"sensitivity_tempco", "gain"},
      {"idle_sleep", "made up"},
      {"charging_zeros", "made up"},
  };
  if (const auto found = kFamilies.find(effect); found != kFamilies.end()) {
    return found->second;
  }
  // Outside the catalogue, but maybe near enough to one of its families to be acted on alike.
  for (const OutsideKind& kind : outside_kinds()) {
    if (kind.effect.name == effect && !kind.family.empty()) {
      return kind.family;
    }
  }
  return effect;
}

Result<GapTrial> draw_trial(std::uint64_t seed, std::uint64_t index, sim::StandardProtocol protocol,
                            const TrialShares& shares, const std::vector<std::string>& only) {
  Drawing drawing(seed, index);
  Random& random = drawing.random();
  GapTrial trial;

  // The header is drawn without regard to the effects: headers can be wrong.
  constexpr std::array kFirmware = {"1.9.2", "1.9.1", "1.9.0", "1.8.0", "1.5.0"};
  const std::string unit = fmt::format(
      R"({{"serial": "MOS2{}{:08}", "firmware": "{}", "calibrated": "201{}-0{}-15T12:00:00Z"}})",
      static_cast<char>('A' + random.below(5)), random.below(100'000'000),
      kFirmware[random.below(kFirmware.size())], 4 + random.below(5), 5 + random.below(5));
  const std::uint64_t seed_of_unit = random.bits() >> 12U;
  constexpr std::array kRates_hz = {20, 25, 30, 40, 50, 60, 70, 80, 90, 100};
  const int rate_hz = shares.any_rate ? kRates_hz[random.below(kRates_hz.size())] : 100;
  SIXPOINT_ASSIGN(trial.scenario,
                  sim::parse_scenario(
                      fmt::format(R"({{"seed": {}, "protocol": "{}", "rate_hz": {}, "unit": {}}})",
                                  seed_of_unit, to_string(protocol), rate_hz, unit)));

  std::vector<std::string> names;
  for (const EffectKind& kind : sim::effect_catalogue()) {
    const auto has = [&](const std::vector<std::string>& list) {
      return std::find(list.begin(), list.end(), kind.name) != list.end();
    };
    if ((only.empty() || has(only)) && (!shares.faint || has(gradual_effects()))) {
      names.push_back(kind.name);
    }
  }
  std::vector<const OutsideKind*> outside;
  for (const OutsideKind& kind : outside_kinds()) {
    const bool wanted = std::find(only.begin(), only.end(), kind.effect.name) != only.end() ||
                        (only.empty() && !kind.only_by_name &&
                         (kind.in_faces || protocol == sim::StandardProtocol::engineering));
    if (wanted) {
      outside.push_back(&kind);
    }
  }
  if (names.empty() && outside.empty()) {
    return fail(ErrorCode::usage, "none of these effects is a gradual one", only.front(),
                fmt::format("--faint draws {}", fmt::join(gradual_effects(), ", ")));
  }
  const double dice = random.uniform();
  std::vector<EffectSpec>& effects = trial.scenario.protocol->effects;
  if (dice < shares.none) {
    trial.kind = TrialKind::none;
    return trial;
  }
  if (!outside.empty() && (names.empty() || dice < shares.none + shares.outside)) {
    trial.kind = TrialKind::outside;
    const OutsideKind& kind = *outside[static_cast<std::size_t>(random.below(outside.size()))];
    const double severity = drawing.severity();
    effects.push_back({&kind.effect, {{"severity", {severity}}}});
    trial.effects.push_back({kind.effect.name, severity});
    return trial;
  }
  if (dice < shares.none + shares.outside + shares.realistic) {
    trial.kind = TrialKind::realistic;
    trial.effects = drawing.realistic(gradual_effects());
    for (TrialEffect& drawn : trial.effects) {
      SIXPOINT_ASSIGN(std::vector<EffectSpec> parts, drawing.effect(drawn.name, drawn.severity));
      drawn.parts = parts.size();
      effects.insert(effects.end(), parts.begin(), parts.end());
    }
    return trial;
  }
  trial.kind =
      dice < shares.none + shares.outside + shares.realistic + shares.pair && names.size() > 1
          ? TrialKind::pair
          : TrialKind::single;
  while (trial.effects.size() < (trial.kind == TrialKind::pair ? 2U : 1U)) {
    const std::string& name = names[static_cast<std::size_t>(random.below(names.size()))];
    if (std::any_of(trial.effects.begin(), trial.effects.end(),
                    [&](const TrialEffect& drawn) { return drawn.name == name; })) {
      continue;
    }
    const double severity = drawing.severity(shares.faint);
    SIXPOINT_ASSIGN(std::vector<EffectSpec> parts, drawing.effect(name, severity));
    effects.insert(effects.end(), parts.begin(), parts.end());
    trial.effects.push_back({name, severity, parts.size()});
  }
  return trial;
}

}  // namespace sixpoint::gap

#include "station/limits/verdict.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace sixpoint::station {

namespace {

// In the order of the enumerators.
constexpr std::array<std::string_view, 6> kNames = {"pass", "conditional_pass", "conditional_fail",
                                                    "fail", "inconclusive",     "stopped"};
constexpr std::array<int, 6> kExitCodes = {0, 0, 1, 1, 2, 3};
// A run has the most severe verdict of its quantities.
constexpr std::array<int, 6> kSeverities = {0, 1, 3, 4, 2, 5};

int severity(JigVerdict verdict) { return kSeverities[static_cast<std::size_t>(verdict)]; }

std::string shown(double value, std::string_view unit) {
  return unit == "%" || unit.empty() || unit == "\u00b0"
             ? fmt::format("{:.3g}{}{}", value, unit == "%" ? " " : "", unit)
             : fmt::format("{:.4g} {}", value, unit);
}

bool is_uncertainty(std::string_view name) { return name.find("_uncertainty_") != name.npos; }

// No value at all would be inside by the expanded uncertainty.
bool is_too_coarse(const JudgedQuantity& judged) {
  const QuantityInfo& info = *find_quantity(judged.name);
  const double low =
      judged.low ? *judged.low + judged.expanded_uncertainty : std::min(info.least, judged.value);
  const double high =
      judged.high ? *judged.high - judged.expanded_uncertainty : std::max(info.most, judged.value);
  return low > high;
}

std::string sentence(const JudgedQuantity& judged) {
  const QuantityInfo& info = *find_quantity(judged.name);
  const bool below =
      judged.low && (!judged.high || judged.value - *judged.low < *judged.high - judged.value);
  const double limit = below ? *judged.low : judged.high.value_or(NAN);
  const std::string axis = judged.axis.empty() ? "" : fmt::format(", {}", judged.axis);
  switch (judged.verdict) {
    case JigVerdict::pass:
      return {};
    case JigVerdict::inconclusive:
      if (!std::isfinite(judged.value) || !std::isfinite(judged.expanded_uncertainty)) {
        return fmt::format("{}{}: no number", info.title, axis);
      }
      if (is_uncertainty(judged.name)) {
        return fmt::format("{}{}: {} is more than {}; measured too coarsely to judge the unit",
                           info.title, axis, shown(judged.value, info.unit),
                           shown(limit, info.unit));
      }
      return fmt::format(
          "{}{}: the expanded uncertainty of {} leaves nothing inside {}; measured too coarsely "
          "to judge the unit",
          info.title, axis, shown(judged.expanded_uncertainty, info.unit),
          judged.low && judged.high ? fmt::format("{} to {}", shown(*judged.low, info.unit),
                                                  shown(*judged.high, info.unit))
                                    : shown(limit, info.unit));
    case JigVerdict::conditional_pass:
      return fmt::format("{}{}: {} is within {} by less than the guard band of {}", info.title,
                         axis, shown(judged.value, info.unit), shown(limit, info.unit),
                         shown(judged.guard_band, info.unit));
    case JigVerdict::conditional_fail:
      return fmt::format("{}{}: {} is beyond {} by less than the guard band of {}", info.title,
                         axis, shown(judged.value, info.unit), shown(limit, info.unit),
                         shown(judged.guard_band, info.unit));
    case JigVerdict::fail:
    case JigVerdict::stopped:
      break;
  }
  return fmt::format("{}{}: {} is {} {}", info.title, axis, shown(judged.value, info.unit),
                     below ? "below" : "above", shown(limit, info.unit));
}

}  // namespace

std::string_view to_string(JigVerdict verdict) { return kNames[static_cast<std::size_t>(verdict)]; }

std::optional<JigVerdict> parse_jig_verdict(std::string_view text) {
  const auto found = std::find(kNames.begin(), kNames.end(), text);
  return found == kNames.end() ? std::nullopt
                               : std::optional(static_cast<JigVerdict>(found - kNames.begin()));
}

int exit_code_of(JigVerdict verdict) { return kExitCodes[static_cast<std::size_t>(verdict)]; }

const std::vector<FailureCode>& failure_codes() {
  static const std::vector<FailureCode> kCodes = {
      {"sensitivity_low", "an axis gives more counts per g than the limits allow",
       "a sensor with too high a gain, or poses that were exchanged",
       "Repeat the run once. If it stays, send the unit to repair."},
      {"sensitivity_high", "an axis gives fewer counts per g than the limits allow",
       "a damaged sensor, or the wrong filter configuration",
       "Check that the run was under 'current' and repeat once. If it stays, send the unit to "
       "repair."},
      {"zero_low", "zero offset is too far below zero", "a shock bent the sensor, or water got in",
       "Repeat once after ten minutes on the bench. If it stays, send the unit to repair."},
      {"zero_high", "zero offset is too far above zero", "a shock bent the sensor, or water got in",
       "Repeat once after ten minutes on the bench. If it stays, send the unit to repair."},
      {"midpoint_off",
       "the midpoint of +1 g and -1 g is not where the axis reads when it lies level",
       "the sensor's response is curved, the case or a seat leans, or the unit was seated badly",
       "Clean the seats of jig and unit, check the case for damage, repeat. If it stays, send "
       "the unit to repair."},
      {"noise_high", "samples scatter too much while the unit lies still",
       "the bench trembles, the unit is loose on the jig, or the sensor is broken",
       "Stop what shakes the bench, seat the unit anew and repeat."},
      {"cross_axis", "the sensor's axes are not square to each other within limits",
       "the unit sat askew, or the sensor came loose on its board",
       "Clean the seats of jig and unit, repeat. If it stays, send the unit to repair."},
      {"temperature_low", "the unit is colder than the limits allow", "it came in from the cold",
       "Leave it on the bench for an hour and repeat."},
      {"temperature_high", "the unit is warmer than the limits allow",
       "it charged, or lay in the sun", "Leave it on the bench for an hour and repeat."},
      {"temperature_unsteady", "the unit's temperature changed during the run",
       "it charged, was held in a hand, or came in from the cold",
       "Leave it on the bench for an hour and repeat."},
      {"tilt_high", "a pose lies too far from the jig's direction",
       "the unit was not seated, or dirt lies in the seat", "Clean the seats and repeat."},
      {"fit_residual_high", "the constants do not even fit the poses they come from",
       "the unit moved during a pose, or its sensor is not linear",
       "Repeat once. If it stays, send the unit to repair."},
      {"verification_residual_high", "the constants are wrong on poses that were not fitted",
       "the unit moved or changed during the run, or its sensor is not linear",
       "Repeat once. If it stays, send the unit to repair."},
      {"rounded_residual_high", "the nine integers are wrong where the constants are not",
       "sensitivity so low that a count is large", "Send the unit to repair."},
      {"recheck_residual_high", "with the constants that it now holds the unit reads wrong",
       "the unit keeps other numbers than it was given, or was turned during the recheck",
       "Repeat with --write. If it stays, keep the unit back: its memory is faulty."},
      {"uncertainty_high", "the result is too uncertain to judge the unit",
       "local gravity is not stated, or the poses disagree with each other",
       "State --latitude and --altitude, clean the seats and repeat."},
      {"samples_lost", "too many samples did not arrive", "a bad cable, hub or port",
       "Change the cable or the port and repeat."},
      {"not_verified", "readings contradict each other", "the unit moved, or was put in wrong",
       "The reasons name the pose. Repeat."},
      {"missing_pose", "not all six poses were measured", "the run ended early", "Repeat."},
      {"write_refused", "the unit did not take the constants", "its battery is low",
       "Charge the unit and repeat with --write."},
      {"read_back_differs", "the unit holds other constants than it was given",
       "its memory is worn", "Keep the unit back: its memory is faulty."},
      {"time_out", "no pose was accepted in time",
       "the unit is not on the jig, or the jig is stuck", "Look at jig and unit, repeat."},
      {"too_many_refusals", "too many placements were refused",
       "dirt in the seat, a loose cable that pulls, a bench that trembles",
       "Look at jig, seat and cable, repeat."},
      {"stopped", "the operator stopped the run", "the operator chose to stop", "Repeat."},
      {"unit_gone", "the unit went away", "the cable was pulled, or the battery is empty",
       "Plug it in and repeat."},
      {"sensor_stuck", "the sensor repeats itself: an axis is stuck, or all are frozen",
       "the sensor is broken, or its supply", "Keep the unit back: its sensor is faulty."},
      {"interrupted", "the run ended on an error", "the unit, the jig or a cable failed",
       "Repair what the message names, repeat."},
      {"retest", "a unit that failed needs more passes in a row", "it failed before",
       "Measure it again."},
  };
  return kCodes;
}

const FailureCode* find_failure_code(std::string_view code) {
  const auto found = std::find_if(failure_codes().begin(), failure_codes().end(),
                                  [&](const FailureCode& other) { return other.code == code; });
  return found == failure_codes().end() ? nullptr : &*found;
}

std::vector<std::string> next_actions(const std::vector<std::string>& codes, bool is_last_failure) {
  if (is_last_failure) {
    return {
        "Keep the unit back: it failed as often in a row as the limits allow. It is measured again "
        "only when an engineer has released it (sixpoint retest SERIAL --release)."};
  }
  std::vector<std::string> actions;
  for (const std::string& code : codes) {
    const FailureCode* known = find_failure_code(code);
    if (known != nullptr &&
        std::find(actions.begin(), actions.end(), known->next_action) == actions.end()) {
      actions.emplace_back(known->next_action);
    }
  }
  return actions;
}

JudgedQuantity judge_quantity(const Measured& measured, const Limits& limits) {
  const QuantityInfo& info = *find_quantity(measured.name);
  const Limit& limit = limits.of(measured.name);
  JudgedQuantity judged;
  judged.name = measured.name;
  judged.axis = measured.axis;
  judged.value = measured.value;
  judged.expanded_uncertainty = limits.decision.coverage_factor * measured.standard_uncertainty;
  judged.low = limit.low;
  judged.high = limit.high;
  judged.guard_band =
      std::max(limits.decision.guard_factor * judged.expanded_uncertainty, limit.guard_band);
  if (!std::isfinite(measured.value) || !std::isfinite(judged.expanded_uncertainty)) {
    judged.verdict = JigVerdict::inconclusive;
    judged.code = "not_verified";
    return judged;
  }
  // How far inside the nearer limit.
  const double above_low = limit.low ? measured.value - *limit.low : HUGE_VAL;
  const double below_high = limit.high ? *limit.high - measured.value : HUGE_VAL;
  const double inside = std::min(above_low, below_high);
  // What is beyond a limit by more than U fails, however large U is; nothing else is certain then.
  if (is_too_coarse(judged) && -inside < judged.expanded_uncertainty) {
    judged.verdict = JigVerdict::inconclusive;
    judged.code = "uncertainty_high";
    return judged;
  }
  if (inside >= judged.guard_band) {
    return judged;
  }
  judged.code = above_low < below_high ? info.code_low : info.code_high;
  judged.verdict = inside >= 0                   ? JigVerdict::conditional_pass
                   : -inside < judged.guard_band ? JigVerdict::conditional_fail
                                                 : JigVerdict::fail;
  if (inside < 0 && is_uncertainty(measured.name)) {
    judged.verdict = JigVerdict::inconclusive;
  }
  return judged;
}

Verdict judge_quantities(const std::vector<Measured>& measured, const Limits& limits) {
  Verdict verdict;
  verdict.verdict = measured.empty() ? JigVerdict::inconclusive : JigVerdict::pass;
  for (const Measured& one : measured) {
    verdict.quantities.push_back(judge_quantity(one, limits));
  }
  std::vector<const JudgedQuantity*> worst_first;
  for (const JudgedQuantity& judged : verdict.quantities) {
    if (judged.verdict != JigVerdict::pass) {
      worst_first.push_back(&judged);
    }
  }
  std::stable_sort(worst_first.begin(), worst_first.end(),
                   [](const JudgedQuantity* a, const JudgedQuantity* b) {
                     return severity(a->verdict) > severity(b->verdict);
                   });
  for (const JudgedQuantity* judged : worst_first) {
    if (severity(judged->verdict) > severity(verdict.verdict)) {
      verdict.verdict = judged->verdict;
    }
    if (std::find(verdict.codes.begin(), verdict.codes.end(), judged->code) ==
        verdict.codes.end()) {
      verdict.codes.push_back(judged->code);
    }
    verdict.reasons.push_back(sentence(*judged));
  }
  return verdict;
}

std::string Verdict::brief() const {
  std::string text(to_string(verdict));
  for (const std::string& reason : reasons) {
    text += "; " + reason;
  }
  return text;
}

nlohmann::ordered_json to_json(const JudgedQuantity& quantity) {
  const auto number = [](double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
  };
  nlohmann::ordered_json json;
  json["name"] = quantity.name;
  json["axis"] = quantity.axis;
  json["value"] = number(quantity.value);
  json["expanded_uncertainty"] = number(quantity.expanded_uncertainty);
  json["low"] = quantity.low ? number(*quantity.low) : nlohmann::ordered_json(nullptr);
  json["high"] = quantity.high ? number(*quantity.high) : nlohmann::ordered_json(nullptr);
  json["guard_band"] = number(quantity.guard_band);
  json["verdict"] = to_string(quantity.verdict);
  json["code"] = quantity.code;
  return json;
}

std::vector<JudgedQuantity> quantities_from_json(const nlohmann::ordered_json& json) {
  const auto text = [](const nlohmann::ordered_json& item, const char* key) {
    return item.contains(key) && item[key].is_string() ? item[key].get<std::string>()
                                                       : std::string();
  };
  const auto number = [](const nlohmann::ordered_json& item, const char* key) {
    return item.contains(key) && item[key].is_number() ? std::optional(item[key].get<double>())
                                                       : std::nullopt;
  };
  std::vector<JudgedQuantity> quantities;
  for (const auto& item : json.is_array() ? json : nlohmann::ordered_json::array()) {
    if (!item.is_object() || find_quantity(text(item, "name")) == nullptr) {
      continue;
    }
    JudgedQuantity quantity;
    quantity.name = text(item, "name");
    quantity.axis = text(item, "axis");
    quantity.value = number(item, "value").value_or(NAN);
    quantity.expanded_uncertainty = number(item, "expanded_uncertainty").value_or(NAN);
    quantity.low = number(item, "low");
    quantity.high = number(item, "high");
    quantity.guard_band = number(item, "guard_band").value_or(NAN);
    quantity.verdict = parse_jig_verdict(text(item, "verdict")).value_or(JigVerdict::inconclusive);
    quantity.code = text(item, "code");
    quantities.push_back(std::move(quantity));
  }
  return quantities;
}

// --- retest policy ---

RetestState retest_state(const std::vector<EarlierRun>& earlier, const RetestPolicy& policy) {
  RetestState state;
  int passes = 0;
  bool failed = false;  // and has not counted as passed since
  const EarlierRun* last_judged = nullptr;
  for (const EarlierRun& run : earlier) {
    if (is_passed(run.verdict)) {
      ++passes;
      state.failures_in_row = 0;
      if (passes >= policy.passes_after_failure) {
        failed = false;
      }
      last_judged = &run;
    } else if (run.verdict == JigVerdict::fail || run.verdict == JigVerdict::conditional_fail) {
      passes = 0;
      failed = true;
      ++state.failures_in_row;
      last_judged = &run;
    }
    if (run.released_after) {
      state.failures_in_row = 0;
    }
  }
  if (failed) {
    state.passes_needed = policy.passes_after_failure - passes;
    state.retest_of = last_judged->id;
  }
  state.failures_left = policy.most_failures - state.failures_in_row;
  if (state.failures_in_row >= policy.most_failures) {
    state.may_start = false;
    state.reason = fmt::format("the unit failed {} times in a row, as often as the limits allow",
                               state.failures_in_row);
  }
  return state;
}

void apply_retest(Verdict& verdict, const RetestState& state) {
  if (verdict.verdict != JigVerdict::pass && verdict.verdict != JigVerdict::conditional_pass) {
    return;
  }
  if (state.passes_needed > 1) {
    verdict.verdict = JigVerdict::conditional_pass;
    verdict.codes.emplace_back("retest");
    verdict.reasons.push_back(
        fmt::format("the unit failed before; it counts as passed after {} more in a row",
                    state.passes_needed - 1));
  }
}

bool is_last_failure(JigVerdict verdict, const RetestState& state) {
  return (verdict == JigVerdict::fail || verdict == JigVerdict::conditional_fail) &&
         state.failures_left && *state.failures_left <= 1;
}

}  // namespace sixpoint::station

#include "station/limits/limits.h"

#include <algorithm>
#include <cassert>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"

namespace sixpoint::station {

namespace {

constexpr std::string_view kDegreeCelsius = "\u00b0C";
constexpr std::string_view kDegree = "\u00b0";

}  // namespace

const std::vector<QuantityInfo>& quantities() {
  static const std::vector<QuantityInfo> kQuantities = {
      {"sensitivity_deviation_percent", "Deviation of sensitivity from nominal", "%", -15, 30, -90,
       900, "sensitivity_low", "sensitivity_high",
       "of g per LSB from 4 mg: the sensor's own 10 % (ADXL362 datasheet), and the common gain of "
       "0.80 to 0.95 that the filter configurations differ by"},
      {"zero_offset_mg", "Zero offset", "mg", -700, 700, -8000, 8000, "zero_low", "zero_high",
       "half a g of the sensor with its housing, and 0.2 g that the filter configuration adds"},
      {"midpoint_minus_zero_mg", "Midpoint of +1 g, -1 g minus zero", "mg", -45, 45, -1000, 1000,
       "midpoint_off", "midpoint_off",
       "real units show up to 7.5 counts, 29 mg, and half of that again; beyond it the sensor is "
       "curved or the case's sides lean the same way by more than 2.6 degrees"},
      {"noise_mg", "Noise of a sample", "mg", std::nullopt, 10, 0, 1000, "", "noise_high",
       "5.5 mg on the noisiest axis of good units at 100 Hz; what is above trembles or is broken"},
      {"cross_axis_percent", "Cross-axis sensitivity", "%", -8, 8, -100, 100, "cross_axis",
       "cross_axis",
       "the cosine between two axes, twice the symmetric cross-axis term: real units show 2.0 to "
       "2.9 "
       "% of that between X and Y, a cosine of up to 5.8 %; the jig's seating adds to it"},
      {"temperature_c", "Temperature of the unit", kDegreeCelsius, 10, 40, -40, 85,
       "temperature_low", "temperature_high",
       "where people wear units; zero moves by up to 1 mg per degree"},
      {"temperature_change_c", "Temperature change during the run", kDegreeCelsius, std::nullopt, 3,
       0, 125, "", "temperature_unsteady",
       "3 mg of zero at 1 mg per degree, and a unit that comes from the cold is not measured yet"},
      {"tilt_deg", "Largest tilt of a pose", kDegree, std::nullopt, 6, 0, 45, "", "tilt_high",
       "2.8 % of cross-axis sensitivity look like 1.6 degrees, draft angles like 1.5; more is a "
       "unit that was put in askew"},
      {"fit_residual_mg", "Residual on the poses of the fit", "mg", std::nullopt, 8, 0, 1000, "",
       "fit_residual_high", "six constants leave 4 to 8 mg of a real sensor's curvature"},
      {"verification_residual_mg", "Residual on poses not used", "mg", std::nullopt, 10, 0, 1000,
       "", "verification_residual_high",
       "the same and the noise of one pose; constants of the wrong filter leave 100 mg and more"},
      {"rounded_residual_mg", "The same with the nine integers", "mg", std::nullopt, 12, 0, 1000,
       "", "rounded_residual_high", "half a count of zero on each axis is 2 mg more"},
      {"recheck_residual_mg", "Residual with the written constants", "mg", std::nullopt, 12, 0,
       1000, "", "recheck_residual_high", "as with the nine integers: it is what they were"},
      {"sensitivity_uncertainty_percent", "Expanded uncertainty of sensitivity", "%", std::nullopt,
       2, 0, 100, "", "uncertainty_high",
       "where local gravity is not stated it is 0.3 % alone; six constants on a curved sensor add "
       "0.8 %"},
      {"zero_uncertainty_mg", "Expanded uncertainty of zero offset", "mg", std::nullopt, 20, 0,
       1000, "", "uncertainty_high", "half of the 40 mg that an uncalibrated sensor may be off"},
      {"lost_samples_percent", "Samples lost on the way", "%", std::nullopt, 2, 0, 100, "",
       "samples_lost", "a good cable loses none; a few do no harm to a mean"},
  };
  return kQuantities;
}

const QuantityInfo* find_quantity(std::string_view name) {
  const auto found = std::find_if(quantities().begin(), quantities().end(),
                                  [&](const QuantityInfo& info) { return info.name == name; });
  return found == quantities().end() ? nullptr : &*found;
}

std::string title_of(std::string_view name_and_axis) {
  const std::size_t space = name_and_axis.find(' ');
  const QuantityInfo* info = find_quantity(name_and_axis.substr(0, space));
  if (info == nullptr) {
    return std::string(name_and_axis);
  }
  std::string title(info->title);
  if (space != std::string_view::npos) {
    title += fmt::format(" {}", name_and_axis.substr(space + 1));
  }
  title += info->unit.empty() ? "" : fmt::format(", {}", info->unit);
  return title;
}

const Limit& Limits::of(std::string_view name) const {
  const auto found = std::find_if(limits.begin(), limits.end(),
                                  [&](const Limit& limit) { return limit.name == name; });
  assert(found != limits.end());
  return *found;
}

Limits default_limits() {
  Limits limits;
  for (const QuantityInfo& info : quantities()) {
    limits.limits.push_back({std::string(info.name), info.low, info.high, 0});
  }
  limits.sha256 = text_sha256(to_toml(limits));
  return limits;
}

std::string to_toml(const Limits& limits) {
  std::string text = fmt::format(
      "# Limits of a jig run. What a file leaves out keeps its built-in value.\n"
      "\n"
      "[decision]\n"
      "coverage_factor = {}  # of the expanded uncertainty; 2 is about 95 %\n"
      "guard_factor = {}  # guard band in expanded uncertainties; 0 would be shared risk\n"
      "\n"
      "[retest]\n"
      "most_failures = {}  # in a row; then an engineer decides\n"
      "passes_after_failure = {}  # in a row, until a unit that failed counts as passed\n"
      "\n"
      "[check_unit]\n"
      "baseline_runs = {}\n"
      "locking_rules = [{}]  # Nelson's, 1 to 8\n"
      "least_sigma_zero_mg = {}\n"
      "least_sigma_sensitivity_percent = {}\n",
      limits.decision.coverage_factor, limits.decision.guard_factor, limits.retest.most_failures,
      limits.retest.passes_after_failure, limits.check_unit.baseline_runs,
      fmt::join(limits.check_unit.locking_rules, ", "), limits.check_unit.least_sigma_zero_mg,
      limits.check_unit.least_sigma_sensitivity_percent);
  for (const Limit& limit : limits.limits) {
    const QuantityInfo* info = find_quantity(limit.name);
    text += fmt::format("\n# {}\n[{}]\n", info != nullptr ? info->reason : "", limit.name);
    if (limit.low) {
      text += fmt::format("low = {}\n", *limit.low);
    }
    if (limit.high) {
      text += fmt::format("high = {}\n", *limit.high);
    }
    text += fmt::format("guard_band = {}\n", limit.guard_band);
  }
  return text;
}

nlohmann::ordered_json to_json(const Limits& limits) {
  nlohmann::ordered_json json;
  json["source"] = limits.source;
  json["sha256"] = limits.sha256;
  json["decision"] = {{"coverage_factor", limits.decision.coverage_factor},
                      {"guard_factor", limits.decision.guard_factor}};
  json["retest"] = {{"most_failures", limits.retest.most_failures},
                    {"passes_after_failure", limits.retest.passes_after_failure}};
  json["check_unit"] = {
      {"baseline_runs", limits.check_unit.baseline_runs},
      {"locking_rules", limits.check_unit.locking_rules},
      {"least_sigma_zero_mg", limits.check_unit.least_sigma_zero_mg},
      {"least_sigma_sensitivity_percent", limits.check_unit.least_sigma_sensitivity_percent}};
  for (const Limit& limit : limits.limits) {
    nlohmann::ordered_json& item = json["limits"][limit.name];
    item["low"] = limit.low ? nlohmann::ordered_json(*limit.low) : nlohmann::ordered_json(nullptr);
    item["high"] =
        limit.high ? nlohmann::ordered_json(*limit.high) : nlohmann::ordered_json(nullptr);
    item["guard_band"] = limit.guard_band;
  }
  return json;
}

}  // namespace sixpoint::station

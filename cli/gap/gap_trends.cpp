// sixpoint gap trends --store DB: whether a reading belongs to the units, the jig, one of its
// faces, the station or the lot.
#include "station/records/gap_trends.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/bytes.h"
#include "cli/command.h"
#include "cli/gap/gap_commands.h"
#include "cli/store_option.h"

namespace sixpoint::cli {
namespace {

using station::FaceTrend;
using station::GroupTrend;
using station::JigTrend;
using station::TrendCause;

struct GapTrendsCommandOptions {
  std::string store;
  std::string lots;
  bool json = false;
};

bool is_blamed(TrendCause cause) {
  return cause == TrendCause::jig || cause == TrendCause::face || cause == TrendCause::jig_or_lot ||
         cause == TrendCause::station;
}

Json to_json(const FaceTrend& face) {
  return {{"face", device::to_string(face.face)},
          {"is_off", face.is_off},
          {"does_not_repeat", face.does_not_repeat},
          {"size_deg", face.size_deg},
          {"standard_uncertainty_deg", face.standard_uncertainty_deg},
          {"probability", face.probability},
          {"scatter_deg", face.scatter_deg},
          {"scatter_chance", face.scatter_chance}};
}

Json to_json(const JigTrend& trend) {
  Json json;
  json["jig"] = trend.jig;
  json["units"] = trend.units;
  json["runs"] = trend.runs;
  json["belongs_to"] = station::to_string(trend.cause);
  json["common_deg"] = trend.common_deg;
  json["units_deg"] = trend.units_deg;
  json["chance"] = trend.has_chance ? Json(trend.chance) : Json(nullptr);
  json["pattern_deg"] = trend.pattern_deg;
  json["probability"] = trend.probability;
  json["tilt_probability"] = trend.tilt_probability;
  json["tilt_deg"] = trend.tilt_deg;
  json["standard_uncertainty_deg"] = trend.standard_uncertainty_deg;
  json["tilt_pattern_deg"] = trend.tilt_pattern_deg;
  json["not_told_apart_from"] = trend.not_told_apart_from;
  json["faces"] = Json::array();
  for (const FaceTrend& face : trend.faces) {
    json["faces"].push_back(to_json(face));
  }
  return json;
}

Json to_json(const station::SharedTrend& trend, const char* size, const char* uncertainty) {
  return {{"is_named", trend.is_named}, {"probability", trend.probability},
          {size, trend.size},           {uncertainty, trend.standard_uncertainty},
          {"values", trend.value},      {"not_told_apart_from", trend.not_told_apart_from}};
}

Json to_json(const GroupTrend& trend, const char* name) {
  return {{name, trend.name},
          {"units", trend.units},
          {"runs", trend.runs},
          {"jigs", trend.jigs},
          {"skew", to_json(trend.skew, "tilt_deg", "standard_uncertainty_deg")},
          {"zero", to_json(trend.zero, "largest_mg", "standard_uncertainty_mg")},
          {"sensitivity",
           to_json(trend.sensitivity, "largest_percent", "standard_uncertainty_percent")}};
}

Json to_json(const station::UnitChange& change) {
  const bool is_zero = change.quantity == "zero";
  return {{"serial", change.serial},
          {"filter", change.filter},
          {"from_run", change.run},
          {"quantity", change.quantity},
          {"axis", kAxisNames[change.axis]},
          {is_zero ? "size_mg" : "size_percent", change.size},
          {is_zero ? "standard_uncertainty_mg" : "standard_uncertainty_percent",
           change.standard_uncertainty},
          {"chance", change.chance},
          {"runs_before", change.runs_before},
          {"runs_after", change.runs_after}};
}

// Degrees: a rotation of 1 degree is 2 in the model's coordinates (shared_effects.h).
Json learnt_json(const station::GapTrends& trends) {
  return {{"units_turn_deg", trends.turn_deg.unit / 2},
          {"units_shear_deg", trends.shear_deg.unit / 2},
          {"placement_deg", trends.even_deg.run},
          {"units_zero_mg", trends.zero_mg.unit},
          {"runs_zero_mg", trends.zero_mg.run},
          {"units_sensitivity_percent", trends.sensitivity_percent.unit},
          {"runs_sensitivity_percent", trends.sensitivity_percent.run},
          {"share_of_jigs", trends.share[0]},
          {"share_of_stations", trends.share[1]},
          {"share_of_lots", trends.share[2]}};
}

Json trends_json(const station::GapTrends& trends) {
  Json json = document("gap-trends");
  json["runs"] = trends.runs;
  json["left_out"] = trends.left_out;
  json["units"] = trends.units;
  json["units_without_lot"] = trends.units_without_lot;
  json["learnt"] = trends.units > 0 ? learnt_json(trends) : Json(nullptr);
  for (const char* list : {"jigs", "stations", "lots", "unit_changes", "badly_seated"}) {
    json[list] = Json::array();
  }
  for (const JigTrend& trend : trends.jigs) {
    json["jigs"].push_back(to_json(trend));
  }
  for (const GroupTrend& trend : trends.stations) {
    json["stations"].push_back(to_json(trend, "station"));
  }
  for (const GroupTrend& trend : trends.lots) {
    json["lots"].push_back(to_json(trend, "lot"));
  }
  for (const station::UnitChange& change : trends.unit_changes) {
    json["unit_changes"].push_back(to_json(change));
  }
  for (const station::BadlySeated& run : trends.badly_seated) {
    json["badly_seated"].push_back({{"run", run.run},
                                    {"serial", run.serial},
                                    {"jig", run.jig},
                                    {"axis", kAxisNames[run.axis]},
                                    {"lean_deg", run.lean_deg}});
  }
  return json;
}

void print_line(Context& context, const JigTrend& trend) {
  context.out << fmt::format(
      "{:<24} {:>4} units {:>5} runs  all alike {:.3f} deg, each its own {:.3f} deg: {}\n",
      printable(trend.jig, 24), trend.units, trend.runs, trend.common_deg, trend.units_deg,
      trend.cause == TrendCause::too_few_units
          ? "too few units"
          : fmt::format("belongs to {} (probability {:.3f} that the jig does it)",
                        trend.cause == TrendCause::jig_or_lot ? "jig or lot"
                                                              : station::to_string(trend.cause),
                        trend.probability));
}

std::string others_of(const std::vector<std::string>& names) {
  std::vector<std::string> shown;
  shown.reserve(names.size());
  for (const std::string& name : names) {
    shown.push_back(printable(name, 60));
  }
  return names.empty() ? std::string()
                       : fmt::format("; {} would explain it as well", fmt::join(shown, ", "));
}

// What to do about a jig; one sentence for each thing.
std::vector<std::string> advice_of(const JigTrend& trend) {
  std::vector<std::string> out;
  const std::string jig = printable(trend.jig, 60);
  if (trend.cause == TrendCause::jig_or_lot) {
    out.push_back(
        fmt::format("jig {} or a lot of units measured on it: all read alike{}: measure "
                    "units of another lot on it, or these on another jig",
                    jig, others_of(trend.not_told_apart_from)));
  }
  if (trend.cause == TrendCause::jig) {
    out.push_back(
        fmt::format("jig {} tilts all units by {:.3f} +- {:.3f} deg, on {} units{}: level "
                    "it, and look at how it holds the unit",
                    jig, trend.tilt_deg, trend.standard_uncertainty_deg, trend.units,
                    others_of(trend.not_told_apart_from)));
  }
  for (const FaceTrend& face : trend.faces) {
    if (face.is_off) {
      out.push_back(fmt::format(
          "face {} of jig {} reads {:.3f} +- {:.3f} deg off on {} units: clean or replace it",
          device::to_string(face.face), jig, face.size_deg, face.standard_uncertainty_deg,
          trend.units));
    }
    if (face.does_not_repeat) {
      out.push_back(
          fmt::format("face {} of jig {} repeats to {:.3f} deg only: clean it, look for "
                      "what is loose",
                      device::to_string(face.face), jig, face.scatter_deg));
    }
  }
  return out;
}

std::string named_of(const station::SharedTrend& trend, const char* quantity, const char* unit) {
  return fmt::format("{} {:.3g} +- {:.2g} {}{}", quantity, trend.size, trend.standard_uncertainty,
                     unit, others_of(trend.not_told_apart_from));
}

std::vector<std::string> advice_of(const GroupTrend& trend, const char* kind, const char* what) {
  std::vector<std::string> named;
  if (trend.skew.is_named) {
    named.push_back(named_of(trend.skew, "skew", "deg"));
  }
  if (trend.zero.is_named) {
    named.push_back(
        named_of(trend.zero, fmt::format("zero of {}", kAxisNames[trend.zero.axis]).c_str(), "mg"));
  }
  if (trend.sensitivity.is_named) {
    named.push_back(named_of(
        trend.sensitivity,
        fmt::format("sensitivity of {}", kAxisNames[trend.sensitivity.axis]).c_str(), "%"));
  }
  if (named.empty()) {
    return {};
  }
  return {fmt::format("{} {} is otherwise, on {} units: {}: {}", kind, printable(trend.name, 60),
                      trend.units, fmt::join(named, ", "), what)};
}

void print_people(const station::GapTrends& trends, bool lots_known, Context& context) {
  std::vector<std::string> lines;
  const auto add = [&](const std::vector<std::string>& more) {
    lines.insert(lines.end(), more.begin(), more.end());
  };
  for (const JigTrend& trend : trends.jigs) {
    add(advice_of(trend));
  }
  for (const GroupTrend& trend : trends.stations) {
    add(advice_of(trend, "station", "look at its table, its temperature and its work instruction"));
  }
  for (const GroupTrend& trend : trends.lots) {
    add(advice_of(trend, "lot", "this is the units', not the bench's"));
  }
  for (const station::UnitChange& change : trends.unit_changes) {
    lines.push_back(fmt::format(
        "unit {}: its {} of {} moved by {:+.3g} +- {:.2g} {} from run {} on: measure it again",
        printable(change.serial, 60), change.quantity, kAxisNames[change.axis], change.size,
        change.standard_uncertainty, change.quantity == "zero" ? "mg" : "%",
        printable(change.run, 12)));
  }
  for (const station::BadlySeated& run : trends.badly_seated) {
    lines.push_back(
        fmt::format("run {} of unit {}: its {} faces lean {:.2f} deg otherwise than the "
                    "other runs on jig {}: left out; measure the unit again",
                    printable(run.run, 12), printable(run.serial, 60), kAxisNames[run.axis],
                    std::abs(run.lean_deg), printable(run.jig, 60)));
  }
  if (trends.jigs.empty()) {
    lines.emplace_back(
        "the store holds no jig run with six faces (runs of gage studies are not looked at)");
  } else if (!lots_known) {
    lines.emplace_back(
        "the store knows no lots: what units of one lot share can count as a jig's "
        "(--lots)");
  } else if (trends.units_without_lot > 0) {
    lines.push_back(
        fmt::format("{} of {} units have no lot", trends.units_without_lot, trends.units));
  }
  if (trends.left_out > 0) {
    lines.push_back(fmt::format("{} of {} runs have no six faces, or values that no unit has",
                                trends.left_out, trends.runs));
  }
  for (const std::string& line : lines) {
    context.people << "sixpoint: " << line << '\n';
  }
}

// 1 where someone has to do something, 2 where nothing was judged, else 0.
int exit_code_of(const station::GapTrends& trends) {
  const auto named = [](const GroupTrend& trend) { return trend.is_named(); };
  const auto blamed = [](const JigTrend& trend) { return is_blamed(trend.cause); };
  const auto judged = [](const JigTrend& trend) {
    return trend.cause != TrendCause::too_few_units;
  };
  if (std::ranges::any_of(trends.jigs, blamed) || std::ranges::any_of(trends.stations, named) ||
      std::ranges::any_of(trends.lots, named)) {
    return kExitFailed;
  }
  return std::ranges::any_of(trends.jigs, judged) ? kExitPassed : kExitInconclusive;
}

Status run_gap_trends(const GapTrendsCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  station::LotOfSerial lots;
  if (!options.lots.empty()) {
    SIXPOINT_ASSIGN(const Bytes text, read_file(context.env.files, options.lots));
    SIXPOINT_ASSIGN(lots, station::parse_lots(as_text(text), options.lots));
  }
  SIXPOINT_ASSIGN(const auto runs, station::stored_jig_runs(store));
  const station::GapTrends trends = station::find_trends(runs, lots);
  context.worsen(exit_code_of(trends));
  if (options.json) {
    return print_json(context, trends_json(trends));
  }
  for (const JigTrend& trend : trends.jigs) {
    print_line(context, trend);
  }
  print_people(trends, !lots.empty(), context);
  return {};
}

}  // namespace

void add_gap_trends(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapTrendsCommandOptions>(
      gap_command, context, "gap-trends", "trends",
      "whether a reading belongs to the units, a jig, its face, the station or the lot",
      run_gap_trends);
  add_store_option(command, options.store);
  command.add_option("--lots", options.lots, "CSV file with the columns serial,lot");
}

}  // namespace sixpoint::cli

// sixpoint gap trends --store DB: whether a skew belongs to the units, the jig or the station.
#include "station/records/gap_trends.h"

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/gap/gap_commands.h"
#include "cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct GapTrendsCommandOptions {
  std::string store;
  bool json = false;
};

Json to_json(const station::JigTrend& trend) {
  Json json;
  json["jig"] = trend.jig;
  json["units"] = trend.units;
  json["runs"] = trend.runs;
  json["belongs_to"] = station::to_string(trend.cause);
  json["common_deg"] = trend.common_deg;
  json["units_deg"] = trend.units_deg;
  json["chance"] =
      trend.cause == station::TrendCause::too_few_units ? Json(nullptr) : Json(trend.chance);
  json["pattern_deg"] = trend.pattern_deg;
  return json;
}

Status run_gap_trends(const GapTrendsCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto runs, station::stored_jig_runs(store));
  const station::GapTrends trends = station::find_trends(runs);
  const bool shared =
      std::any_of(trends.jigs.begin(), trends.jigs.end(), [](const station::JigTrend& trend) {
        return trend.cause == station::TrendCause::jig ||
               trend.cause == station::TrendCause::station;
      });
  const bool judged =
      std::any_of(trends.jigs.begin(), trends.jigs.end(), [](const station::JigTrend& trend) {
        return trend.cause != station::TrendCause::too_few_units;
      });
  context.worsen(shared ? kExitFailed : judged ? kExitPassed : kExitInconclusive);
  if (options.json) {
    Json json = document("gap-trends");
    json["runs"] = trends.runs;
    json["left_out"] = trends.left_out;
    json["jigs"] = Json::array();
    for (const station::JigTrend& trend : trends.jigs) {
      json["jigs"].push_back(to_json(trend));
    }
    return print_json(context, json);
  }
  for (const station::JigTrend& trend : trends.jigs) {
    context.out << fmt::format(
        "{:<24} {:>4} units {:>5} runs  all alike {:.3f} deg, each its own {:.3f} deg: {}\n",
        printable(trend.jig, 24), trend.units, trend.runs, trend.common_deg, trend.units_deg,
        trend.cause == station::TrendCause::too_few_units
            ? "too few units"
            : fmt::format("belongs to {} (chance {:.4f})", station::to_string(trend.cause),
                          trend.chance));
  }
  if (trends.jigs.empty()) {
    context.people << "sixpoint: the store holds no jig run with six faces\n";
  }
  return {};
}

}  // namespace

void add_gap_trends(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapTrendsCommandOptions>(
      gap_command, context, "gap-trends", "trends",
      "whether a skew belongs to the units, to the jig or to the station", run_gap_trends);
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli

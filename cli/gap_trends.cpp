// sixpoint gap trends --store DB: whether a skew belongs to the units, the jig or the station.
#include "station/cli/gap_trends.h"

#include <memory>

#include <fmt/format.h>

#include "station/cli/store_option.h"
#include "station/gap_trends.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string store;
  bool json = false;
};

Json to_json(const station::JigTrend& trend) {
  Json json;
  json["jig"] = trend.jig;
  json["units"] = trend.units;
  json["runs"] = trend.runs;
  json["belongs_to"] = station::to_string(trend.owner);
  json["common_deg"] = trend.common_deg;
  json["units_deg"] = trend.units_deg;
  json["chance"] = trend.owner == station::Owner::too_few ? Json(nullptr) : Json(trend.chance);
  json["pattern_deg"] = trend.pattern_deg;
  return json;
}

void run(const Options& options, Context& context) {
  auto store = open_existing_store(context, options.store);
  if (!store) {
    return report_error(context, "gap-trends", store.error(), options.json);
  }
  const auto runs = station::stored_jig_runs(*store);
  if (!runs) {
    return report_error(context, "gap-trends", runs.error(), options.json);
  }
  const station::GapTrends trends = station::find_trends(*runs);
  const bool shared =
      std::any_of(trends.jigs.begin(), trends.jigs.end(), [](const station::JigTrend& trend) {
        return trend.owner == station::Owner::jig || trend.owner == station::Owner::station;
      });
  const bool judged = std::any_of(
      trends.jigs.begin(), trends.jigs.end(),
      [](const station::JigTrend& trend) { return trend.owner != station::Owner::too_few; });
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
        trend.owner == station::Owner::too_few
            ? "too few units to tell"
            : fmt::format("belongs to {} (chance {:.4f})", station::to_string(trend.owner),
                          trend.chance));
  }
  if (trends.jigs.empty()) {
    context.people << "sixpoint: the store holds no jig run with six faces\n";
  }
}

}  // namespace

void add_gap_trends(CLI::App& gap_command, Context& context) {
  CLI::App* command = gap_command.add_subcommand(
      "trends", "whether a skew belongs to the units, to the jig or to the station");
  auto options = std::make_shared<Options>();
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "one JSON document on standard output");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli

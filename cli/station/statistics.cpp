// sixpoint statistics, gage-rr: how the station works.
#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/store_option.h"
#include "station/records/station_records.h"

namespace sixpoint::cli {

namespace {

struct StatisticsCommandOptions {
  std::string store;
  std::string by;
  std::string from;
  std::string to;
  std::string html;
  OutputOptions outputs;
  std::string limits;
  std::string file;
  std::string study;
  std::string quantity = "zero_offset_mg";
  std::string axis = "x";
  double tolerance = 0;
  bool json = false;
};

struct Answer {
  station::StatisticsReport report;
  std::vector<station::StationState> states;
};

Result<Answer> collect(Context& context, const StatisticsCommandOptions& options) {
  SIXPOINT_ASSIGN(const auto filter, station::runs_between(options.from, options.to, "--"));
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.limits));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto runs, station::summaries(store, filter));
  Answer answer;
  SIXPOINT_ASSIGN(answer.report, station::statistics(runs, options.by,
                                                     options.limits.empty() ? nullptr : &limits));
  std::set<std::string> stations;
  SIXPOINT_CHECK(store.for_each_run({}, [&](const db::RunRecord& run) -> Status {
    stations.insert(run.station);
    return {};
  }));
  for (const std::string& name : stations) {
    SIXPOINT_ASSIGN(auto state, station::station_state(store, name, limits.check_unit));
    if (!state.charts.empty()) {
      answer.states.push_back(std::move(state));
    }
  }
  return answer;
}

void print_statistics(Context& context, const Answer& answer) {
  const auto percent = [](const station::Proportion& part) {
    return part.of == 0 ? std::string("-") : fmt::format("{:.1f} %", 100 * part.value());
  };
  const auto line = [&](const station::GroupStatistics& group) {
    const double seconds = group.seconds_per_unit_median;
    context.text() << fmt::format("  {:<24} {:>6} {:>6} {:>9} {:>11} {:>11}\n",
                                  printable(group.name.empty() ? "(not stated)" : group.name, 24),
                                  group.runs, group.units, percent(group.yield),
                                  percent(group.first_pass_yield),
                                  std::isfinite(seconds) ? fmt::format("{:.0f} s", seconds) : "-");
  };
  context.text() << answer.report.brief() << '\n';
  context.text() << fmt::format("  {:<24} {:>6} {:>6} {:>9} {:>11} {:>11}\n", "", "runs", "units",
                                "yield", "first pass", "per unit");
  for (const station::GroupStatistics& group : answer.report.groups) {
    line(group);
  }
  line(answer.report.all);
  for (const auto& [code, count] : answer.report.all.failure_codes) {
    const station::FailureCode* known = station::find_failure_code(code);
    context.text() << fmt::format("  {:>5} x {}: {}\n", count, printable(code),
                                  known != nullptr ? known->meaning : "");
  }
  for (const auto& [name, one] : answer.report.capabilities) {
    context.text() << fmt::format("  Cpk {:6.2f} ({:.2f} to {:.2f}), n = {}: {}\n", one.cpk,
                                  one.cpk_low, one.cpk_high, one.n, station::title_of(name));
  }
  if (answer.report.all.units < station::kLeastForCapability) {
    context.text() << fmt::format("  no Cpk of fewer than {} units\n",
                                  station::kLeastForCapability);
  }
  if (std::vector<std::string> differ = answer.report.limits_differ; !differ.empty()) {
    std::ranges::transform(differ, differ.begin(), station::title_of);
    context.text() << fmt::format(
        "  no Cpk where units were judged by different limits (--limits FILE names some): {}\n",
        fmt::join(differ, "; "));
  }
  for (const station::StationState& state : answer.states) {
    context.text() << printable(state.brief(), 4000) << '\n';
  }
}

Status run_statistics(const StatisticsCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.input(options.limits));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  SIXPOINT_ASSIGN(const Answer answer, collect(context, options));
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.html,
                              station::statistics_html(answer.report, answer.states)));
  }
  if (!options.json) {
    print_statistics(context, answer);
    return {};
  }
  Json json = document("statistics");
  json.update(answer.report.to_json());
  json["stations"] = Json::array();
  for (const station::StationState& state : answer.states) {
    json["stations"].push_back(state.to_json());
  }
  return print_json(context, json);
}

Result<std::vector<station::GageReading>> readings_of(const StatisticsCommandOptions& options,
                                                      Context& context) {
  if (!options.study.empty()) {
    SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
    return station::gage_readings(store, options.study, options.quantity, options.axis);
  }
  if (options.file.empty()) {
    return fail(ErrorCode::usage, "no readings are named", {}, "give a CSV file, or --study NAME");
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(context.env.files, options.file, 16ULL << 20));
  return station::parse_gage_csv(as_text(bytes), options.file);
}

Status gage_rr(const StatisticsCommandOptions& options, Context& context) {
  station::GageOptions gage;
  if (options.tolerance > 0) {
    gage.tolerance = options.tolerance;
  }
  SIXPOINT_ASSIGN(const auto readings, readings_of(options, context));
  SIXPOINT_ASSIGN(const auto report, station::gage_rr(readings, gage));
  context.worsen(report.usable() ? kExitPassed : kExitFailed);
  Json json = document("gage-rr");
  json.update(report.to_json());
  std::string text = report.brief() + "\n";
  if (report.grr_percent_of_tolerance) {
    text += fmt::format("gage R&R {:.2f} % of the tolerance\n", *report.grr_percent_of_tolerance);
  }
  for (const station::AnovaRow& row : report.pooled ? report.anova_pooled : report.anova) {
    text += fmt::format("  {:<16} {:>5.0f} {:>12.5f} {:>12.5f}{}\n", row.source,
                        row.degrees_of_freedom, row.sum_of_squares, row.mean_square,
                        row.f ? fmt::format(" F {:.3f} p {:.3f}", *row.f, row.p.value_or(0)) : "");
  }
  return print_answer(context, options.json, json, text);
}

}  // namespace

void add_statistics(CLI::App& app, Context& context) {
  auto [command, options] = add_command<StatisticsCommandOptions>(
      app, context, "statistics",
      "yield, failure codes, capability, check units (docs/statistics.md)", run_statistics);
  command.add_option("--by", options.by, "station, jig, operator or firmware");
  command.add_option("--from", options.from, "runs that started then or later (2027-03-31; UTC)");
  command.add_option("--to", options.to, "runs that started before this time");
  command.add_option("--html", options.html, "a page with charts");
  add_output_options(command, options.outputs);
  command.add_option("--limits", options.limits,
                     "a TOML file (docs/limits.md): its limits for Cpk, its policy for check "
                     "units; else those of the runs, and the built-in policy");
  add_store_option(command, options.store);
}

void add_gage_rr(CLI::App& app, Context& context) {
  auto [command, options] = add_command<StatisticsCommandOptions>(
      app, context, "gage-rr",
      "repeatability and reproducibility by ANOVA; exit 1: not good enough", gage_rr);
  auto* file = command.add_option("FILE", options.file, "CSV with part, operator, value");
  auto* name = command.add_option("--study", options.study,
                                  "... or the runs of 'sixpoint jig --study NAME' in the store");
  file->excludes(name);
  command.add_option("--quantity", options.quantity, "of the runs")->capture_default_str();
  command.add_option("--axis", options.axis, "of the quantity, where it has axes")
      ->capture_default_str();
  command.add_option("--tolerance", options.tolerance, "width of the specification")
      ->check(greater_than_zero());
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli

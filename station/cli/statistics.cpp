// sixpoint statistics, gage-rr: how the station works.
#include <memory>
#include <set>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"
#include "station/station_records.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string store;
  std::string by;
  std::string from;
  std::string to;
  std::string html;
  std::string limits;
  std::string file;
  std::string study;
  std::string quantity = "zero_offset_mg";
  std::string axis = "x";
  double tolerance = 0;
  bool json = false;
};

Result<std::optional<UtcTime>> day(const std::string& text, const char* option) {
  if (text.empty()) {
    return std::nullopt;
  }
  const auto time = parse_iso8601(text);
  if (!time) {
    return fail(ErrorCode::usage, time.error().what, option, "write it as 2027-03-31");
  }
  return *time;
}

struct Answer {
  station::StatisticsReport report;
  std::vector<station::StationState> states;
};

Result<Answer> collect(Context& context, const Options& options) {
  db::RunFilter filter;
  SIXPOINT_ASSIGN(filter.from, day(options.from, "--from"));
  SIXPOINT_ASSIGN(filter.to, day(options.to, "--to"));
  auto limits = station::default_limits();
  if (!options.limits.empty()) {
    SIXPOINT_ASSIGN(limits, station::read_limits(context.env.files, options.limits));
  }
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto runs, station::summaries(store, filter));
  Answer answer;
  SIXPOINT_ASSIGN(answer.report, station::statistics(runs, options.by));
  std::set<std::string> stations;
  db::RunFilter all;
  SIXPOINT_CHECK(store.for_each_run(all, [&](const db::RunRecord& run) -> Status {
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

void print(Context& context, const Answer& answer) {
  const auto percent = [](const station::Proportion& part) {
    return part.of == 0 ? std::string("-") : fmt::format("{:.1f} %", 100 * part.value());
  };
  const auto line = [&](const station::GroupStatistics& group) {
    context.out << fmt::format("  {:<24} {:>6} {:>6} {:>9} {:>11} {:>9.0f} s\n",
                               printable(group.name.empty() ? "(not stated)" : group.name, 24),
                               group.runs, group.units, percent(group.yield),
                               percent(group.first_pass_yield), group.seconds_per_unit_median);
  };
  context.out << answer.report.brief() << '\n';
  context.out << fmt::format("  {:<24} {:>6} {:>6} {:>9} {:>11} {:>11}\n", "", "runs", "units",
                             "yield", "first pass", "per unit");
  for (const station::GroupStatistics& group : answer.report.groups) {
    line(group);
  }
  line(answer.report.all);
  for (const auto& [code, count] : answer.report.all.failure_codes) {
    const station::FailureCode* known = station::find_failure_code(code);
    context.out << fmt::format("  {:>5} x {}: {}\n", count, printable(code),
                               known != nullptr ? known->meaning : "");
  }
  for (const auto& [name, one] : answer.report.capabilities) {
    context.out << fmt::format("  Cpk {:6.2f} ({:.2f} to {:.2f}), n = {}: {}\n", one.cpk,
                               one.cpk_low, one.cpk_high, one.n, name);
  }
  for (const station::StationState& state : answer.states) {
    context.out << printable(state.brief(), 4000) << '\n';
  }
}

Result<station::GageReport> study(Context& context, const Options& options) {
  station::GageOptions gage;
  if (options.tolerance > 0) {
    gage.tolerance = options.tolerance;
  }
  std::vector<station::GageReading> readings;
  if (!options.study.empty()) {
    SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
    SIXPOINT_ASSIGN(readings,
                    station::gage_readings(store, options.study, options.quantity, options.axis));
  } else {
    SIXPOINT_ASSIGN(const Bytes bytes, read_file(context.env.files, options.file, 16ULL << 20));
    SIXPOINT_ASSIGN(readings,
                    station::parse_gage_csv(
                        std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
                        options.file));
  }
  return station::gage_rr(readings, gage);
}

}  // namespace

void add_statistics(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "statistics", "yield, failure codes, capability, check units (docs/statistics.md)");
  command->add_option("--by", options->by, "station, jig, operator or firmware");
  command->add_option("--from", options->from, "runs that started then or later (2027-03-31)");
  command->add_option("--to", options->to, "runs that started before");
  command->add_option("--html", options->html, "a page with charts");
  command->add_option("--limits", options->limits, "a limits file with a [check_unit] table");
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "one JSON document on stdout");
  command->callback([options, &context] {
    const auto answer = collect(context, *options);
    if (!answer) {
      return report_error(context, "statistics", answer.error(), options->json);
    }
    if (!options->html.empty()) {
      const Status written = write_file(context.env.files, options->html,
                                        station::statistics_html(answer->report, answer->states));
      if (!written) {
        return report_error(context, "statistics", written.error(), options->json);
      }
    }
    if (!options->json) {
      return print(context, *answer);
    }
    Json json = document("statistics");
    json.update(answer->report.to_json());
    json["stations"] = Json::array();
    for (const station::StationState& state : answer->states) {
      json["stations"].push_back(state.to_json());
    }
    print_json(context, json);
  });
}

void add_gage_rr(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "gage-rr", "repeatability and reproducibility by ANOVA; exit 1: not good enough");
  auto* file = command->add_option("FILE", options->file, "CSV with part, operator, value");
  auto* name = command->add_option("--study", options->study,
                                   "... or the runs of 'sixpoint jig --study NAME' in the store");
  file->excludes(name);
  command->add_option("--quantity", options->quantity, "of the runs")->capture_default_str();
  command->add_option("--axis", options->axis, "of the quantity")->capture_default_str();
  command->add_option("--tolerance", options->tolerance, "width of the specification")
      ->check(CLI::PositiveNumber);
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "one JSON document on stdout");
  command->callback([options, &context] {
    const auto report =
        options->file.empty() && options->study.empty()
            ? Result<station::GageReport>(fail(ErrorCode::usage, "no readings are named", {},
                                               "give a CSV file, or --study NAME"))
            : study(context, *options);
    if (!report) {
      return report_error(context, "gage-rr", report.error(), options->json);
    }
    context.worsen(report->usable() ? kExitPassed : kExitFailed);
    if (options->json) {
      Json json = document("gage-rr");
      json.update(report->to_json());
      return print_json(context, json);
    }
    context.out << report->brief() << '\n';
    for (const station::AnovaRow& row : report->pooled ? report->anova_pooled : report->anova) {
      context.out << fmt::format(
          "  {:<16} {:>5.0f} {:>12.5f} {:>12.5f}{}\n", row.source, row.degrees_of_freedom,
          row.sum_of_squares, row.mean_square,
          row.f ? fmt::format(" F {:.3f} p {:.3f}", *row.f, row.p.value_or(0)) : "");
    }
  });
}

}  // namespace sixpoint::cli

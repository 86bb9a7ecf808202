// sixpoint check-unit, station-lock, retest: what watches the station, and what engineers decide.
#include <memory>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"
#include "station/station_records.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string serial;
  std::string station;
  std::string operator_name;
  std::string reason;
  std::string limits;
  std::string store;
  std::string html;
  bool new_baseline = false;
  bool release = false;
  bool json = false;
};

Result<station::Limits> limits_of(Context& context, const Options& options) {
  return options.limits.empty() ? Result<station::Limits>(station::default_limits())
                                : station::read_limits(context.env.files, options.limits);
}

Result<station::StationState> state_of(Context& context, const Options& options) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto limits, limits_of(context, options));
  return station::station_state(store, options.station, limits.check_unit);
}

Result<std::string> decide(Context& context, const Options& options, const std::string& action) {
  SIXPOINT_ASSIGN(auto store, open_store(context, options.store));
  db::StationEvent event;
  event.station = options.station;
  event.serial = options.serial;
  event.action = action;
  event.operator_name = options.operator_name;
  event.reason = options.reason;
  return store.add_station_event(event);
}

void answer_decision(Context& context, const char* name, const Options& options,
                     const std::string& action, const std::string& said) {
  const auto id = decide(context, options, action);
  if (!id) {
    return report_error(context, name, id.error(), options.json);
  }
  if (options.json) {
    Json answer = document(name);
    answer["stored_id"] = *id;
    answer["action"] = action;
    answer["serial"] = options.serial;
    answer["station"] = options.station;
    return print_json(context, answer);
  }
  context.out << said << '\n';
}

void answer_state(Context& context, const char* name, const Options& options) {
  const auto state = state_of(context, options);
  if (!state) {
    return report_error(context, name, state.error(), options.json);
  }
  if (!options.html.empty()) {
    std::string page = "<!doctype html>\n<meta charset=utf-8><title>Check units</title>\n";
    for (const station::CheckUnitChart& chart : state->charts) {
      page += station::chart_svg(chart);
    }
    if (const Status written = write_file(context.env.files, options.html, page); !written) {
      return report_error(context, name, written.error(), options.json);
    }
  }
  context.worsen(state->locked ? kExitFailed : kExitPassed);
  if (options.json) {
    Json answer = document(name);
    answer.update(state->to_json());
    return print_json(context, answer);
  }
  context.out << printable(state->brief(), 4000) << '\n';
  for (const station::CheckUnitChart& chart : state->charts) {
    const station::ControlChart& one = chart.chart;
    context.out << fmt::format("  {} {}: {} points, ", printable(chart.serial), one.name,
                               one.values.size());
    context.out << (one.baseline == 0 ? std::string("too few for limits yet\n")
                                      : fmt::format("{:.3f} within {:.3f} and {:.3f}{}\n",
                                                    one.values.back(), one.lower, one.upper,
                                                    one.signals.empty() ? "" : ", out of control"));
  }
}

void add_decision_options(CLI::App& command, Options& options) {
  command.add_option("--operator", options.operator_name, "who decides")->required();
  command.add_option("--reason", options.reason, "why, for the record")->required();
}

}  // namespace

void add_check_unit(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "check-unit", "units that watch the station, and their charts (docs/statistics.md)");
  command->require_subcommand(1);
  auto options = std::make_shared<Options>();
  const auto common = [&](CLI::App& sub) {
    sub.add_option("--station", options->station, "the station, as 'sixpoint jig' was told");
    add_store_option(sub, options->store);
    sub.add_flag("--json", options->json, "one JSON document on stdout");
  };
  auto* add = command->add_subcommand("add", "from now on this unit watches the station");
  add->add_option("SERIAL", options->serial)->required();
  add_decision_options(*add, *options);
  common(*add);
  add->callback([options, &context] {
    answer_decision(context, "check-unit", *options, "check_unit",
                    printable(options->serial) + " is a check unit now");
  });
  auto* remove = command->add_subcommand("remove", "this unit is a check unit no more");
  remove->add_option("SERIAL", options->serial)->required();
  add_decision_options(*remove, *options);
  common(*remove);
  remove->callback([options, &context] {
    answer_decision(context, "check-unit", *options, "check_unit_end",
                    printable(options->serial) + " is a check unit no more");
  });
  auto* chart =
      command->add_subcommand("chart", "individuals and moving range charts; exit 1: locked");
  chart->add_option("--limits", options->limits, "a limits file with a [check_unit] table");
  chart->add_option("--html", options->html, "the charts as a page");
  common(*chart);
  chart->callback([options, &context] { answer_state(context, "check-unit", *options); });
}

void add_station_lock(CLI::App& app, Context& context) {
  auto* command =
      app.add_subcommand("station-lock", "is the station locked by its check units; sign for it");
  command->require_subcommand(1);
  auto options = std::make_shared<Options>();
  const auto common = [&](CLI::App& sub) {
    sub.add_option("--station", options->station, "the station, as 'sixpoint jig' was told");
    add_store_option(sub, options->store);
    sub.add_flag("--json", options->json, "one JSON document on stdout");
  };
  auto* status = command->add_subcommand("status", "exit 1 when it is locked");
  status->add_option("--limits", options->limits, "a limits file with a [check_unit] table");
  common(*status);
  status->callback([options, &context] { answer_state(context, "station-lock", *options); });
  auto* sign = command->add_subcommand("sign", "an engineer has looked; the station may go on");
  add_decision_options(*sign, *options);
  sign->add_flag("--new-baseline", options->new_baseline,
                 "the jig was changed: what check units said before is no measure any more");
  common(*sign);
  sign->callback([options, &context] {
    answer_decision(context, "station-lock", *options,
                    options->new_baseline ? "sign_new_baseline" : "sign",
                    "signed; the station may go on");
  });
}

void add_retest(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  auto* command =
      app.add_subcommand("retest", "may this unit be measured again (docs/verdicts.md)");
  command->add_option("SERIAL", options->serial)->required();
  command->add_flag("--release", options->release, "an engineer has looked: it may");
  command->add_option("--operator", options->operator_name, "who decides");
  command->add_option("--reason", options->reason, "why, for the record");
  command->add_option("--limits", options->limits, "a limits file with a [retest] table");
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "one JSON document on stdout");
  command->callback([options, &context] {
    if (options->release) {
      return answer_decision(context, "retest", *options, "release",
                             printable(options->serial) + " may be measured again");
    }
    auto store = open_existing_store(context, options->store);
    if (!store) {
      return report_error(context, "retest", store.error(), options->json);
    }
    const auto limits = limits_of(context, *options);
    if (!limits) {
      return report_error(context, "retest", limits.error(), options->json);
    }
    const auto state = station::unit_retest_state(*store, options->serial, limits->retest);
    if (!state) {
      return report_error(context, "retest", state.error(), options->json);
    }
    context.worsen(state->may_start ? kExitPassed : kExitFailed);
    if (options->json) {
      Json answer = document("retest");
      answer["serial"] = options->serial;
      answer["may_start"] = state->may_start;
      answer["failures_in_row"] = state->failures_in_row;
      answer["passes_needed"] = state->passes_needed;
      answer["retest_of"] = state->retest_of.empty() ? Json(nullptr) : Json(state->retest_of);
      return print_json(context, answer);
    }
    context.out << fmt::format("{}: {}; {} pass{} in a row until it counts as passed\n",
                               printable(options->serial),
                               state->may_start ? "may be measured" : state->reason,
                               state->passes_needed, state->passes_needed == 1 ? "" : "es");
  });
}

}  // namespace sixpoint::cli

// sixpoint check-unit, station-lock, retest: checks of the station, and the decisions of engineers.
#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/text/html.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/station/operator.h"
#include "cli/store_option.h"
#include "station/records/station_guard.h"
#include "station/records/station_records.h"

namespace sixpoint::cli {

namespace {

struct CheckUnitCommandOptions {
  std::string serial;
  std::string station;
  std::string operator_name;
  std::string reason;
  std::string expect;
  std::string limits;
  std::string store;
  std::string html;
  OutputOptions outputs;
  bool new_baseline = false;
  bool release = false;
  bool json = false;
};

// The store, for who may decide.
Result<db::Store> signed_store(const CheckUnitCommandOptions& options, Context& context) {
  SIXPOINT_CHECK(sign_off(context, options.operator_name));
  return open_store(context, options.store);
}

// Adds an engineer's decision to the store, about a unit or about the station: what the answer says
// of it.
Result<Json> record(const CheckUnitCommandOptions& options, db::Store& store,
                    const std::string& serial, const char* command, const std::string& action) {
  std::string reason = options.reason;
  if (!options.expect.empty()) {
    SIXPOINT_ASSIGN(reason, station::reason_with_codes(options.expect, options.reason));
  }
  const db::StationEvent event{.station = options.station,
                               .serial = serial,
                               .action = action,
                               .operator_name = options.operator_name,
                               .reason = reason};
  Json json = document(command);
  SIXPOINT_ASSIGN(json["stored_id"], station::add_decision(store, event));
  json["action"] = action;
  return json;
}

// A mistyped serial number is one of a unit that never comes.
Status warn_of_unknown(Context& context, db::Store& store, const std::string& serial) {
  SIXPOINT_ASSIGN(const db::UnitHistory history, store.unit_history(serial));
  if (history.empty()) {
    context.log().warn("{}: the store knows no such unit", printable(serial));
  }
  return {};
}

// An engineer's decision about a unit.
Status decide(const CheckUnitCommandOptions& options, Context& context, const char* command,
              const std::string& action, const std::string& done) {
  SIXPOINT_ASSIGN(auto store, signed_store(options, context));
  const std::string serial = stored_serial(store, options.serial);
  if (action == "check_unit") {
    SIXPOINT_CHECK(warn_of_unknown(context, store, serial));
  }
  SIXPOINT_ASSIGN(Json json, record(options, store, serial, command, action));
  json["serial"] = serial;
  json["station"] = options.station;
  return print_answer(context, options.json, json, fmt::format("{} {}\n", printable(serial), done));
}

Status show_state(const CheckUnitCommandOptions& options, Context& context, const char* command) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.input(options.limits));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.limits));
  SIXPOINT_ASSIGN(
      const auto state,
      station::station_state(store, options.station, limits.check_unit, context.env.clock.now()));
  if (!options.html.empty()) {
    std::string page = html_head("Check units");
    for (const station::CheckUnitChart& chart : state.charts) {
      page += station::chart_svg(chart);
    }
    SIXPOINT_CHECK(write_file(outputs.files(), options.html, page.append(kHtmlEnd)));
  }
  context.worsen(state.locked ? kExitFailed : kExitPassed);
  Json json = document(command);
  json.update(state.to_json());
  std::string text = printable(state.brief(), 4000) + "\n";
  for (const station::CheckUnitChart& chart : state.charts) {
    const station::ControlChart& one = chart.chart;
    text += fmt::format("  {} {}: {} points, ", printable(chart.serial),
                        station::title_of(one.name), one.values.size());
    text += one.baseline == 0
                ? std::string("too few for limits yet\n")
                : fmt::format("{:.3f} within {:.3f} and {:.3f}{}\n", one.values.back(), one.lower,
                              one.upper, one.signals.empty() ? "" : ", out of control");
  }
  return print_answer(context, options.json, json, text);
}

// A signature opens what charts locked, and not what a known-bad unit did: the answer says which.
Status sign(const CheckUnitCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, signed_store(options, context));
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.limits));
  SIXPOINT_ASSIGN(Json json, record(options, store, "", "station-lock",
                                    options.new_baseline ? "sign_new_baseline" : "sign"));
  SIXPOINT_ASSIGN(
      const auto state,
      station::station_state(store, options.station, limits.check_unit, context.env.clock.now()));
  json.update(state.to_json());
  std::string text = "signed; " + printable(state.brief(), 4000) + "\n";
  if (state.check_units.empty() && state.known_bad.empty()) {
    text +=
        "the store has no check unit: where one is in use, is this its store, and its station?\n";
  } else if (!state.locked && state.charts.empty() && state.known_bad.empty()) {
    text += "no check unit was measured at this station: is its name right?\n";
  }
  return print_answer(context, options.json, json, text);
}

Status retest(const CheckUnitCommandOptions& options, Context& context) {
  if (options.release) {
    return decide(options, context, "retest", "release", "may be measured again");
  }
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.limits));
  const std::string serial = stored_serial(store, options.serial);
  SIXPOINT_CHECK(warn_of_unknown(context, store, serial));
  SIXPOINT_ASSIGN(const auto state,
                  station::StationGuard(context.env, guard_folder(options.store), limits)
                      .unit_state(store, serial));
  context.worsen(state.may_start ? kExitPassed : kExitFailed);
  Json json = document("retest");
  json["serial"] = serial;
  json["may_start"] = state.may_start;
  json["failures_in_row"] = state.failures_in_row;
  json["passes_needed"] = state.passes_needed;
  json["retest_of"] = text_or_null(state.retest_of);
  return print_answer(
      context, options.json, json,
      fmt::format(
          "{}: {}; {}\n{}", printable(serial),
          state.may_start ? "may be measured" : "may not be measured again: " + state.reason,
          state.passes_needed == 1
              ? std::string("one pass counts")
              : fmt::format("it counts as passed after {} passes in a row", state.passes_needed),
          state.may_start ? "" : station::unit_needs_release(state, serial).hint + "\n"));
}

void add_decision_options(CLI::App& command, CheckUnitCommandOptions& options) {
  command.add_option("--operator", options.operator_name, "who decides")->required();
  command.add_option("--reason", options.reason, "why, for the record")->required();
}

void add_limits_option(CLI::App& command, CheckUnitCommandOptions& options) {
  command.add_option("--limits", options.limits,
                     "a TOML file of limits (docs/limits.md); else the built-in ones");
}

void add_place_options(CLI::App& command, CheckUnitCommandOptions& options) {
  command.add_option("--station", options.station, "the station, as given to 'sixpoint jig'");
  add_store_option(command, options.store);
}

Declared<CheckUnitCommandOptions> add_state(CLI::App& group, Context& context,
                                            const char* group_name, const char* name,
                                            const char* about) {
  const auto declared = add_command<CheckUnitCommandOptions>(
      group, context, group_name, name, about,
      [group_name](const CheckUnitCommandOptions& options, Context& here) {
        return show_state(options, here, group_name);
      });
  add_limits_option(declared.command, declared.options);
  add_place_options(declared.command, declared.options);
  return declared;
}

}  // namespace

void add_check_unit(CLI::App& app, Context& context) {
  CLI::App& group = add_group(
      app, "check-unit", "units that check the station, and their charts (docs/statistics.md)");
  const auto add_action = [&](const char* name, const char* about, const char* action,
                              const char* done) {
    auto [command, options] = add_command<CheckUnitCommandOptions>(
        group, context, "check-unit", name, about,
        [action, done](const CheckUnitCommandOptions& its, Context& here) {
          return decide(its, here, "check-unit", action, done);
        });
    command.add_option("SERIAL", options.serial)->required();
    add_decision_options(command, options);
    add_place_options(command, options);
    if (std::string_view(action) == "check_unit") {
      command.add_option(
          "--expect", options.expect,
          "a known-bad unit: the codes that it must fail with at each shift's start");
    }
  };
  add_action("add", "from now on this unit checks the station", "check_unit",
             "is a check unit now");
  add_action("remove", "this unit is no longer a check unit", "check_unit_end",
             "is no longer a check unit");
  auto [chart, options] = add_state(group, context, "check-unit", "chart",
                                    "individuals and moving range charts; exit 1: locked");
  chart.add_option("--html", options.html, "the charts as a page");
  add_output_options(chart, options.outputs);
}

void add_station_lock(CLI::App& app, Context& context) {
  CLI::App& group =
      add_group(app, "station-lock", "is the station locked by its check units; sign for it");
  add_state(group, context, "station-lock", "status", "exit 1 when it is locked");
  auto [command, options] = add_command<CheckUnitCommandOptions>(
      group, context, "station-lock", "sign", "an engineer has checked it; the station may go on",
      sign);
  add_decision_options(command, options);
  command.add_flag("--new-baseline", options.new_baseline,
                   "the jig was changed: earlier runs of the check units do not count any more");
  add_place_options(command, options);
}

void add_retest(CLI::App& app, Context& context) {
  auto [command, options] = add_command<CheckUnitCommandOptions>(
      app, context, "retest", "may this unit be measured again (docs/verdicts.md)", retest);
  command.add_option("SERIAL", options.serial)->required();
  command.add_flag("--release", options.release, "an engineer has checked it: it may");
  command.add_option("--operator", options.operator_name, "who decides");
  command.add_option("--reason", options.reason, "why, for the record");
  command.add_option("--limits", options.limits,
                     "a TOML file of limits (docs/limits.md); else the built-in ones");
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli

#include "station/records/station_records.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// The charts of a check unit: of the quantities that the constants consist of.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kCharted = {{
    {"sensitivity_deviation_percent", "x"},
    {"sensitivity_deviation_percent", "y"},
    {"sensitivity_deviation_percent", "z"},
    {"zero_offset_mg", "x"},
    {"zero_offset_mg", "y"},
    {"zero_offset_mg", "z"},
}};

std::set<std::string> check_units_of(const std::vector<db::StationEvent>& events) {
  std::set<std::string> units;
  for (const db::StationEvent& event : events) {
    if (event.action == "check_unit") {
      units.insert(event.serial);
    } else if (event.action == "check_unit_end") {
      units.erase(event.serial);
    }
  }
  return units;
}

// The units whose charts count at a station, each with the time at which it ceased to be a check
// unit. One that was removed counts until an engineer has signed: its removal lifts no lock.
std::map<std::string, std::optional<UtcTime>> watching(const std::vector<db::StationEvent>& events,
                                                       const StationState& state) {
  std::map<std::string, std::optional<UtcTime>> units;
  for (const db::StationEvent& event : events) {
    if (event.action == "check_unit") {
      units[event.serial] = std::nullopt;
    } else if (event.action == "check_unit_end" && units.contains(event.serial)) {
      units[event.serial] = event.made_at;
    }
  }
  std::erase_if(units, [&](const auto& unit) {
    return unit.second && state.signature && *unit.second <= state.signature->made_at;
  });
  return units;
}

std::optional<double> value_in(const RunSummary& run, std::string_view name,
                               std::string_view axis) {
  for (const JudgedQuantity& quantity : run.quantities) {
    if (quantity.name == name && quantity.axis == axis && std::isfinite(quantity.value)) {
      return quantity.value;
    }
  }
  return std::nullopt;
}

}  // namespace

RunSummary summary_of(const db::RunRecord& run) {
  RunSummary out;
  out.id = run.id;
  out.serial = run.serial;
  out.station = run.station;
  out.jig = run.jig;
  out.operator_name = run.operator_name;
  out.started = run.started;
  out.seconds = std::chrono::duration<double>(run.ended - run.started).count();
  out.verdict = parse_jig_verdict(run.verdict).value_or(JigVerdict::inconclusive);
  out.codes = run.codes;
  const Json json = parse_json(run.document);
  if (json.is_object() && json.contains("firmware") && json["firmware"].is_string()) {
    out.firmware = json["firmware"].get<std::string>();
  }
  if (json.is_object() && json.contains("quantities")) {
    out.quantities = quantities_from_json(json["quantities"]);
  }
  return out;
}

Result<std::vector<RunSummary>> summaries(db::Store& store, const db::RunFilter& filter) {
  SIXPOINT_ASSIGN(const auto events, store.station_events());
  const db::CheckUnitTimes check_unit_times(events);
  std::vector<RunSummary> out;
  SIXPOINT_CHECK(store.for_each_run(filter, [&](const db::RunRecord& run) -> Status {
    if (!check_unit_times.hold(run.serial, run.started)) {
      out.push_back(summary_of(run));
    }
    return {};
  }));
  return out;
}

Result<db::RunFilter> runs_between(const std::string& from, const std::string& to,
                                   const std::string& prefix) {
  const auto day = [&](const std::string& text,
                       const char* name) -> Result<std::optional<UtcTime>> {
    if (text.empty()) {
      return std::nullopt;
    }
    const auto time = parse_iso8601(text);
    if (!time) {
      return fail(ErrorCode::usage, time.error().what, prefix + name, "write it as 2027-03-31");
    }
    return *time;
  };
  db::RunFilter filter;
  SIXPOINT_ASSIGN(filter.from, day(from, "from"));
  SIXPOINT_ASSIGN(filter.to, day(to, "to"));
  if (filter.from && filter.to && *filter.from > *filter.to) {
    return fail(ErrorCode::usage, fmt::format("this day is after {}to", prefix), prefix + "from",
                "the earlier day is first");
  }
  return filter;
}

namespace {

// The latest signature of this station goes into the state; answers with the time of the latest one
// that asked for a new baseline.
std::optional<UtcTime> read_signatures(const std::vector<db::StationEvent>& events,
                                       StationState& state) {
  std::optional<UtcTime> baseline_from;
  for (const db::StationEvent& event : events) {
    const bool new_baseline = event.action == "sign_new_baseline";
    if (event.station == state.station && (new_baseline || event.action == "sign")) {
      state.signature = event;
      if (new_baseline) {
        baseline_from = event.made_at;
      }
    }
  }
  return baseline_from;
}

CheckUnitChart chart_of(const std::vector<RunSummary>& runs, std::string_view name,
                        std::string_view axis, const StationState& state,
                        const CheckUnitPolicy& policy) {
  CheckUnitChart chart;
  std::vector<double> values;
  std::size_t signed_up_to = 0;
  for (const RunSummary& run : runs) {
    if (const auto value = value_in(run, name, axis)) {
      chart.serial = run.serial;
      values.push_back(*value);
      chart.times.push_back(run.started);
      if (state.signature && run.started <= state.signature->made_at) {
        signed_up_to = values.size();
      }
    }
  }
  chart.chart = control_chart(fmt::format("{} {}", name, axis), std::move(values),
                              static_cast<std::size_t>(policy.baseline_runs),
                              name == "zero_offset_mg" ? policy.least_sigma_zero_mg
                                                       : policy.least_sigma_sensitivity_percent,
                              signed_up_to);
  return chart;
}

// Why this chart locks the station; nothing where it does not.
std::optional<std::string> lock_reason(const CheckUnitChart& one, std::string_view name,
                                       std::string_view axis,
                                       const std::vector<int>& locking_rules) {
  const auto& signals = one.chart.signals;
  const auto last = std::find_if(signals.rbegin(), signals.rend(), [&](const ChartSignal& signal) {
    return std::find(locking_rules.begin(), locking_rules.end(), signal.rule) !=
           locking_rules.end();
  });
  if (last == signals.rend()) {
    return std::nullopt;
  }
  const std::string time = to_iso8601(one.times[last->point]);
  return fmt::format("check unit {}, {} {}: {} on {} at {} UTC", one.serial,
                     find_quantity(name)->title, axis, nelson_rule(last->rule), time.substr(0, 10),
                     time.substr(11, 5));
}

}  // namespace

constexpr std::string_view kExpects = "expects ";

Result<std::string> reason_with_codes(const std::string& codes, const std::string& reason) {
  std::string text(kExpects);
  std::size_t begin = 0;
  while (begin <= codes.size()) {
    const std::size_t end = std::min(codes.find(',', begin), codes.size());
    const std::string code = codes.substr(begin, end - begin);
    if (find_failure_code(code) == nullptr) {
      return fail(ErrorCode::usage, fmt::format("'{}' is no code of a run", printable(code, 60)),
                  "--expect", "docs/verdicts.md lists the codes; give them as CODE,CODE");
    }
    begin = end + 1;
  }
  return fmt::format("{}{}: {}", kExpects, codes, reason);
}

std::vector<std::string> codes_in_reason(const std::string& reason) {
  std::vector<std::string> codes;
  const std::size_t colon = reason.find(": ");
  if (!reason.starts_with(kExpects) || colon == std::string::npos) {
    return codes;
  }
  std::string_view rest = std::string_view(reason).substr(0, colon).substr(kExpects.size());
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    codes.emplace_back(rest.substr(0, comma));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  // What a person wrote by chance is no list of codes.
  if (std::ranges::any_of(codes, [](const auto& code) { return !find_failure_code(code); })) {
    return {};
  }
  std::ranges::sort(codes);
  return codes;
}

namespace {

std::vector<KnownBad> known_bad_of(const std::vector<db::StationEvent>& events,
                                   const StationState& state) {
  std::map<std::string, KnownBad> units;
  for (const db::StationEvent& event : events) {
    const bool is_named = event.action == "check_unit" && event.station == state.station;
    const auto codes = is_named ? codes_in_reason(event.reason) : std::vector<std::string>{};
    if (!codes.empty()) {
      units[event.serial] = {event.serial, codes, std::nullopt};
    } else if (const auto unit = units.find(event.serial);
               unit != units.end() && !unit->second.until &&
               (is_named || event.action == "check_unit_end")) {
      unit->second.until = event.made_at;
    }
  }
  std::vector<KnownBad> known;
  for (const auto& [serial, unit] : units) {
    if (!unit.until || !state.signature || *unit.until > state.signature->made_at) {
      known.push_back(unit);
    }
  }
  return known;
}

// Why this known-bad unit locks the station; nothing where it failed as it must.
std::optional<std::string> why_not_as_bad_as_known(const KnownBad& unit,
                                                   const std::optional<RunSummary>& last,
                                                   const std::optional<UtcTime>& now) {
  const std::string must = fmt::format("{}", fmt::join(unit.codes, ", "));
  const char* removed = unit.until ? "; it was removed since: an engineer signs" : "";
  if (now && !unit.until && (!last || last->started < *now - kShift)) {
    return fmt::format("known-bad unit {} was not measured in this shift; it must fail with {}",
                       unit.serial, must);
  }
  if (!last) {
    return std::nullopt;
  }
  std::vector<std::string> codes = last->codes;
  std::ranges::sort(codes);
  const bool failed =
      last->verdict == JigVerdict::fail || last->verdict == JigVerdict::conditional_fail;
  if (failed && codes == unit.codes) {
    return std::nullopt;
  }
  return fmt::format("known-bad unit {} must fail with {}, and its last run says {} {}{}",
                     unit.serial, must, to_string(last->verdict), fmt::join(codes, ", "), removed);
}

}  // namespace

Result<StationState> station_state(db::Store& store, const std::string& station,
                                   const CheckUnitPolicy& policy,
                                   const std::optional<UtcTime>& now) {
  SIXPOINT_ASSIGN(const auto events, store.station_events());
  StationState state;
  state.station = station;
  const std::set<std::string> units = check_units_of(events);
  state.check_units.assign(units.begin(), units.end());
  db::RunFilter filter;
  filter.from = read_signatures(events, state);
  for (const auto& [serial, until] : watching(events, state)) {
    filter.serial = serial;
    std::vector<RunSummary> runs;
    SIXPOINT_CHECK(
        store.for_each_run(filter, [&, &last = until](const db::RunRecord& run) -> Status {
          if (run.station == station && (!last || run.started <= *last)) {
            runs.push_back(summary_of(run));
          }
          return {};
        }));
    for (const auto& [name, axis] : kCharted) {
      CheckUnitChart chart = chart_of(runs, name, axis, state, policy);
      if (chart.times.empty()) {
        continue;
      }
      if (auto reason = lock_reason(chart, name, axis, policy.locking_rules)) {
        state.locked = true;
        state.reasons.push_back(*std::move(reason));
      }
      state.charts.push_back(std::move(chart));
    }
  }
  state.known_bad = known_bad_of(events, state);
  for (const KnownBad& unit : state.known_bad) {
    db::RunFilter of_unit;
    of_unit.serial = unit.serial;
    std::optional<RunSummary> last;
    SIXPOINT_CHECK(store.for_each_run(of_unit, [&](const db::RunRecord& run) -> Status {
      if (run.station == station && (!unit.until || run.started <= *unit.until)) {
        last = summary_of(run);
      }
      return {};
    }));
    if (auto reason = why_not_as_bad_as_known(unit, last, now)) {
      state.locked = true;
      state.reasons.push_back(*std::move(reason));
    }
  }
  return state;
}

std::string StationState::brief() const {
  const std::string name = station.empty() ? "the station without a name" : "station " + station;
  if (!locked) {
    return fmt::format("{} is open; {} check units", name, check_units.size());
  }
  std::string text = fmt::format("{} is locked", name);
  for (const std::string& reason : reasons) {
    text += "; " + reason;
  }
  return text;
}

Json StationState::to_json() const {
  Json json = {{"station", station},          {"locked", locked},
               {"reasons", reasons},          {"check_units", check_units},
               {"known_bad", Json::object()}, {"signature", nullptr}};
  for (const KnownBad& unit : known_bad) {
    if (unit.until) {
      continue;
    }
    json["known_bad"][unit.serial] = unit.codes;
  }
  if (signature) {
    json["signature"] = {{"made_at", to_iso8601(signature->made_at)},
                         {"operator", signature->operator_name},
                         {"reason", signature->reason},
                         {"new_baseline", signature->action == "sign_new_baseline"}};
  }
  json["charts"] = Json::array();
  for (const CheckUnitChart& chart : charts) {
    Json item = {{"serial", chart.serial}};
    item.update(chart.chart.to_json());
    item["times"] = Json::array();
    for (const UtcTime time : chart.times) {
      item["times"].push_back(to_iso8601(time));
    }
    json["charts"].push_back(std::move(item));
  }
  return json;
}

Result<RetestState> unit_retest_state(db::Store& store, const std::string& serial,
                                      const RetestPolicy& policy,
                                      const std::vector<EndedRun>& waiting) {
  SIXPOINT_ASSIGN(const auto events, store.station_events());
  std::vector<EndedRun> runs;
  db::RunFilter filter;
  filter.serial = serial;
  SIXPOINT_CHECK(store.for_each_run(filter, [&](const db::RunRecord& run) -> Status {
    runs.push_back({{run.id, parse_jig_verdict(run.verdict).value_or(JigVerdict::inconclusive),
                     run.codes, false},
                    run.ended});
    return {};
  }));
  runs.insert(runs.end(), waiting.begin(), waiting.end());
  std::ranges::stable_sort(runs, {}, &EndedRun::ended);
  for (const db::StationEvent& event : events) {
    if (event.action == "release" && event.serial == serial) {
      const auto after = std::ranges::upper_bound(runs, event.made_at, {}, &EndedRun::ended);
      if (after != runs.begin()) {
        std::prev(after)->run.released_after = true;
      }
    }
  }
  std::vector<EarlierRun> earlier;
  earlier.reserve(runs.size());
  for (EndedRun& each : runs) {
    earlier.push_back(std::move(each.run));
  }
  return retest_state(earlier, policy);
}

Error station_is_locked(const std::string& why, const std::string& station) {
  return {
      ErrorCode::configuration,
      why,
      {},
      fmt::format("measure a check unit again, and a known-bad unit, which must fail; where a "
                  "check unit was out of control an engineer then signs, on the page or by: "
                  "sixpoint station-lock sign --station '{}' --operator NAME --reason WHY, with "
                  "the same --store",
                  printable(station, 60))};
}

Error unit_needs_release(const RetestState& state, const std::string& serial) {
  return {ErrorCode::configuration, state.reason, printable(serial, 60),
          fmt::format("an engineer checks it; then: sixpoint retest {} --release --operator NAME "
                      "--reason WHY, with the same --store",
                      printable(serial, 60))};
}

Result<RetestState> may_start(db::Store& store, const std::string& serial,
                              const std::string& station, const Limits& limits,
                              const std::vector<EndedRun>& waiting) {
  SIXPOINT_ASSIGN(const auto events, store.station_events());
  const std::set<std::string> check_units = check_units_of(events);
  if (check_units.contains(serial)) {
    return RetestState{};  // it is measured to check the station
  }
  SIXPOINT_ASSIGN(const StationState here, station_state(store, station, limits.check_unit));
  if (here.locked) {
    return fail(station_is_locked(here.brief(), station));
  }
  SIXPOINT_ASSIGN(RetestState state, unit_retest_state(store, serial, limits.retest, waiting));
  if (!state.may_start) {
    return fail(unit_needs_release(state, serial));
  }
  return state;
}

Result<std::string> add_decision(db::Store& store, const db::StationEvent& decision) {
  if (decision.action == "check_unit_end") {
    SIXPOINT_ASSIGN(const auto events, store.station_events());
    if (!check_units_of(events).contains(decision.serial)) {
      return fail(ErrorCode::no_input, "this is no check unit", printable(decision.serial),
                  "'sixpoint check-unit chart' names them");
    }
  }
  if (decision.action == "release") {
    SIXPOINT_ASSIGN(const db::UnitHistory history, store.unit_history(decision.serial));
    if (history.empty()) {
      return fail(ErrorCode::no_input, "the store knows no such unit", printable(decision.serial),
                  "give its serial number; runs that wait in a journal: 'sixpoint store catch-up'");
    }
  }
  return store.add_station_event(decision);
}

Result<std::optional<Error>> may_write(Result<db::Store>& store, const std::string& serial,
                                       const std::string& constants_id, bool is_in_journal) {
  const auto found = store ? store->unit_history(serial) : fail(store.error());
  if (!found && !is_in_journal) {
    return fail(found.error());
  }
  const db::UnitHistory history = found.value_or(db::UnitHistory());
  if (std::ranges::find(history.constants, constants_id, &db::ConstantsRecord::id) ==
      history.constants.end()) {
    return is_in_journal
               ? std::nullopt
               : std::optional(Error{ErrorCode::no_input, "the store does not hold these constants",
                                     db::shown_id(constants_id), "measure the unit again"});
  }
  if (!history.is_withdrawn(constants_id)) {
    return std::nullopt;
  }
  std::string why;
  for (const db::Correction& correction : history.corrections) {
    if (correction.row_id == constants_id && correction.action == "withdraw") {
      why = correction.reason;
    }
  }
  return Error{ErrorCode::configuration,
               fmt::format("these constants were withdrawn: {}", printable(why, 200)),
               db::shown_id(constants_id), "measure the unit again"};
}

Result<std::vector<GageReading>> gage_readings(db::Store& store, const std::string& study,
                                               const std::string& quantity,
                                               const std::string& axis) {
  if (find_quantity(quantity) == nullptr) {
    return fail(ErrorCode::usage, fmt::format("'{}' is not measured", printable(quantity, 60)), {},
                "'sixpoint limits print' shows what is");
  }
  std::vector<GageReading> readings;
  std::set<std::string> axes;  // that the quantity has in these runs
  bool known = false;
  db::RunFilter filter;
  filter.kind = kStudyKind;
  SIXPOINT_CHECK(store.for_each_run(filter, [&](const db::RunRecord& run) -> Status {
    const Json json = parse_json(run.document);
    if (!json.is_object() || !json.contains("study") || json["study"] != study) {
      return {};
    }
    known = true;
    const RunSummary summary = summary_of(run);
    for (const JudgedQuantity& each : summary.quantities) {
      if (each.name == quantity) {
        axes.insert(each.axis);
      }
    }
    const bool has_no_axes = axes == std::set<std::string>{""};
    if (const auto value = value_in(summary, quantity, has_no_axes ? "" : axis)) {
      readings.push_back({run.serial, run.operator_name, *value});
    }
    return {};
  }));
  if (!known) {
    return fail(ErrorCode::no_input,
                fmt::format("the store has no runs of the study '{}'", printable(study, 60)), {},
                "measure them with 'sixpoint jig --study NAME --operator WHO'");
  }
  if (axes.empty()) {
    return fail(ErrorCode::usage, fmt::format("the runs of the study have no {}", quantity), {},
                "take another --quantity");
  }
  if (readings.empty()) {
    return fail(ErrorCode::usage,
                fmt::format("the runs have no {} of axis '{}'", quantity, printable(axis, 20)), {},
                fmt::format("name one of its axes with --axis: {}",
                            printable(fmt::format("{}", fmt::join(axes, ", ")), 100)));
  }
  return readings;
}

}  // namespace sixpoint::station

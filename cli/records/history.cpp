// sixpoint history SERIAL: all records of a unit in the store, oldest first: constants, runs,
// writes to it, repaired files, corrections, and what engineers decided about it.
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "base/sha256.h"
#include "base/text/json_text.h"
#include "calib/constants.h"
#include "cli/command.h"
#include "cli/people_text.h"
#include "cli/store_option.h"
#include "repair/rescale/applying_constants.h"
#include "station/limits/verdict.h"

namespace sixpoint::cli {
namespace {

struct HistoryCommandOptions {
  std::string serial;
  std::string store;
  bool json = false;
};

// The JSON text of a column; null where it is empty.
Json json_in(const std::string& text) {
  Json json = parse_json(text);
  return json.is_discarded() ? Json(nullptr) : json;
}

// Of every set, by its own filter configuration: why it applies or does not.
std::vector<std::string> about_constants(const db::UnitHistory& history) {
  using calib::FilterConfiguration;
  const auto current = repair::applying_constants(history, FilterConfiguration::current);
  const auto legacy = repair::applying_constants(history, FilterConfiguration::legacy);
  std::vector<std::string> about;
  for (std::size_t i = 0; i < history.constants.size(); ++i) {
    const bool of_current =
        history.constants[i].filter == calib::to_string(FilterConfiguration::current);
    about.push_back(of_current ? current.about[i] : legacy.about[i]);
  }
  return about;
}

Json to_json(const db::ConstantsRecord& record, bool withdrawn, const std::string& about) {
  Json json;
  json["id"] = record.id;
  json["serial"] = record.serial;
  json["filter"] = record.filter;
  const Json document = json_in(record.document);
  for (const char* key : {"constants", "standard_uncertainty"}) {
    json[key] = document.is_object() && document.contains(key) ? document[key] : Json(nullptr);
  }
  json["method"] = record.method;
  json["made_at"] = to_iso8601(record.made_at);
  json["run"] = text_or_null(record.run_id);
  json["origin"] = json_in(record.origin);
  json["withdrawn"] = withdrawn;
  json["applies"] = about.starts_with("applies");
  json["why"] = about;
  return json;
}

// Names the limits of a run: two runs with the same value were judged by the same limits. It is the
// hash of the limits file; records of earlier versions do not hold that, so the text is hashed.
Json limits_sha256(const Json& limits, const std::string& text) {
  if (limits.is_object() && limits.contains("sha256")) {
    return limits["sha256"];
  }
  if (text.empty()) {
    return nullptr;
  }
  return text_sha256(text);
}

Json to_json(const db::RunRecord& run) {
  Json json = {{"id", run.id},
               {"kind", run.kind},
               {"filter", run.filter},
               {"started", to_iso8601(run.started)},
               {"ended", to_iso8601(run.ended)},
               {"operator", run.operator_name},
               {"station", run.station},
               {"jig", run.jig},
               {"jig_due", value_or_null(run.jig_due)},
               {"verdict", run.verdict},
               {"codes", run.codes},
               {"retest_of", text_or_null(run.retest_of)},
               {"software", run.software},
               {"build", text_or_null(run.build)},
               {"limits", json_in(run.limits)}};
  json["limits_sha256"] = limits_sha256(json["limits"], run.limits);
  json["gravity_m_per_s2"] = value_or_null(run.gravity_m_per_s2);
  json["temperature_c"] = value_or_null(run.temperature_c);
  return json;
}

Json to_json(const db::UnitWrite& write) {
  return {{"run", write.run_id},
          {"written", to_iso8601(write.written)},
          {"as_found", json_in(write.as_found)},
          {"as_left", json_in(write.as_left)},
          {"read_back", json_in(write.read_back)}};
}

Json to_json(const db::RepairRecord& repair) {
  return {{"id", repair.id},
          {"input", repair.input},
          {"made_at", to_iso8601(repair.made_at)},
          {"input_sha256", repair.input_sha256},
          {"output_sha256", repair.output_sha256},
          {"method", repair.method},
          {"constants", text_or_null(repair.constants_id)},
          {"software", text_or_null(repair.software)}};
}

Json to_json(const db::Correction& correction) {
  return {{"id", correction.id},
          {"made_at", to_iso8601(correction.made_at)},
          {"about", {{"table", correction.table}, {"id", correction.row_id}}},
          {"action", correction.action},
          {"operator", correction.operator_name},
          {"reason", correction.reason}};
}

Json to_json(const db::StationEvent& event) {
  return {{"id", event.id},
          {"made_at", to_iso8601(event.made_at)},
          {"action", event.action},
          {"station", text_or_null(event.station)},
          {"operator", event.operator_name},
          {"reason", event.reason}};
}

// What engineers decided about the unit (db/records.h).
Result<std::vector<db::StationEvent>> events_of(db::Store& store, const std::string& serial) {
  SIXPOINT_ASSIGN(auto events, store.station_events());
  std::erase_if(events, [&](const db::StationEvent& event) { return event.serial != serial; });
  return events;
}

std::string in_words(const std::string& action) {
  return action == "release"          ? "released"
         : action == "check_unit"     ? "check unit"
         : action == "check_unit_end" ? "no check unit any more"
                                      : action;
}

template <class Records>
Json array_of(const Records& records) {
  Json array = Json::array();
  for (const auto& record : records) {
    array.push_back(to_json(record));
  }
  return array;
}

// "sensitivity 230.996 229.644 223.038 LSB/g, zero 77.58 58.72 118.72 LSB"
std::string values_of(const db::ConstantsRecord& record) {
  const Json document = json_in(record.document);
  if (!document.is_object() || !document.contains("constants")) {
    return {};
  }
  return constants_text(document["constants"]);
}

// What a run was judged by, beside its verdict: the residual and its limit, and why it did not
// pass.
std::string values_of(const db::RunRecord& run) {
  std::string text;
  const Json document = json_in(run.document);
  if (document.is_object() && document.contains("quantities")) {
    for (const auto& one : station::quantities_from_json(document["quantities"])) {
      if (one.name == "verification_residual_mg" && std::isfinite(one.value)) {
        text = fmt::format("{:.1f} mg off", one.value);
        text += one.high ? fmt::format(" (limit {:g})", *one.high) : "";
      }
    }
  }
  for (const std::string& code : run.codes) {
    text += (text.empty() ? "" : ", ") + printable(code, 60);
  }
  return text;
}

// A line per record, by the time of day at which it was made.
void print_history(const db::UnitHistory& history, const std::vector<db::StationEvent>& events,
                   Context& context) {
  std::vector<std::pair<UtcTime, std::vector<std::string>>> lines;
  const auto line = [&](UtcTime time, std::string what, std::string state, const std::string& id,
                        std::string values) {
    lines.push_back({time,
                     {local_time(time), std::move(what), std::move(state),
                      id.empty() ? id : db::shown_id(id), std::move(values)}});
  };
  const auto about = about_constants(history);
  for (std::size_t i = 0; i < history.constants.size(); ++i) {
    const db::ConstantsRecord& record = history.constants[i];
    line(record.made_at, "constants", record.filter + ", " + record.method, record.id,
         fmt::format("{}; {}", values_of(record), printable(about[i])));
  }
  for (const auto& run : history.runs) {
    line(run.started, "run " + run.kind, run.verdict, run.id,
         fmt::format("{}{}{}", values_of(run),
                     run.jig.empty() ? "" : fmt::format("; jig {}", printable(run.jig)),
                     run.retest_of.empty() ? "" : "; repeats " + db::shown_id(run.retest_of)));
  }
  for (const auto& write : history.writes) {
    line(write.written, "written into the unit", "", write.run_id, "by this run");
  }
  for (const auto& repair : history.repairs) {
    line(repair.made_at, "repaired file", repair.method, repair.id, printable(repair.input));
  }
  for (const auto& correction : history.corrections) {
    line(correction.made_at, correction.action, correction.table,
         correction.table == "units" ? "" : correction.row_id,
         fmt::format("{} ({})", printable(correction.reason), printable(correction.operator_name)));
  }
  for (const auto& event : events) {
    line(event.made_at, in_words(event.action), printable(event.station, 60), event.id,
         fmt::format("{} ({})", printable(event.reason), printable(event.operator_name)));
  }
  std::ranges::stable_sort(lines, {}, [](const auto& one) { return one.first; });
  Columns list({"when", "record", "state", "id", "values"});
  for (auto& [time, texts] : lines) {
    list.row(std::move(texts));
  }
  context.out << list.text();
}

Status run_history(const HistoryCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  const std::string serial = stored_serial(store, options.serial);
  SIXPOINT_ASSIGN(const auto history, store.unit_history(serial));
  SIXPOINT_ASSIGN(const auto events, events_of(store, serial));
  if (history.empty() && events.empty()) {
    return fail(ErrorCode::no_input, "the store has no records of this unit", options.serial,
                "'sixpoint units' lists the units in the store");
  }
  if (!options.json) {
    print_history(history, events, context);
    return {};
  }
  Json json = document("history");
  json["serial"] = serial;
  Json& constants = json["constants"] = Json::array();
  const auto about = about_constants(history);
  for (std::size_t i = 0; i < history.constants.size(); ++i) {
    const db::ConstantsRecord& record = history.constants[i];
    constants.push_back(to_json(record, history.is_withdrawn(record.id), about[i]));
  }
  json["runs"] = array_of(history.runs);
  json["writes"] = array_of(history.writes);
  json["repairs"] = array_of(history.repairs);
  json["corrections"] = array_of(history.corrections);
  json["events"] = array_of(events);
  return print_json(context, json);
}

}  // namespace

void add_history(CLI::App& app, Context& context) {
  auto [command, options] = add_command<HistoryCommandOptions>(
      app, context, "history",
      "all records of a unit in the store: constants, runs, repairs, decisions", run_history);
  command.add_option("serial", options.serial, "the unit's serial number")->required();
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli

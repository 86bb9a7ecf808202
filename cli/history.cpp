// sixpoint history SERIAL: everything that the store holds about a unit, oldest first: constants,
// runs, writes to it, its mended files, corrections.
#include <span>

#include <fmt/format.h>

#include "base/sha256.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string serial;
  std::string store;
  bool json = false;
};

// What stands in a column of JSON; null where there is nothing.
Json json_in(const std::string& text) {
  Json json = Json::parse(text, nullptr, false);
  return json.is_discarded() ? Json(nullptr) : json;
}

Json text_or_null(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json to_json(const db::ConstantsRecord& record, bool withdrawn) {
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
  return json;
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
               {"jig_due", run.jig_due ? Json(to_iso8601(*run.jig_due)) : Json(nullptr)},
               {"verdict", run.verdict},
               {"codes", run.codes},
               {"retest_of", text_or_null(run.retest_of)},
               {"software", run.software},
               {"build", text_or_null(run.build)},
               {"limits", json_in(run.limits)}};
  // Two runs were judged alike when this is the same: the limits file's own hash, which earlier
  // versions did not keep.
  const Json& limits = json["limits"];
  if (limits.is_object() && limits.contains("sha256")) {
    json["limits_sha256"] = Json(limits["sha256"]);
  } else {
    json["limits_sha256"] =
        run.limits.empty()
            ? Json(nullptr)
            : Json(to_hex(sha256(std::span(reinterpret_cast<const std::uint8_t*>(run.limits.data()),
                                           run.limits.size()))));
  }
  json["gravity_m_per_s2"] = run.gravity_m_per_s2 ? Json(*run.gravity_m_per_s2) : Json(nullptr);
  json["temperature_c"] = run.temperature_c ? Json(*run.temperature_c) : Json(nullptr);
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

template <class Records>
Json array_of(const Records& records) {
  Json array = Json::array();
  for (const auto& record : records) {
    array.push_back(to_json(record));
  }
  return array;
}

void print(const db::UnitHistory& history, Context& context) {
  for (const auto& record : history.constants) {
    context.out << fmt::format("{}  {:<8} {:<14} {}{}\n", to_iso8601(record.made_at), record.filter,
                               record.method, record.id,
                               history.is_withdrawn(record.id) ? "  withdrawn" : "");
  }
  for (const auto& run : history.runs) {
    context.out << fmt::format("{}  run {:<4} {:<14} {}  {}{}\n", to_iso8601(run.started), run.kind,
                               run.verdict, run.id, printable(run.jig),
                               run.retest_of.empty() ? "" : "  repeats " + run.retest_of);
  }
  for (const auto& write : history.writes) {
    context.out << fmt::format("{}  written into the unit by run {}\n", to_iso8601(write.written),
                               write.run_id);
  }
  for (const auto& repair : history.repairs) {
    context.out << fmt::format("{}  mended   {:<14} {}\n", to_iso8601(repair.made_at),
                               repair.method, printable(repair.input));
  }
  for (const auto& correction : history.corrections) {
    context.out << fmt::format("{}  {:<8} of {} {}: {} ({})\n", to_iso8601(correction.made_at),
                               correction.action, correction.table, correction.row_id,
                               printable(correction.reason), printable(correction.operator_name));
  }
}

void run(const Options& options, Context& context) {
  auto store = open_existing_store(context, options.store);
  if (!store) {
    return report_error(context, "history", store.error(), options.json);
  }
  const auto history = store->unit_history(options.serial);
  if (!history) {
    return report_error(context, "history", history.error(), options.json);
  }
  if (history->empty()) {
    return report_error(context, "history",
                        Error{ErrorCode::no_input, "the store holds nothing of this unit",
                              options.serial, "'sixpoint units' lists the units that it knows"},
                        options.json);
  }
  if (!options.json) {
    return print(*history, context);
  }
  Json answer = document("history");
  answer["serial"] = options.serial;
  answer["constants"] = Json::array();
  for (const auto& record : history->constants) {
    answer["constants"].push_back(to_json(record, history->is_withdrawn(record.id)));
  }
  answer["runs"] = array_of(history->runs);
  answer["writes"] = array_of(history->writes);
  answer["repairs"] = array_of(history->repairs);
  answer["corrections"] = array_of(history->corrections);
  print_json(context, answer);
}

}  // namespace

void add_history(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "history", "All that the store holds about a unit: constants, runs, repairs");
  auto options = std::make_shared<Options>();
  command->add_option("serial", options->serial, "The unit's serial number")->required();
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli

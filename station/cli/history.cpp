// sixpoint history SERIAL: every set of constants that a unit ever had, oldest first.
#include <fmt/format.h>

#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string serial;
  std::string store;
  bool json = false;
};

Json to_json(const db::ConstantsRecord& record) {
  Json json;
  json["id"] = record.id;
  json["serial"] = record.serial;
  json["filter"] = record.filter;
  const Json document = Json::parse(record.document, nullptr, false);
  for (const char* key : {"constants", "standard_uncertainty"}) {
    json[key] = document.is_object() && document.contains(key) ? document[key] : Json(nullptr);
  }
  json["method"] = record.method;
  json["made_at"] = to_iso8601(record.made_at);
  json["run"] = record.run_id.empty() ? Json(nullptr) : Json(record.run_id);
  return json;
}

void run(const Options& options, Context& context) {
  auto store = open_existing_store(context, options.store);
  if (!store) {
    return report_error(context, "history", store.error(), options.json);
  }
  const auto records = store->history(options.serial);
  if (!records) {
    return report_error(context, "history", records.error(), options.json);
  }
  if (records->empty()) {
    return report_error(context, "history",
                        Error{ErrorCode::no_input, "the store holds no constants of this unit",
                              options.serial, "'sixpoint units' lists the units that it knows"},
                        options.json);
  }
  if (options.json) {
    Json answer = document("history");
    answer["serial"] = options.serial;
    answer["constants"] = Json::array();
    for (const auto& record : *records) {
      answer["constants"].push_back(to_json(record));
    }
    return print_json(context, answer);
  }
  for (const auto& record : *records) {
    context.out << fmt::format("{}  {:<8} {:<14} {}\n", to_iso8601(record.made_at), record.filter,
                               record.method, record.id);
  }
}

}  // namespace

void add_history(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("history", "List all constants that a unit ever had");
  auto options = std::make_shared<Options>();
  command->add_option("serial", options->serial, "The unit's serial number")->required();
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli

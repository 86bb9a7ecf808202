// sixpoint store: moving, saving and asking the whole store.
#include <fmt/format.h>

#include "db/exchange.h"
#include "db/journal.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string store;
  std::string path;
  std::string id;
  std::string table = "constants";
  std::string journal;
  std::string operator_name;
  std::string reason;
  std::string from;
  std::string to;
  int days = 365;
  bool csv = false;
  bool json = false;
};

using Answer = Result<Json>;

Json exchange_json(const db::ExchangeReport& report, const std::string& file) {
  Json json = document("store");
  json["file"] = file;
  json.update(report.to_json());
  return json;
}

Answer export_store(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto report,
                  options.csv ? db::export_csv(store, context.env.files, options.path)
                              : db::export_json_lines(store, context.env.files, options.path));
  context.people << report.brief() << '\n';
  return exchange_json(report, options.path);
}

Answer import_store(const Options& options, Context& context) {
  // A missing input must not leave an empty store behind.
  SIXPOINT_ASSIGN(const FileInfo input, context.env.files.info(options.path));
  db::ExchangeReport report;
  if (store_exists(context, options.store)) {
    SIXPOINT_ASSIGN(auto store, open_store(context, options.store));
    SIXPOINT_ASSIGN(report, input.is_folder
                                ? db::import_csv(store, context.env.files, options.path)
                                : db::import_json_lines(store, context.env.files, options.path));
  } else {
    SIXPOINT_ASSIGN(const std::string path, place_of_new_store(context, options.store));
    SIXPOINT_ASSIGN(report, db::import_into_new_file(context.env, options.path, path));
  }
  context.people << fmt::format("{}; {} were new\n", report.brief(), report.added);
  return exchange_json(report, options.path);
}

Answer back_up(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto report, db::backup(store, context.env, options.path));
  context.people << report.brief() << '\n';
  return exchange_json(report, options.path);
}

Answer catch_up(const Options& options, Context& context) {
  const std::string folder =
      options.journal.empty() ? journal_folder(options.store) : options.journal;
  if (!options.journal.empty()) {
    SIXPOINT_CHECK(context.env.files.info(folder));
  }
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  std::size_t taken = 0;
  if (context.env.files.info(folder)) {
    SIXPOINT_ASSIGN(auto journal, db::Journal::open(context.env.files, folder));
    SIXPOINT_ASSIGN(taken, journal.catch_up(store));
  }
  context.people << fmt::format("{} entries of the journal are in the store now\n", taken);
  Json json = document("store");
  json["taken"] = taken;
  return json;
}

// A new row about an old one: withdraw, reinstate, note.
Answer correct(const Options& options, Context& context, const std::string& action) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  db::Correction correction;
  correction.table = options.table;
  correction.row_id = options.id;
  correction.action = action;
  correction.operator_name = options.operator_name;
  correction.reason = options.reason;
  SIXPOINT_ASSIGN(const std::string id, store.correct(correction));
  Json json = document("store");
  json["correction"] = id;
  json["action"] = action;
  json["about"] = {{"table", options.table}, {"id", options.id}};
  return json;
}

Answer withdraw(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(Json json, correct(options, context, "withdraw"));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto recall, store.recall_list(options.id));
  context.people << fmt::format("withdrawn; {} files were mended with these constants\n",
                                recall.size());
  json["withdrawn"] = options.id;
  json["recall"] = recall.size();
  return json;
}

Answer reinstate(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(Json json, correct(options, context, "reinstate"));
  context.people << "these constants apply again\n";
  return json;
}

Answer note(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(Json json, correct(options, context, "note"));
  context.people << fmt::format("noted about {} {}\n", options.table, printable(options.id));
  return json;
}

Answer recall(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto entries, store.recall_list(options.id));
  Json json = document("store");
  Json& files = json["files"] = Json::array();
  for (const auto& entry : entries) {
    files.push_back({{"input", entry.repair.input},
                     {"serial", entry.repair.serial},
                     {"mended_at", to_iso8601(entry.repair.made_at)},
                     {"input_sha256", entry.repair.input_sha256},
                     {"output_sha256", entry.repair.output_sha256},
                     {"method", entry.repair.method},
                     {"constants", entry.repair.constants_id},
                     {"software", entry.repair.software},
                     {"withdrawn_at", to_iso8601(entry.withdrawn_at)},
                     {"reason", entry.reason}});
    if (!options.json) {
      context.out << fmt::format("{}  {:<16} {}  ({})\n", to_iso8601(entry.repair.made_at),
                                 entry.repair.serial, printable(entry.repair.input),
                                 printable(entry.reason));
    }
  }
  return json;
}

Answer jig_units(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto units, store.units_of_jig(options.id));
  Json json = document("store");
  json["jig"] = options.id;
  Json& list = json["units"] = Json::array();
  for (const auto& unit : units) {
    list.push_back({{"serial", unit.serial},
                    {"runs", unit.runs},
                    {"last_run", to_iso8601(unit.last_run)},
                    {"last_verdict", unit.last_verdict}});
    if (!options.json) {
      context.out << fmt::format("{:<16} {:>3} runs  last {}  {}\n", unit.serial, unit.runs,
                                 to_iso8601(unit.last_run), unit.last_verdict);
    }
  }
  return json;
}

Answer yield(const Options& options, Context& context) {
  UtcTime from = UtcTime::min();
  UtcTime to = UtcTime::max();
  if (!options.from.empty()) {
    SIXPOINT_ASSIGN(from, parse_iso8601(options.from));
  }
  if (!options.to.empty()) {
    SIXPOINT_ASSIGN(to, parse_iso8601(options.to));
  }
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto report, store.yield(from, to));
  Json json = document("store");
  json["runs"] = report.runs;
  json["retests"] = report.retests;
  json["units"] = report.units;
  json["passed"] = report.passed;
  json["passed_first_time"] = report.passed_first_time;
  json["yield"] = number(report.yield());
  json["first_pass_yield"] = number(report.first_pass_yield());
  if (!options.json) {
    context.out << fmt::format(
        "{} units in {} runs ({} retests): {} passed, {} of them at the first run\n", report.units,
        report.runs, report.retests, report.passed, report.passed_first_time);
  }
  return json;
}

Answer due(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto units,
                  store.units_due(context.env.clock.now() - std::chrono::hours(24) * options.days));
  Json json = document("store");
  Json& list = json["units"] = Json::array();
  for (const auto& unit : units) {
    const Json last = unit.last_constants ? Json(to_iso8601(*unit.last_constants)) : Json(nullptr);
    list.push_back({{"serial", unit.serial}, {"model", unit.model}, {"last_constants", last}});
    if (!options.json) {
      context.out << fmt::format("{:<16} {:<18} {}\n", unit.serial, unit.model,
                                 last.is_null() ? "no constants" : last.get<std::string>());
    }
  }
  return json;
}

Answer trend(const Options& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto points, store.trend(options.id));
  if (points.empty()) {
    return fail(ErrorCode::no_input, "the store holds no constants of this unit", options.id,
                "'sixpoint units' lists the units that it knows");
  }
  Json json = document("store");
  json["serial"] = options.id;
  Json& list = json["points"] = Json::array();
  for (const auto& point : points) {
    const Json constants = Json::parse(point.constants.document, nullptr, false);
    list.push_back({{"made_at", to_iso8601(point.constants.made_at)},
                    {"id", point.constants.id},
                    {"filter", point.constants.filter},
                    {"method", point.constants.method},
                    {"jig", point.jig},
                    {"station", point.station},
                    {"verdict", point.verdict},
                    {"withdrawn", point.withdrawn},
                    {"constants", constants.is_object() && constants.contains("constants")
                                      ? constants["constants"]
                                      : Json(nullptr)}});
    if (!options.json) {
      context.out << fmt::format("{}  {:<8} {:<10} {:<12} {}{}\n",
                                 to_iso8601(point.constants.made_at), point.constants.filter,
                                 point.constants.method, point.jig, point.constants.id,
                                 point.withdrawn ? "  withdrawn" : "");
    }
  }
  return json;
}

// One subcommand: its options come from `add`, its answer from `work`.
CLI::App* add(CLI::App& parent, Context& context, const char* name, const char* about,
              Answer (*work)(const Options&, Context&), const std::shared_ptr<Options>& options) {
  auto* command = parent.add_subcommand(name, about);
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, work, &context] {
    const Answer answer = work(*options, context);
    if (!answer) {
      return report_error(context, "store", answer.error(), options->json);
    }
    if (options->json) {
      print_json(context, *answer);
    }
  });
  return command;
}

}  // namespace

void add_store(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("store", "Move, save and ask the whole store");
  command->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* out = add(*command, context, "export", "Write the whole store as JSON Lines or CSV",
                  export_store, options);
  out->add_option("-o,--output", options->path, "The file; with --csv the folder")->required();
  out->add_flag("--csv", options->csv, "One CSV file per table instead of JSON Lines");
  add(*command, context, "import", "Continue a store with the rows of an export", import_store,
      options)
      ->add_option("file", options->path, "What 'store export' wrote: JSON Lines, or a CSV folder")
      ->required();
  add(*command, context, "backup", "Copy the store into an SQLite file while others work", back_up,
      options)
      ->add_option("-o,--output", options->path, "The copy")
      ->required();
  add(*command, context, "catch-up", "Store what the store did not take when it was measured",
      catch_up, options)
      ->add_option("--journal", options->journal,
                   "The folder of a journal that was written elsewhere (default: this station's)");
  auto* taken_back = add(*command, context, "withdraw",
                         "Constants apply no more; they stay in the history", withdraw, options);
  taken_back->add_option("id", options->id, "The constants' id ('sixpoint history')")->required();
  auto* given_back =
      add(*command, context, "reinstate", "Withdrawn constants apply again", reinstate, options);
  given_back->add_option("id", options->id, "The constants' id ('sixpoint history')")->required();
  auto* noted =
      add(*command, context, "note", "Add what is wrong or missing in a row", note, options);
  noted
      ->add_option("table", options->table,
                   "The row's table: units, runs, constants, unit_writes, repairs ...")
      ->required();
  noted->add_option("id", options->id, "The row's id; of a unit its serial number")->required();
  for (CLI::App* correction : {taken_back, given_back, noted}) {
    correction->add_option("--reason", options->reason, "Why, or what")->required();
    correction->add_option("--operator", options->operator_name, "Who says so")->required();
  }
  add(*command, context, "recall", "Files mended with constants that were withdrawn", recall,
      options)
      ->add_option("id", options->id, "Only these constants");
  add(*command, context, "jig", "Units that were on a jig", jig_units, options)
      ->add_option("jig", options->id, "The jig's name")
      ->required();
  auto* passed = add(*command, context, "yield", "How many units passed, and how many at once",
                     yield, options);
  passed->add_option("--from", options->from, "Runs from this date on (ISO 8601, UTC)");
  passed->add_option("--to", options->to, "Runs before this date");
  add(*command, context, "due", "Units whose constants are old or missing", due, options)
      ->add_option("--days", options->days, "How old constants may be")
      ->check(CLI::Range(0, 100'000))
      ->capture_default_str();
  add(*command, context, "trend", "All calibrations of one unit, for its control chart", trend,
      options)
      ->add_option("serial", options->id, "The unit's serial number")
      ->required();
}

}  // namespace sixpoint::cli

// sixpoint store: moving, saving and asking the whole store.
#include <algorithm>
#include <cstdlib>

#include <fmt/format.h>

#include "base/text/counted.h"
#include "base/text/json_text.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/store_option.h"
#include "db/exchange.h"
#include "db/journal.h"

namespace sixpoint::cli {
namespace {

struct StoreCommandOptions {
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
  OutputOptions outputs;
  bool json = false;
};

// `text` is for stdout without --json, `note` for people in any case.
struct Answer {
  Json json = document("store");
  std::string text;
  std::string note;
};

Answer answer_of(const db::ExchangeReport& report, const std::string& file,
                 const std::string& note) {
  Answer answer;
  answer.json["file"] = file;
  answer.json.update(report.to_json());
  answer.note = note;
  return answer;
}

Result<Answer> export_store(const StoreCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(options.csv ? outputs.folder("--output", options.path)
                             : outputs.file("--output", options.path));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto report,
                  options.csv ? db::export_csv(store, outputs.files(), options.path)
                              : db::export_json_lines(store, outputs.files(), options.path));
  return answer_of(report, options.path, report.brief());
}

Result<Answer> import_store(const StoreCommandOptions& options, Context& context) {
  // A missing input must not leave an empty store behind.
  SIXPOINT_CHECK(context.env.files.info(options.path));
  db::ExchangeReport report;
  if (store_exists(context, options.store)) {
    SIXPOINT_ASSIGN(auto store, open_store(context, options.store));
    SIXPOINT_ASSIGN(report, db::import_json_lines(store, context.env.files, options.path));
  } else {
    SIXPOINT_ASSIGN(const std::string path, place_of_new_store(context, options.store));
    SIXPOINT_ASSIGN(report, db::import_into_new_file(context.env, options.path, path));
  }
  return answer_of(report, options.path,
                   fmt::format("{}; {} were new", report.brief(), report.added));
}

Result<Answer> back_up(const StoreCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.file_to_keep("--output", options.path));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  Env env = outputs.env();
  SIXPOINT_ASSIGN(const auto report, db::backup(store, env, options.path));
  return answer_of(report, options.path, report.brief());
}

// A store that is there, for a command that adds to it: one that may not be written is refused.
Result<db::Store> open_to_add(const StoreCommandOptions& options, Context& context) {
  return store_exists(context, options.store) ? open_store(context, options.store)
                                              : open_existing_store(context, options.store);
}

Result<Answer> catch_up(const StoreCommandOptions& options, Context& context) {
  const std::string folder =
      options.journal.empty() ? journal_folder(options.store) : options.journal;
  if (!options.journal.empty()) {
    SIXPOINT_CHECK(context.env.files.info(folder));
  }
  // The journal may be all that there is of a store: the one that it waits for is made. Not where
  // both are named and the folder's name is another store's, since one name may be wrong.
  const bool waits = context.env.files.info(folder).has_value();
  const std::string name = file_name_of(folder.substr(0, folder.find_last_not_of('/') + 1));
  const auto is_folder = [&](const std::string& resort) { return file_name_of(resort) == name; };
  const bool is_of_store =
      options.journal.empty() || std::ranges::any_of(last_resort_folders(options.store), is_folder);
  SIXPOINT_ASSIGN(auto store, waits&& is_of_store ? open_store(context, options.store)
                                                  : open_to_add(options, context));
  std::size_t taken = 0;
  if (waits) {
    SIXPOINT_ASSIGN(auto journal, db::Journal::open(context.env.files, folder));
    SIXPOINT_ASSIGN(taken, journal.catch_up(store));
  }
  Answer answer;
  answer.json["taken"] = taken;
  answer.note = fmt::format("{} of the journal {} in the store now", counted(taken, "entry"),
                            taken == 1 ? "is" : "are");
  return answer;
}

std::string login_name() {
  const char* user = std::getenv("USER");
  return user != nullptr && *user != '\0' ? user : "unknown";
}

// Adds a row about an old one: withdraw, reinstate, prefer, note.
Result<Answer> correct(db::Store& store, const StoreCommandOptions& options,
                       const std::string& action) {
  if (action == "withdraw" || action == "reinstate") {
    SIXPOINT_ASSIGN(const std::string id, store.whole_key(options.table, options.id));
    SIXPOINT_ASSIGN(const bool withdrawn, store.is_withdrawn(id));
    if (withdrawn == (action == "withdraw")) {
      return fail(
          ErrorCode::configuration,
          withdrawn ? "these constants are withdrawn already" : "these constants are not withdrawn",
          id, "'sixpoint history SERIAL' says what was decided, and why");
    }
  }
  const db::Correction correction{
      .table = options.table,
      .row_id = options.table == "units" ? stored_serial(store, options.id) : options.id,
      .action = action,
      .operator_name = options.operator_name.empty() ? login_name() : options.operator_name,
      .reason = options.reason};
  Answer answer;
  SIXPOINT_ASSIGN(answer.json["correction"], store.correct(correction));
  answer.json["action"] = action;
  SIXPOINT_ASSIGN(const std::string id, store.whole_key(options.table, correction.row_id));
  answer.json["about"] = {{"table", options.table}, {"id", id}};
  return answer;
}

Result<Answer> withdraw(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_to_add(options, context));
  SIXPOINT_ASSIGN(Answer answer, correct(store, options, "withdraw"));
  const auto id = answer.json["about"]["id"].get<std::string>();
  SIXPOINT_ASSIGN(const auto recall, store.recall_list(id));
  answer.json["withdrawn"] = id;
  answer.json["recall"] = recall.size();
  answer.note = fmt::format("withdrawn; {} {} repaired with these constants",
                            counted(recall.size(), "file"), recall.size() == 1 ? "was" : "were");
  return answer;
}

Result<Answer> reinstate(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_to_add(options, context));
  SIXPOINT_ASSIGN(Answer answer, correct(store, options, "reinstate"));
  answer.note = "these constants apply again";
  return answer;
}

Result<Answer> prefer(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_to_add(options, context));
  SIXPOINT_ASSIGN(Answer answer, correct(store, options, "prefer"));
  answer.json["preferred"] = answer.json["about"]["id"];
  answer.note = "of the sets of this unit and filter, these constants apply now";
  return answer;
}

Result<Answer> note(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_to_add(options, context));
  SIXPOINT_ASSIGN(Answer answer, correct(store, options, "note"));
  answer.note = fmt::format("noted about {} {}", options.table, printable(options.id));
  return answer;
}

Result<Answer> recall(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  std::string id;
  if (!options.id.empty()) {
    SIXPOINT_ASSIGN(id, store.whole_key("constants", options.id));
  }
  SIXPOINT_ASSIGN(const auto entries, store.recall_list(id));
  Answer answer;
  Json& files = answer.json["files"] = Json::array();
  Columns table({"repaired", "again", "unit", "why its constants were withdrawn", "file"});
  for (const auto& entry : entries) {
    files.push_back(
        {{"input", entry.repair.input},
         {"serial", entry.repair.serial},
         {"repaired_at", to_iso8601(entry.repair.made_at)},
         {"input_sha256", entry.repair.input_sha256},
         {"output_sha256", entry.repair.output_sha256},
         {"method", entry.repair.method},
         {"constants", entry.repair.constants_id},
         {"software", entry.repair.software},
         {"withdrawn_at", to_iso8601(entry.withdrawn_at)},
         {"reason", entry.reason},
         {"repaired_again_at",
          entry.repaired_again_at ? Json(to_iso8601(*entry.repaired_again_at)) : Json(nullptr)}});
    table.row({local_time(entry.repair.made_at),
               entry.repaired_again_at ? local_time(*entry.repaired_again_at) : "no",
               entry.repair.serial, printable(entry.reason), printable(entry.repair.input)});
  }
  if (entries.empty()) {
    answer.note = "no file was repaired with constants that were withdrawn since";
  }
  answer.text = table.text();
  return answer;
}

Result<Answer> jig_units(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto units, store.units_of_jig(options.id));
  if (units.empty()) {
    return fail(ErrorCode::no_input,
                fmt::format("the store has no runs on a jig '{}'", printable(options.id, 60)), {},
                "give its name as '--jig-id' had it, or its serial number");
  }
  Answer answer;
  answer.json["jig"] = options.id;
  Json& list = answer.json["units"] = Json::array();
  Columns table({"unit", "runs", "last run", "verdict"});
  for (const auto& unit : units) {
    list.push_back({{"serial", unit.serial},
                    {"runs", unit.runs},
                    {"last_run", to_iso8601(unit.last_run)},
                    {"last_verdict", unit.last_verdict}});
    table.row(
        {unit.serial, std::to_string(unit.runs), local_time(unit.last_run), unit.last_verdict});
  }
  answer.text = table.text();
  return answer;
}

Result<Answer> yield(const StoreCommandOptions& options, Context& context) {
  const auto time_of = [](const std::string& text, const char* option,
                          UtcTime without) -> Result<UtcTime> {
    auto time = text.empty() ? without : parse_iso8601(text);
    if (!time) {
      return fail(ErrorCode::usage, time.error().what, option, time.error().hint);
    }
    return time;
  };
  SIXPOINT_ASSIGN(const UtcTime from, time_of(options.from, "--from", UtcTime::min()));
  SIXPOINT_ASSIGN(const UtcTime to, time_of(options.to, "--to", UtcTime::max()));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto report, store.yield(from, to));
  Answer answer;
  answer.json.update({{"runs", report.runs},
                      {"retests", report.retests},
                      {"units", report.units},
                      {"judged", report.judged},
                      {"passed", report.passed},
                      {"passed_first_time", report.passed_first_time},
                      {"yield", number(report.yield())},
                      {"first_pass_yield", number(report.first_pass_yield())}});
  answer.text = fmt::format(
      "{} in {} ({}), {} judged: {} passed; {} passed at their first judged run\n",
      counted(report.units, "unit"), counted(report.runs, "run"), counted(report.retests, "retest"),
      counted(report.judged, "unit"), report.passed, report.passed_first_time);
  return answer;
}

Result<Answer> due(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto units,
                  store.units_due(context.env.clock.now() - std::chrono::hours(24) * options.days));
  Answer answer;
  Json& list = answer.json["units"] = Json::array();
  Columns table({"unit", "type", "last constants"});
  for (const auto& unit : units) {
    list.push_back({{"serial", unit.serial},
                    {"model", unit.model},
                    {"last_constants", value_or_null(unit.last_constants)}});
    table.row(
        {unit.serial, unit.model, unit.last_constants ? local_time(*unit.last_constants) : "none"});
  }
  if (units.empty()) {
    answer.note = "no unit is due";
  }
  answer.text = table.text();
  return answer;
}

Result<Answer> trend(const StoreCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  const std::string serial = stored_serial(store, options.id);
  SIXPOINT_ASSIGN(const auto points, store.trend(serial));
  if (points.empty()) {
    return fail(ErrorCode::no_input, "the store has no constants of this unit", options.id,
                "'sixpoint units' lists the units in the store");
  }
  Answer answer;
  answer.json["serial"] = serial;
  Json& list = answer.json["points"] = Json::array();
  Columns table({"made", "filter", "method", "jig", "id", "verdict", "values"});
  for (const auto& point : points) {
    const Json constants = parse_json(point.constants.document);
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
    table.row({local_time(point.constants.made_at), point.constants.filter, point.constants.method,
               printable(point.jig), db::shown_id(point.constants.id),
               point.withdrawn ? "withdrawn" : point.verdict,
               list.back()["constants"].is_null() ? "" : constants_text(list.back()["constants"])});
  }
  answer.text = table.text();
  return answer;
}

Declared<StoreCommandOptions> add(CLI::App& parent, Context& context, const char* name,
                                  const char* about,
                                  Result<Answer> (*work)(const StoreCommandOptions&, Context&)) {
  const auto declared = add_command<StoreCommandOptions>(
      parent, context, "store", name, about,
      [work](const StoreCommandOptions& options, Context& here) -> Status {
        SIXPOINT_ASSIGN(const Answer answer, work(options, here));
        if (!answer.note.empty()) {
          here.people << answer.note << '\n';
        }
        return print_answer(here, options.json, answer.json, answer.text);
      });
  add_store_option(declared.command, declared.options.store);
  return declared;
}

// --why and --operator, for rows about other rows.
void add_correction_options(const Declared<StoreCommandOptions>& correction) {
  auto [command, options] = correction;
  command.add_option("--why,--reason", options.reason, "why, or what")->required();
  command.add_option("--operator", options.operator_name,
                     "who decides (default: the name under which you are logged in)");
}

}  // namespace

void add_store(CLI::App& app, Context& context) {
  CLI::App& group = add_group(app, "store", "move, save and ask the whole store");
  const auto sub = [&](const char* name, const char* about,
                       Result<Answer> (*work)(const StoreCommandOptions&, Context&)) {
    return add(group, context, name, about, work);
  };
  // Declares the first argument of a subcommand, or its -o.
  const auto with = [](Declared<StoreCommandOptions> declared, const char* name,
                       std::string StoreCommandOptions::*value, const char* about) {
    return declared.command.add_option(name, declared.options.*value, about);
  };
  auto out = sub("export", "write the whole store as JSON Lines or CSV", export_store);
  with(out, "-o,--output", &StoreCommandOptions::path, "the file; with --csv the folder")
      ->required();
  add_output_options(out.command, out.options.outputs);
  out.command.add_flag("--csv", out.options.csv, "one CSV file per table instead of JSON Lines");
  with(sub("import", "continue a store with the rows of an export", import_store), "file",
       &StoreCommandOptions::path, "what 'store export' wrote: JSON Lines")
      ->required();
  auto copy = sub("backup", "copy the store into an SQLite file while others work", back_up);
  with(copy, "-o,--output", &StoreCommandOptions::path, "the copy")->required();
  add_output_options(copy.command, copy.options.outputs);
  with(sub("catch-up", "store what the store did not take when it was measured", catch_up),
       "--journal", &StoreCommandOptions::journal,
       "the folder of a journal that was written elsewhere (default: this station's)");
  for (const auto& correction :
       {sub("withdraw", "constants apply no more; they stay in the history", withdraw),
        sub("reinstate", "withdrawn constants apply again", reinstate),
        sub("prefer", "of a unit's sets, these constants apply", prefer)}) {
    with(correction, "id", &StoreCommandOptions::id, "the constants' id ('sixpoint history')")
        ->required();
    add_correction_options(correction);
  }
  const auto noted = sub("note", "add what is wrong or missing in a row", note);
  with(noted, "table", &StoreCommandOptions::table,
       "the row's table: units, runs, constants, unit_writes, repairs ...")
      ->required();
  with(noted, "id", &StoreCommandOptions::id, "the row's id; of a unit its serial number")
      ->required();
  add_correction_options(noted);
  with(sub("recall", "files repaired with constants that were withdrawn", recall), "id",
       &StoreCommandOptions::id, "only these constants");
  with(sub("jig", "units that were on a jig", jig_units), "jig", &StoreCommandOptions::id,
       "the jig's name")
      ->required();
  const auto passed = sub("yield", "how many units passed, and how many at once", yield);
  with(passed, "--from", &StoreCommandOptions::from,
       "runs that started then or later (2027-03-31; UTC)");
  with(passed, "--to", &StoreCommandOptions::to, "runs that started before this time");
  auto old = sub("due", "units whose constants are old or missing", due);
  old.command.add_option("--days", old.options.days, "how old constants may be")
      ->check(CLI::Range(0, 100'000))
      ->capture_default_str();
  with(sub("trend", "all calibrations of one unit, for its control chart", trend), "serial",
       &StoreCommandOptions::id, "the unit's serial number")
      ->required();
}

}  // namespace sixpoint::cli

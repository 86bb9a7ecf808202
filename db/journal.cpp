#include "db/journal.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "db/hex.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "sixpoint/journal-entry/1";
// Captures of 100 MiB each in hex digits, and room for several.
constexpr std::uint64_t kLargestEntry = 1ULL << 30;

std::int64_t to_ns(UtcTime time) { return time.time_since_epoch().count(); }
// Throws for a number with a fraction or beyond 64 bits, which get() would convert at any price.
UtcTime time_of(const Json& json) {
  return UtcTime(std::chrono::nanoseconds(
      json.is_number_integer() ? json.get<std::int64_t>() : json.get_ref<const std::int64_t&>()));
}

template <class T>
Json optional_json(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json to_json(const ConstantsRecord& record, const std::string& model) {
  return {{"kind", "constants"},
          {"model", model},
          {"serial", record.serial},
          {"filter", record.filter},
          {"made_at_ns", to_ns(record.made_at)},
          {"method", record.method},
          {"run_id", record.run_id},
          {"document", record.document}};
}

Json to_json(const RunRecord& run, const std::vector<Capture>& captures) {
  Json json = {{"kind", "run"},
               {"serial", run.serial},
               {"model", run.model},
               {"run_kind", run.kind},
               {"filter", run.filter},
               {"started_ns", to_ns(run.started)},
               {"ended_ns", to_ns(run.ended)},
               {"operator", run.operator_name},
               {"station", run.station},
               {"jig", run.jig},
               {"verdict", run.verdict},
               {"software", run.software},
               {"retest_of", run.retest_of},
               {"document", run.document},
               {"jig_due_ns", run.jig_due ? Json(to_ns(*run.jig_due)) : Json(nullptr)},
               {"build", run.build},
               {"limits", run.limits},
               {"gravity_m_per_s2", optional_json(run.gravity_m_per_s2)},
               {"temperature_c", optional_json(run.temperature_c)},
               {"codes", run.codes}};
  Json& list = json["captures"] = Json::array();
  for (const Capture& capture : captures) {
    list.push_back({{"name", capture.name}, {"bytes", to_hex(capture.bytes)}});
  }
  return json;
}

Json to_json(const UnitWrite& write) {
  return {{"kind", "unit_write"},        {"run_id", write.run_id},
          {"serial", write.serial},      {"written_ns", to_ns(write.written)},
          {"as_found", write.as_found},  {"as_left", write.as_left},
          {"read_back", write.read_back}};
}

Json to_json(const RepairRecord& repair) {
  return {{"kind", "repair"},
          {"serial", repair.serial},
          {"made_at_ns", to_ns(repair.made_at)},
          {"input", repair.input},
          {"input_sha256", repair.input_sha256},
          {"output_sha256", repair.output_sha256},
          {"method", repair.method},
          {"constants_id", repair.constants_id},
          {"document", repair.document},
          {"software", repair.software}};
}

std::optional<double> number_or_nothing(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional(json.get<double>());
}

// nlohmann's exceptions for a missing or wrong member go to give().
Result<std::string> give_run(Store& store, const Json& entry) {
  RunRecord run;
  run.serial = entry.at("serial");
  run.model = entry.at("model");
  run.kind = entry.at("run_kind");
  run.filter = entry.at("filter");
  run.started = time_of(entry.at("started_ns"));
  run.ended = time_of(entry.at("ended_ns"));
  run.operator_name = entry.at("operator");
  run.station = entry.at("station");
  run.jig = entry.at("jig");
  run.verdict = entry.at("verdict");
  run.software = entry.at("software");
  run.retest_of = entry.at("retest_of");
  run.document = entry.at("document");
  if (!entry.at("jig_due_ns").is_null()) {
    run.jig_due = time_of(entry.at("jig_due_ns"));
  }
  run.build = entry.at("build");
  run.limits = entry.at("limits");
  run.gravity_m_per_s2 = number_or_nothing(entry.at("gravity_m_per_s2"));
  run.temperature_c = number_or_nothing(entry.at("temperature_c"));
  run.codes = entry.at("codes").get<std::vector<std::string>>();
  std::vector<Capture> captures;
  for (const Json& capture : entry.at("captures")) {
    SIXPOINT_ASSIGN(Bytes bytes, from_hex(capture.at("bytes").get_ref<const std::string&>()));
    captures.push_back({capture.at("name"), std::move(bytes)});
  }
  return store.add_run(run, captures);
}

Result<std::string> give(Store& store, const Json& entry) {
  try {
    const std::string kind = entry.at("kind");
    if (kind == "run") {
      return give_run(store, entry);
    }
    if (kind == "constants") {
      ConstantsRecord record;
      record.serial = entry.at("serial");
      record.filter = entry.at("filter");
      record.made_at = time_of(entry.at("made_at_ns"));
      record.method = entry.at("method");
      record.run_id = entry.at("run_id");
      record.document = entry.at("document");
      return store.add_constants(record, entry.at("model"));
    }
    if (kind == "unit_write") {
      return store.add_unit_write({entry.at("run_id"), entry.at("serial"),
                                   time_of(entry.at("written_ns")), entry.at("as_found"),
                                   entry.at("as_left"), entry.at("read_back")});
    }
    if (kind == "repair") {
      return store.add_repair(
          {"", entry.at("serial"), time_of(entry.at("made_at_ns")), entry.at("input"),
           entry.at("input_sha256"), entry.at("output_sha256"), entry.at("method"),
           entry.at("constants_id"), entry.at("document"), entry.at("software")});
    }
  } catch (const Json::exception&) {
    // Falls through: what is missing makes no difference to the reader.
  }
  return fail(ErrorCode::bad_data, "the entry is not what this program writes");
}

std::uint64_t number_of(const std::string& name) {
  std::uint64_t number = 0;
  for (const char c : name) {
    if (c < '0' || c > '9') {
      break;
    }
    number = number * 10 + static_cast<std::uint64_t>(c - '0');
  }
  return number;
}

}  // namespace

Result<Journal> Journal::open(FileSystem& files, const std::string& folder) {
  SIXPOINT_CHECK(files.make_folders(folder));
  return Journal(files, folder);
}

Result<std::vector<std::string>> Journal::entries() {
  SIXPOINT_ASSIGN(auto names, files_->list(folder_));
  // Temporary files of writers begin with a dot.
  std::erase_if(names, [](const std::string& name) {
    return name.starts_with('.') || !name.ends_with(".json");
  });
  std::sort(names.begin(), names.end());
  return names;
}

Result<std::size_t> Journal::pending() {
  SIXPOINT_ASSIGN(const auto names, entries());
  return names.size();
}

Result<std::string> Journal::append(const std::string& id, const Json& entry) {
  SIXPOINT_ASSIGN(const auto names, entries());
  const std::uint64_t number = names.empty() ? 1 : number_of(names.back()) + 1;
  std::string line;
  try {
    const std::string record = entry.dump();
    line =
        Json{{"schema", kFormat},
             {"sha256", to_hex(sha256(std::span(
                            reinterpret_cast<const std::uint8_t*>(record.data()), record.size())))},
             {"record", record}}
            .dump();
  } catch (const Json::exception&) {
    return fail(ErrorCode::bad_data, "a text of the record is no UTF-8", folder_,
                "please report this");
  }
  SIXPOINT_CHECK(
      write_file(*files_, fmt::format("{}/{:010}-{}.json", folder_, number, id), line + "\n"));
  return id;
}

Result<std::string> Journal::add_constants(const ConstantsRecord& record,
                                           const std::string& model) {
  SIXPOINT_ASSIGN(const std::string id, id_of(record));
  return append(id, to_json(record, model));
}

Result<std::string> Journal::add_run(const RunRecord& run, const std::vector<Capture>& captures) {
  SIXPOINT_ASSIGN(const std::string id, id_of(run, captures));
  return append(id, to_json(run, captures));
}

Result<std::string> Journal::add_unit_write(const UnitWrite& write) {
  SIXPOINT_ASSIGN(const std::string id, id_of(write));
  return append(id, to_json(write));
}

Result<std::string> Journal::add_repair(const RepairRecord& repair) {
  SIXPOINT_ASSIGN(const std::string id, id_of(repair));
  RepairRecord kept = repair;
  kept.input = storable_path(repair.input);
  return append(id, to_json(kept));
}

Result<std::size_t> Journal::catch_up(Store& store) {
  SIXPOINT_ASSIGN(const auto names, entries());
  std::size_t taken = 0;
  for (const std::string& name : names) {
    const std::string path = folder_ + "/" + name;
    const auto bytes = read_file(*files_, path, kLargestEntry);
    if (!bytes && bytes.error().code == ErrorCode::no_input) {
      continue;  // another program gave it to the store meanwhile
    }
    SIXPOINT_CHECK(bytes);
    const Json line = Json::parse(bytes->begin(), bytes->end(), nullptr, false);
    const bool whole = line.is_object() && line.contains("record") && line["record"].is_string() &&
                       line.contains("sha256");
    const std::string record = whole ? line["record"].get<std::string>() : "";
    if (!whole || line["sha256"] !=
                      to_hex(sha256(std::span(reinterpret_cast<const std::uint8_t*>(record.data()),
                                              record.size())))) {
      return fail(ErrorCode::bad_data, "the journal's entry is damaged", path,
                  "keep the file, move it out of the folder, and store the rest again");
    }
    auto given = give(store, Json::parse(record, nullptr, false));
    if (!given) {
      Error error = std::move(given).error();
      if (error.code == ErrorCode::bad_data) {
        error.where = path;
        error.hint = "the store does not take this entry: move it out of the folder and look at it";
      }
      return fail(std::move(error));
    }
    // Removed by another program in this moment: just as well.
    if (Status removed = files_->remove(path); !removed && files_->info(path)) {
      return fail(std::move(removed).error());
    }
    SIXPOINT_CHECK(files_->sync_folder(folder_));
    ++taken;
  }
  return taken;
}

}  // namespace sixpoint::db

#include "db/journal.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/json_text.h"
#include "db/export_json.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kEntryFormat = "sixpoint/journal-entry/2";
// Captures of 100 MiB each in hex digits, and room for several.
constexpr std::uint64_t kLargestEntry = 1ULL << 30;

Json to_json(const NewRows& rows) {
  Json json = {{"id", rows.id}, {"rows", Json::array()}, {"attachments", Json::array()}};
  for (const auto& [table, row] : rows.rows) {
    json["rows"].push_back({{"table", table->name}, {"row", row_to_json(*table, row)}});
  }
  for (const auto& [name, bytes] : rows.attachments) {
    json["attachments"].push_back(attachment_to_json(name, bytes));
  }
  return json;
}

tl::unexpected<Error> not_ours() {
  return fail(ErrorCode::bad_data, "the entry is not what this program writes");
}

// Each row is made again from its columns, so that it is checked like any other new row. The
// exceptions of nlohmann for a missing or wrong member go to rows_from().
Result<NewRows> rows_of_entry(const Json& entry) {
  NewRows rows{entry.at("id").get<std::string>()};
  for (const Json& line : entry.at("rows")) {
    const Table* table = find_table(line.at("table").get<std::string>());
    if (table == nullptr) {
      return not_ours();
    }
    SIXPOINT_ASSIGN(Row row, row_from_json(*table, line.at("row")));
    Row columns = row;
    if (table->columns[0].name == "id") {
      columns.erase(columns.begin());
    }
    SIXPOINT_ASSIGN(const Row checked, new_row(*table, std::move(columns)));
    if (checked != row) {
      return not_ours();
    }
    rows.rows.emplace_back(table, std::move(row));
  }
  for (const Json& line : entry.at("attachments")) {
    SIXPOINT_ASSIGN(auto attachment, attachment_from_json(line));
    rows.attachments.push_back(std::move(attachment));
  }
  return rows;
}

// The record of an entry of version 1, whose keys are the columns of its table but for "run_kind".
template <class Record>
Result<Record> version_1_record(const Json& entry) {
  const Table& from = table(Record::kTable);
  Json row = {{"id", ""}};
  for (const Column& column : from.columns) {
    const std::string name(column.name);
    const auto value = entry.find(name == "kind" ? "run_kind" : name);
    if (value != entry.end()) {
      // Numbers that are measured, and lists, are JSON texts in the store.
      const bool as_text =
          column.type == ColumnType::text && !value->is_string() && !value->is_null();
      row[name] = as_text ? Json(value->dump()) : *value;
    }
  }
  SIXPOINT_ASSIGN(const Row columns, row_from_json(from, row));
  return record_of<Record>(columns);
}

Result<NewRows> rows_of_version_1(const Json& entry) {
  const std::string kind = entry.at("kind");
  if (kind == "constants") {
    SIXPOINT_ASSIGN(const auto record, version_1_record<ConstantsRecord>(entry));
    return rows_of(record, entry.at("model").get<std::string>());
  }
  if (kind == "run") {
    SIXPOINT_ASSIGN(auto run, version_1_record<RunRecord>(entry));
    run.model = entry.at("model");
    std::vector<Capture> captures;
    for (const Json& capture : entry.at("captures")) {
      auto bytes = from_hex(capture.at("bytes").get_ref<const std::string&>());
      if (!bytes) {
        return not_ours();
      }
      captures.push_back({capture.at("name"), *std::move(bytes)});
    }
    return rows_of(run, captures);
  }
  if (kind == "unit_write") {
    SIXPOINT_ASSIGN(const auto write, version_1_record<UnitWrite>(entry));
    return rows_of(write);
  }
  if (kind == "repair") {
    SIXPOINT_ASSIGN(const auto repair, version_1_record<RepairRecord>(entry));
    return rows_of(repair);
  }
  return not_ours();
}

Result<NewRows> rows_from(const std::string& record) {
  const Json entry = parse_json(record);
  try {
    return entry.contains("kind") ? rows_of_version_1(entry) : rows_of_entry(entry);
  } catch (const Json::exception&) {
    return not_ours();
  }
}

}  // namespace

Result<Journal> Journal::open(FileSystem& files, const std::string& folder) {
  SIXPOINT_CHECK(make_private_folders(files, folder));
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
  return entries().map([](const auto& names) { return names.size(); });
}

Result<bool> Journal::holds(FileSystem& files, const std::string& folder, const std::string& id) {
  if (!files.info(folder)) {
    return false;
  }
  SIXPOINT_ASSIGN(const auto names, Journal(files, folder).entries());
  return std::any_of(names.begin(), names.end(), [ending = "-" + id + ".json"](const auto& name) {
    return name.ends_with(ending);
  });
}

Result<std::string> Journal::add(NewRows rows) {
  SIXPOINT_ASSIGN(const auto names, entries());
  std::uint64_t last = 0;
  for (const std::string& name : names) {  // a person may have renamed one: it may sort last
    std::uint64_t number = 0;
    std::from_chars(name.data(), name.data() + name.size(), number);
    last = std::max(last, number);
  }
  const std::string record = to_json(rows).dump();
  const Json line = {{"schema", kEntryFormat}, {"sha256", text_sha256(record)}, {"record", record}};
  SIXPOINT_CHECK(write_private_file(
      *files_, fmt::format("{}/{:010}-{}.json", folder_, last + 1, rows.id), line.dump() + "\n"));
  return std::move(rows.id);
}

Status Journal::give(const std::string& path, const Bytes& entry, Store& store) {
  const Json line = parse_json(as_text(entry));
  const bool whole = line.is_object() && line.contains("record") && line["record"].is_string() &&
                     line.contains("sha256");
  const std::string record = whole ? line["record"].get<std::string>() : "";
  if (!whole || line["sha256"] != text_sha256(record)) {
    return fail(ErrorCode::bad_data, "the journal's entry is damaged", path,
                "move the file out of the folder, do not delete it, and store the rest again");
  }
  auto given = rows_from(record).and_then([&](NewRows rows) { return store.add(std::move(rows)); });
  if (!given) {
    Error error = std::move(given).error();
    if (error.code == ErrorCode::bad_data) {
      error.where = path;
      error.hint = "the store does not take this entry: move it out of the folder and read it";
    }
    return fail(std::move(error));
  }
  // Where another program removed it in this moment, it is done too.
  if (Status removed = files_->remove(path); !removed && files_->info(path)) {
    return removed;
  }
  return files_->sync_folder(folder_);
}

Result<std::size_t> Journal::catch_up(Store& store) {
  SIXPOINT_ASSIGN(const auto names, entries());
  std::size_t taken = 0;
  for (const std::string& name : names) {
    const std::string path = folder_ + "/" + name;
    const auto bytes = read_file(*files_, path, kLargestEntry);
    if (!bytes && bytes.error().code == ErrorCode::no_input && !files_->info(path)) {
      continue;  // another program gave it to the store meanwhile
    }
    SIXPOINT_CHECK(bytes);
    SIXPOINT_CHECK(give(path, *bytes, store));
    ++taken;
  }
  return taken;
}

}  // namespace sixpoint::db

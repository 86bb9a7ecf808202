#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/csv_field.h"
#include "db/exchange.h"
#include "db/export_json.h"
#include "db/history.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWrittenAtOnce = 1U << 20;

// Appends to an AtomicFile in large pieces.
class BufferedFile {
 public:
  static Result<BufferedFile> create(FileSystem& files, const std::string& path) {
    SIXPOINT_ASSIGN(auto file, AtomicFile::create(files, path));
    return BufferedFile(std::move(file));
  }
  Status append(std::string_view text) {
    buffer_ += text;
    return buffer_.size() < kWrittenAtOnce ? Status() : flush();
  }
  Status commit() {
    SIXPOINT_CHECK(flush());
    return file_.commit();
  }

 private:
  explicit BufferedFile(AtomicFile file) : file_(std::move(file)) {}
  Status flush() {
    SIXPOINT_CHECK(file_.append(buffer_));
    buffer_.clear();
    return {};
  }
  AtomicFile file_;
  std::string buffer_;
};

Json header_of(const Head& head) {
  return to_json(ExportHeader{kSchemaVersion, head.rows, to_hex(head.hash)});
}

std::string row_line(const HistoryRow& row) {
  Json line;
  line["seq"] = row.seq;
  line["table"] = std::string(row.table->name);
  line["row"] = row_to_json(*row.table, row.columns);
  line["hash"] = to_hex(row.hash);
  try {
    return line.dump();
  } catch (const Json::type_error&) {
    line["row"] = row_to_json(*row.table, row.columns, TextForm::hex);
    return line.dump();
  }
}

// One field of a CSV file (RFC 4180), with one addition that spreadsheets do not mind: an empty
// field is NULL, "" is an empty text.
std::string field(const Value& value) {
  if (const auto* integer = std::get_if<std::int64_t>(&value)) {
    return std::to_string(*integer);
  }
  const auto* text = std::get_if<std::string>(&value);
  if (text == nullptr) {
    return "";
  }
  return text->empty() ? "\"\"" : csv_field(*text);
}

Status export_table(Database& database, FileSystem& files, const Table& table,
                    const std::string& path, ExchangeReport& report) {
  SIXPOINT_ASSIGN(auto out, BufferedFile::create(files, path));
  std::string names = column_list(table);
  std::erase(names, ' ');
  SIXPOINT_CHECK(out.append(names + "\r\n"));
  SIXPOINT_ASSIGN(const auto rows, all_rows(database, table));
  SIXPOINT_CHECK(for_each_row(*rows, [&](const Row& row) {
    ++report.rows;
    std::string line;
    for (std::size_t i = 0; i + 1 < row.size(); ++i) {
      line += field(row[i]) + ",";
    }
    const auto* hash = std::get_if<Bytes>(&row.back());
    return out.append(line + (hash == nullptr ? "" : to_hex(*hash)) + "\r\n");
  }));
  return out.commit();
}

}  // namespace

std::string ExchangeReport::brief() const {
  return fmt::format("{} rows, {} attachments, head {}", rows, attachments, head);
}

Json ExchangeReport::to_json() const {
  return {{"rows", rows}, {"added", added}, {"attachments", attachments}, {"head", head}};
}

Result<ExchangeReport> export_json_lines(Store& store, FileSystem& files, const std::string& path) {
  Database& database = store.database();
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(database));
  SIXPOINT_ASSIGN(const Head head, read_head(database));
  SIXPOINT_ASSIGN(auto out, BufferedFile::create(files, path));
  ExchangeReport report;
  report.head = to_hex(head.hash);
  SIXPOINT_CHECK(out.append(header_of(head).dump() + "\n"));
  SIXPOINT_CHECK(for_each_attachment(database, [&](const std::string& name, const Bytes& bytes) {
    ++report.attachments;
    return out.append(attachment_to_json(name, bytes).dump() + "\n");
  }));
  SIXPOINT_CHECK(for_each_history_row(database, [&](const HistoryRow& row) {
    ++report.rows;
    return out.append(row_line(row) + "\n");
  }));
  if (report.rows != head.rows) {
    return fail(ErrorCode::bad_data,
                fmt::format("the store should have {} rows and has {}", head.rows, report.rows),
                database.location(), "'sixpoint audit verify' says which are missing");
  }
  SIXPOINT_CHECK(out.commit());
  return report;
}

Result<ExchangeReport> export_csv(Store& store, FileSystem& files, const std::string& folder) {
  Database& database = store.database();
  SIXPOINT_CHECK(make_synced_folders(files, folder + "/attachments"));
  // Written last: a folder without it is no whole export.
  const std::string header_path = folder + "/store.json";
  if (files.info(header_path)) {
    SIXPOINT_CHECK(files.remove(header_path));
    SIXPOINT_CHECK(files.sync_folder(folder));
  }
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(database));
  SIXPOINT_ASSIGN(const Head head, read_head(database));
  ExchangeReport report;
  report.head = to_hex(head.hash);
  for (const Table& table : tables()) {
    SIXPOINT_CHECK(
        export_table(database, files, table, fmt::format("{}/{}.csv", folder, table.name), report));
  }
  SIXPOINT_CHECK(
      for_each_attachment(database, [&](const std::string& name, const Bytes& bytes) -> Status {
        // The name becomes a path: it must be the digest that it claims to be.
        if (to_hex(sha256(bytes)) != name) {
          return fail(ErrorCode::bad_data,
                      fmt::format("attachment {} was changed", printable(name, 70)),
                      database.location(), "'sixpoint audit verify' lists what was changed");
        }
        ++report.attachments;
        return write_file(files, folder + "/attachments/" + name, as_text(bytes));
      }));
  SIXPOINT_CHECK(write_file(files, header_path, header_of(head).dump(2) + "\n"));
  return report;
}

}  // namespace sixpoint::db

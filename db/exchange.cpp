#include "db/exchange.h"

#include <algorithm>
#include <charconv>
#include <functional>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "db/csv.h"
#include "db/hex.h"
#include "db/history.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kCsvHeader = "store.json";
constexpr std::string_view kFormat = "sixpoint/store-export/1";
// The largest capture of store.cpp in hex digits, and its name.
constexpr std::size_t kLongestLine = 256U << 20;
constexpr std::size_t kChunk = 1U << 20;

// Appends to an AtomicFile in large pieces.
class BufferedFile {
 public:
  static Result<BufferedFile> create(FileSystem& files, const std::string& path) {
    SIXPOINT_ASSIGN(auto file, AtomicFile::create(files, path));
    return BufferedFile(std::move(file));
  }
  Status append(std::string_view text) {
    buffer_ += text;
    return buffer_.size() < kChunk ? Status() : flush();
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

// Lines of a file, however long the file is.
class LineReader {
 public:
  static Result<LineReader> open(FileSystem& files, const std::string& path) {
    SIXPOINT_ASSIGN(auto file, files.open(path));
    return LineReader(std::move(file), path);
  }
  // False at the end. The last line may lack its line end.
  Result<bool> next(std::string_view& line) {
    buffer_.erase(0, used_);
    used_ = 0;
    std::size_t searched = 0;
    while (true) {
      const std::size_t end = buffer_.find('\n', searched);
      if (end != std::string::npos) {
        used_ = end + 1;
        line = std::string_view(buffer_).substr(0, end);
        ++number_;
        return true;
      }
      searched = buffer_.size();
      if (searched > kLongestLine) {
        return fail(ErrorCode::bad_data, fmt::format("line {} is too long", number_ + 1), path_,
                    "this is no export of a store");
      }
      buffer_.resize(searched + kChunk);
      SIXPOINT_ASSIGN(
          const std::size_t count,
          file_->read_at(
              offset_,
              std::span(reinterpret_cast<std::uint8_t*>(buffer_.data()) + searched, kChunk)));
      buffer_.resize(searched + count);
      offset_ += count;
      if (count == 0) {
        used_ = buffer_.size();
        line = buffer_;
        ++number_;
        return !line.empty();
      }
    }
  }
  std::int64_t number() const { return number_; }

 private:
  LineReader(std::unique_ptr<ReadableFile> file, std::string path)
      : file_(std::move(file)), path_(std::move(path)) {}
  std::unique_ptr<ReadableFile> file_;
  std::string path_;
  std::string buffer_;
  std::size_t used_ = 0;
  std::uint64_t offset_ = 0;
  std::int64_t number_ = 0;
};

Result<Bytes> bytes_of(const Json& json) {
  return from_hex(json.is_string() ? std::string_view(json.get_ref<const std::string&>())
                                   : std::string_view("?"));
}

// Text that is no UTF-8 (early versions kept file names as they were) becomes {"bytes": hex}.
Json to_json(const Value& value) {
  if (const auto* integer = std::get_if<std::int64_t>(&value)) {
    return *integer;
  }
  if (const auto* text = std::get_if<std::string>(&value)) {
    return *text;
  }
  return nullptr;
}

std::string row_line(const HistoryRow& row) {
  Json line;
  line["seq"] = row.seq;
  line["table"] = std::string(row.table->name);
  Json& columns = line["row"] = Json::object();
  for (std::size_t i = 0; i < row.columns.size(); ++i) {
    columns[std::string(row.table->columns[i].name)] = to_json(row.columns[i]);
  }
  line["hash"] = to_hex(row.hash);
  try {
    return line.dump();
  } catch (const Json::type_error&) {
    for (std::size_t i = 0; i < row.columns.size(); ++i) {
      if (const auto* text = std::get_if<std::string>(&row.columns[i])) {
        columns[std::string(row.table->columns[i].name)] = {
            {"bytes",
             to_hex(std::span(reinterpret_cast<const std::uint8_t*>(text->data()), text->size()))}};
      }
    }
    return line.dump();
  }
}

Result<Value> to_value(const Json& json, const Column& column) {
  if (json.is_null() && !column.required) {
    return Value();
  }
  if (column.type == ColumnType::integer && json.is_number_integer() &&
      !(json.is_number_unsigned() && json.get<std::uint64_t>() > INT64_MAX)) {
    return Value(json.get<std::int64_t>());
  }
  if (column.type == ColumnType::text && json.is_string()) {
    return Value(json.get<std::string>());
  }
  if (column.type == ColumnType::text && json.is_object() && json.contains("bytes")) {
    SIXPOINT_ASSIGN(const Bytes bytes, bytes_of(json["bytes"]));
    return Value(std::string(bytes.begin(), bytes.end()));
  }
  return fail(ErrorCode::bad_data, fmt::format("the column {} has no such value", column.name), {},
              "export again");
}

// One line, without trusting it: at most four levels deep.
Result<Json> parse_line(std::string_view text) {
  bool too_deep = false;
  Json json = Json::parse(
      text,
      [&](int depth, Json::parse_event_t /*event*/, Json& /*parsed*/) {
        too_deep = too_deep || depth > 4;
        return depth <= 4;
      },
      false);
  if (json.is_discarded() || !json.is_object() || too_deep) {
    return fail(ErrorCode::bad_data, "the line is no JSON object of an export", {}, "export again");
  }
  return json;
}

struct ImportedRow {
  const Table* table = nullptr;
  std::int64_t seq = 0;
  Row columns;
  Bytes hash;
  HistoryRow view() const { return {table, seq, columns, hash}; }
};

Result<ImportedRow> to_row(const Json& line) {
  const auto bad = [](std::string what) {
    return fail(ErrorCode::bad_data, std::move(what), {}, "export again");
  };
  if (!line.contains("seq") || !line["seq"].is_number_integer() || !line.contains("table") ||
      !line["table"].is_string() || !line.contains("row") || !line["row"].is_object() ||
      !line.contains("hash")) {
    return bad("the line is neither a row nor an attachment");
  }
  ImportedRow row;
  row.seq = line["seq"].get<std::int64_t>();
  row.table = find_table(line["table"].get<std::string>());
  if (row.table == nullptr) {
    return bad(fmt::format("row {} is of a table that this program does not know", row.seq));
  }
  const Json& columns = line["row"];
  std::size_t known = 0;
  for (const Column& column : row.table->columns) {
    const std::string name(column.name);
    known += columns.contains(name) ? 1 : 0;
    auto value = to_value(columns.contains(name) ? columns[name] : Json(nullptr), column);
    if (!value) {
      return bad(fmt::format("row {} ({}): {}", row.seq, row.table->name, value.error().what));
    }
    row.columns.push_back(*std::move(value));
  }
  if (known != columns.size()) {
    return bad(fmt::format("row {} ({}) has columns that this program does not know", row.seq,
                           row.table->name));
  }
  SIXPOINT_ASSIGN(row.hash, bytes_of(line["hash"]));
  return row;
}

// The row must be what the store has in its place.
Status check_same(Database& database, const ImportedRow& row) {
  const std::vector<Value> seq = {row.seq};
  SIXPOINT_ASSIGN(const auto there,
                  database.query(fmt::format("SELECT {} FROM {} WHERE seq = $1",
                                             column_list(*row.table), row.table->name),
                                 seq));
  bool same = there.size() == 1;
  if (same) {
    const Row& stored = there[0];
    same = std::equal(row.columns.begin(), row.columns.end(), stored.begin() + 1) &&
           stored.back() == Value(row.hash);
  }
  if (!same) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("{} is not what the store has in its place: the file comes from another "
                    "store, or one of the two was changed",
                    name_of(row.view())),
        {}, "import it into a new store, and run 'audit verify' on both");
  }
  return {};
}

struct Header {
  std::int64_t store_version = 0;
  std::int64_t rows = 0;
  std::string head;
};

Json header_of(const Head& head) {
  return {{"schema", kFormat},
          {"store_version", kSchemaVersion},
          {"rows", head.rows},
          {"head", to_hex(head.hash)}};
}

Result<Header> to_header(const Json& line) {
  if (!line.contains("schema") || line["schema"] != kFormat || !line.contains("store_version") ||
      !line["store_version"].is_number_integer() || !line.contains("rows") ||
      !line["rows"].is_number_integer() || !line.contains("head") || !line["head"].is_string()) {
    return fail(ErrorCode::bad_data, "the first line is not that of a store's export", {},
                "make the file with 'sixpoint store export'");
  }
  if (line["store_version"].get<std::int64_t>() > kSchemaVersion) {
    return fail(
        ErrorCode::configuration,
        fmt::format("the file is of a store of version {}, this program knows versions up to "
                    "{}",
                    line["store_version"].get<std::int64_t>(), kSchemaVersion),
        {}, "use the sixpoint that made it, or a newer one");
  }
  return Header{line["store_version"].get<std::int64_t>(), line["rows"].get<std::int64_t>(),
                line["head"].get<std::string>()};
}

Status import_attachment(HistoryWriter& writer, const Json& line, ExchangeReport& report) {
  const Json& name = line["attachment"];
  SIXPOINT_ASSIGN(Bytes bytes, bytes_of(line.contains("bytes") ? line["bytes"] : Json(nullptr)));
  if (!name.is_string() || to_hex(sha256(bytes)) != name.get_ref<const std::string&>()) {
    return fail(ErrorCode::bad_data,
                fmt::format("the attachment {} is not what its name says",
                            name.is_string() ? printable(name.get<std::string>(), 64) : "?"),
                {}, "export again");
  }
  ++report.attachments;
  return writer.add_attachment(name.get<std::string>(), std::move(bytes));
}

Status copy_rows(Database& from, Database& to, ExchangeReport& report) {
  SIXPOINT_ASSIGN(const auto reading, Transaction::reading(from));
  SIXPOINT_ASSIGN(auto writing, Transaction::writing(to));
  SIXPOINT_ASSIGN(auto writer, HistoryWriter::open(to));
  SIXPOINT_CHECK(for_each_attachment(from, [&](const std::string& name, const Bytes& bytes) {
    ++report.attachments;
    return writer.add_attachment(name, bytes);
  }));
  SIXPOINT_ASSIGN(auto history, HistoryReader::open(from));
  HistoryRow row;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, history.next(row));
    if (!more) {
      break;
    }
    SIXPOINT_CHECK(writer.append_copy(row));
  }
  SIXPOINT_CHECK(writer.finish());
  return writing.commit();
}

std::string field_of(const Value& value) {
  if (const auto* integer = std::get_if<std::int64_t>(&value)) {
    return std::to_string(*integer);
  }
  const auto* text = std::get_if<std::string>(&value);
  return csv_field(text == nullptr ? std::nullopt : std::optional(*text));
}

// A table's CSV file, read in the order of its rows.
class CsvTable {
 public:
  static Result<CsvTable> open(FileSystem& files, const std::string& folder, const Table& table) {
    const std::string path = fmt::format("{}/{}.csv", folder, table.name);
    SIXPOINT_ASSIGN(auto reader, CsvReader::open(files, path));
    CsvTable made(std::move(reader), table);
    SIXPOINT_ASSIGN(const bool any, made.reader_.next(made.record_));
    if (!any || made.record_.size() < 2 || made.record_.front() != "seq" ||
        made.record_.back() != "hash") {
      return made.bad("the first line does not name the columns seq ... hash");
    }
    for (std::size_t i = 1; i + 1 < made.record_.size(); ++i) {
      const std::string name = made.record_[i].value_or("");
      const auto found = std::find_if(table.columns.begin(), table.columns.end(),
                                      [&](const Column& column) { return column.name == name; });
      const auto index = static_cast<std::size_t>(found - table.columns.begin());
      if (found == table.columns.end() ||
          std::find(made.columns_.begin(), made.columns_.end(), index) != made.columns_.end()) {
        return made.bad(fmt::format("the column '{}' is not known here", printable(name, 60)));
      }
      made.columns_.push_back(index);
    }
    SIXPOINT_CHECK(made.advance());
    return made;
  }

  bool at_end() const { return !more_; }
  const ImportedRow& row() const { return row_; }
  Status advance() {
    SIXPOINT_ASSIGN(more_, reader_.next(record_));
    return more_ ? convert() : Status();
  }
  std::string where() const {
    return fmt::format("{}, record {}", reader_.path(), reader_.number());
  }

 private:
  CsvTable(CsvReader reader, const Table& table) : reader_(std::move(reader)) {
    row_.table = &table;
  }
  tl::unexpected<Error> bad(std::string what) const {
    return fail(ErrorCode::bad_data, std::move(what), where(), "export again");
  }
  static std::optional<std::int64_t> integer_in(const std::string& text) {
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size() && !text.empty()
               ? std::optional(number)
               : std::nullopt;
  }
  Status convert() {
    if (record_.size() != columns_.size() + 2) {
      return bad(
          fmt::format("the record has {} fields, not {}", record_.size(), columns_.size() + 2));
    }
    const auto seq = integer_in(record_.front().value_or(""));
    if (!seq) {
      return bad("seq is no number");
    }
    row_.seq = *seq;
    row_.columns.assign(row_.table->columns.size(), Value());
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const auto& text = record_[i + 1];
      Value& value = row_.columns[columns_[i]];
      if (text && row_.table->columns[columns_[i]].type == ColumnType::integer) {
        const auto number = integer_in(*text);
        if (!number) {
          return bad(fmt::format("'{}' is no number", printable(*text, 60)));
        }
        value = *number;
      } else if (text) {
        value = *text;
      }
    }
    for (std::size_t i = 0; i < row_.columns.size(); ++i) {
      if (row_.table->columns[i].required &&
          std::holds_alternative<std::monostate>(row_.columns[i])) {
        return bad(fmt::format("the column {} is empty", row_.table->columns[i].name));
      }
    }
    auto hash = from_hex(record_.back().value_or("?"));
    if (!hash) {
      return bad("hash is no hash");
    }
    row_.hash = *std::move(hash);
    return {};
  }

  CsvReader reader_;
  CsvRecord record_;
  std::vector<std::size_t> columns_;  // of the table, in the order of the file
  ImportedRow row_;
  bool more_ = false;
};

Status import_attachment_files(FileSystem& files, const std::string& folder, HistoryWriter& writer,
                               ExchangeReport& report) {
  const std::string place = folder + "/attachments";
  if (!files.info(place)) {
    return {};  // missing ones are found by the rows that name them
  }
  SIXPOINT_ASSIGN(const auto names, files.list(place));
  for (const std::string& name : names) {
    const std::string path = fmt::format("{}/{}", place, name);
    SIXPOINT_ASSIGN(Bytes bytes, read_file(files, path, kLongestLine / 2));
    if (to_hex(sha256(bytes)) != name) {
      return fail(ErrorCode::bad_data, "the attachment is not what its name says", path,
                  "export again");
    }
    ++report.attachments;
    SIXPOINT_CHECK(writer.add_attachment(name, std::move(bytes)));
  }
  return {};
}

// Makes `path` a store that `fill` filled, whole or not at all: under another name first.
Result<ExchangeReport> make_store_file(
    Env& env, const std::string& path,
    const std::function<Result<ExchangeReport>(const std::string& temporary)>& fill) {
  const std::string temporary = fmt::format("{}/.{}.tmp", folder_of(path), file_name_of(path));
  const auto remove = [&] {
    for (const char* suffix : {"", "-journal", "-wal", "-shm"}) {
      if (env.files.info(temporary + suffix)) {
        static_cast<void>(env.files.remove(temporary + suffix));
      }
    }
  };
  remove();
  // Afterwards the store is closed: SQLite has synced it and removed its own files beside it.
  auto report = fill(temporary);
  if (!report) {
    remove();
    return report;
  }
  if (Status placed = env.files.rename(temporary, path); !placed) {
    remove();
    return fail(std::move(placed).error());
  }
  SIXPOINT_CHECK(env.files.sync_folder(folder_of(path)));
  return report;
}

// Continues `database` by `rows(importer)`, in one transaction.
class Importer {
 public:
  Importer(Database& database, HistoryWriter& writer) : database_(database), writer_(writer) {}
  Status add(const ImportedRow& row) {
    ++report_.rows;
    if (row.seq != report_.rows) {
      return fail(ErrorCode::bad_data,
                  fmt::format("{} stands where row {} should", name_of(row.view()), report_.rows),
                  {}, "rows are missing or out of order: export again");
    }
    if (row.seq <= writer_.head().rows) {
      return check_same(database_, row);
    }
    ++report_.added;
    return writer_.append_copy(row.view());
  }
  HistoryWriter& writer() { return writer_; }
  ExchangeReport& report() { return report_; }

 private:
  Database& database_;
  HistoryWriter& writer_;
  ExchangeReport report_;
};

Result<ExchangeReport> import_rows(Database& database, const Header& header,
                                   const std::function<Status(Importer&)>& rows) {
  SIXPOINT_ASSIGN(auto transaction, Transaction::writing(database));
  SIXPOINT_ASSIGN(auto writer, HistoryWriter::open(database));
  const std::int64_t before = writer.head().rows;
  Importer importer(database, writer);
  SIXPOINT_CHECK(rows(importer));
  ExchangeReport report = importer.report();
  if (report.rows != header.rows) {
    return fail(ErrorCode::bad_data,
                fmt::format("the file ends after row {} of {}", report.rows, header.rows), {},
                "it was cut off: copy it again, or export again");
  }
  report.head = to_hex(writer.head().hash);
  if (report.rows >= before && report.head != header.head) {
    return fail(ErrorCode::bad_data,
                fmt::format("the head that the file names does not belong to row {}", report.rows),
                {}, "export again");
  }
  if (report.added > 0 || report.attachments > 0) {
    SIXPOINT_CHECK(writer.finish());
    SIXPOINT_CHECK(transaction.commit());
  }
  return report;
}

Status import_line(Importer& importer, std::string_view text) {
  SIXPOINT_ASSIGN(const Json line, parse_line(text));
  if (line.contains("attachment")) {
    return import_attachment(importer.writer(), line, importer.report());
  }
  SIXPOINT_ASSIGN(const ImportedRow row, to_row(line));
  return importer.add(row);
}

}  // namespace

std::string ExchangeReport::brief() const {
  return fmt::format("{} rows, {} attachments, head {}", rows, attachments, head);
}

nlohmann::ordered_json ExchangeReport::to_json() const {
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
    return out.append(
        fmt::format("{}\n", Json{{"attachment", name}, {"bytes", to_hex(bytes)}}.dump()));
  }));
  SIXPOINT_ASSIGN(auto history, HistoryReader::open(database));
  HistoryRow row;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, history.next(row));
    if (!more) {
      break;
    }
    ++report.rows;
    SIXPOINT_CHECK(out.append(row_line(row) + "\n"));
  }
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
  SIXPOINT_CHECK(files.make_folders(folder + "/attachments"));
  // Written last: a folder without it is no whole export.
  const std::string header_path = folder + "/" + kCsvHeader;
  if (files.info(header_path)) {
    SIXPOINT_CHECK(files.remove(header_path));
    SIXPOINT_CHECK(files.sync_folder(folder));
  }
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(database));
  SIXPOINT_ASSIGN(const Head head, read_head(database));
  ExchangeReport report;
  report.head = to_hex(head.hash);
  for (const Table& table : tables()) {
    SIXPOINT_ASSIGN(auto out,
                    BufferedFile::create(files, fmt::format("{}/{}.csv", folder, table.name)));
    std::string line = column_list(table);
    std::erase(line, ' ');
    SIXPOINT_CHECK(out.append(line + "\r\n"));
    SIXPOINT_ASSIGN(const auto rows, database.stream(fmt::format("SELECT {} FROM {} ORDER BY seq",
                                                                 column_list(table), table.name)));
    Row row;
    while (true) {
      SIXPOINT_ASSIGN(const bool more, rows->next(row));
      if (!more) {
        break;
      }
      line.clear();
      for (std::size_t i = 0; i + 1 < row.size(); ++i) {
        line += field_of(row[i]) + ",";
      }
      const auto* hash = std::get_if<Bytes>(&row.back());
      SIXPOINT_CHECK(out.append(line + (hash == nullptr ? "" : to_hex(*hash)) + "\r\n"));
      ++report.rows;
    }
    SIXPOINT_CHECK(out.commit());
  }
  SIXPOINT_CHECK(
      for_each_attachment(database, [&](const std::string& name, const Bytes& bytes) -> Status {
        // The name becomes a path: it must be the digest that it claims to be.
        if (to_hex(sha256(bytes)) != name) {
          return fail(ErrorCode::bad_data,
                      fmt::format("attachment {} was changed", printable(name, 70)),
                      database.location(), "'sixpoint audit verify' lists what was touched");
        }
        ++report.attachments;
        SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, folder + "/attachments/" + name));
        SIXPOINT_CHECK(out.append(bytes));
        return out.commit();
      }));
  SIXPOINT_CHECK(write_file(files, header_path, header_of(head).dump(2) + "\n"));
  return report;
}

Result<ExchangeReport> import_csv(Store& store, FileSystem& files, const std::string& folder) {
  const std::string header_path = folder + "/" + kCsvHeader;
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, header_path, 1U << 16));
  const auto first =
      parse_line(std::string_view(reinterpret_cast<const char*>(text.data()), text.size()));
  const auto header = first ? to_header(*first) : Result<Header>(fail(first.error()));
  if (!header) {
    Error error = header.error();
    error.where = header_path;
    return fail(std::move(error));
  }
  std::vector<CsvTable> all;
  for (const Table& table : tables()) {
    if (table.since > header->store_version &&
        !files.info(fmt::format("{}/{}.csv", folder, table.name))) {
      continue;
    }
    SIXPOINT_ASSIGN(auto opened, CsvTable::open(files, folder, table));
    all.push_back(std::move(opened));
  }
  std::string where = folder;
  auto report = import_rows(store.database(), *header, [&](Importer& importer) -> Status {
    SIXPOINT_CHECK(import_attachment_files(files, folder, importer.writer(), importer.report()));
    while (true) {
      CsvTable* next = nullptr;
      for (CsvTable& table : all) {
        if (!table.at_end() && (next == nullptr || table.row().seq < next->row().seq)) {
          next = &table;
        }
      }
      if (next == nullptr) {
        where = folder;
        return {};
      }
      where = next->where();
      SIXPOINT_CHECK(importer.add(next->row()));
      SIXPOINT_CHECK(next->advance());
    }
  });
  if (!report && (report.error().where.empty() || report.error().code == ErrorCode::bad_data)) {
    Error error = std::move(report).error();
    error.where = where;
    return fail(std::move(error));
  }
  return report;
}

Result<ExchangeReport> import_json_lines(Store& store, FileSystem& files, const std::string& path) {
  Database& database = store.database();
  SIXPOINT_ASSIGN(auto lines, LineReader::open(files, path));
  std::string_view text;
  const auto import = [&]() -> Result<ExchangeReport> {
    SIXPOINT_ASSIGN(const bool any, lines.next(text));
    SIXPOINT_ASSIGN(const Json first, parse_line(any ? text : "{}"));
    SIXPOINT_ASSIGN(const Header header, to_header(first));
    return import_rows(database, header, [&](Importer& importer) -> Status {
      while (true) {
        SIXPOINT_ASSIGN(const bool more, lines.next(text));
        if (!more) {
          return {};
        }
        SIXPOINT_CHECK(import_line(importer, text));
      }
    });
  };
  auto report = import();
  if (!report) {
    Error error = std::move(report).error();
    if (error.where.empty() || error.code == ErrorCode::bad_data) {
      error.where = lines.number() == 0 ? path : fmt::format("{}, line {}", path, lines.number());
    }
    return fail(std::move(error));
  }
  return report;
}

Result<ExchangeReport> backup(Store& store, Env& env, const std::string& path) {
  if (path == store.database().location() || env.files.info(path + "-wal")) {
    return fail(ErrorCode::cannot_create, "a store is at work there", path,
                "choose another name for the backup");
  }
  return make_store_file(env, path, [&](const std::string& temporary) -> Result<ExchangeReport> {
    ExchangeReport report;
    SIXPOINT_ASSIGN(const bool copied, store.database().copy_to_file(temporary));
    // Opening makes a new store where PostgreSQL had no means of its own; both are then checked.
    SIXPOINT_ASSIGN(auto copy, Store::open(env, temporary));
    if (!copied) {
      SIXPOINT_CHECK(copy_rows(store.database(), copy.database(), report));
    }
    SIXPOINT_ASSIGN(const AuditReport audit, copy.audit());
    if (!audit.ok) {
      return fail(ErrorCode::bad_data, fmt::format("the store is damaged: {}", audit.brief()),
                  store.database().location(),
                  "no backup was made; 'sixpoint audit verify' lists what was touched");
    }
    report.rows = audit.rows;
    report.head = audit.head;
    SIXPOINT_ASSIGN(const auto count, copy.database().query("SELECT count(*) FROM attachments"));
    report.attachments = integer_of(count[0][0]);
    return report;
  });
}

Result<ExchangeReport> import_into_new_file(Env& env, const std::string& input,
                                            const std::string& path) {
  SIXPOINT_ASSIGN(const FileInfo info, env.files.info(input));
  return make_store_file(env, path, [&](const std::string& temporary) -> Result<ExchangeReport> {
    SIXPOINT_ASSIGN(auto store, Store::open(env, temporary));
    SIXPOINT_ASSIGN(const auto report, info.is_folder ? import_csv(store, env.files, input)
                                                      : import_json_lines(store, env.files, input));
    if (env.files.info(path)) {
      return fail(ErrorCode::cannot_create, "another program made a store there meanwhile", path,
                  "import again: it continues a store that has the beginning of the same chain");
    }
    return report;
  });
}

}  // namespace sixpoint::db

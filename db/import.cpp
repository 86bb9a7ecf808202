#include <functional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "db/exchange.h"
#include "db/export_json.h"
#include "db/history.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

// The largest capture (records.cpp) in hex digits, and its name.
constexpr std::size_t kLongestLine = 256U << 20;
constexpr std::size_t kReadAtOnce = 1U << 20;

// Lines of a file, however long the file is.
class LineReader {
 public:
  static Result<LineReader> open(FileSystem& files, const std::string& path) {
    SIXPOINT_ASSIGN(auto file, files.open(path));
    return LineReader(std::move(file), path);
  }
  // False at the end. The last line may lack its line end.
  Result<bool> next(std::string_view& line) {
    std::size_t searched = used_;
    while (true) {
      const std::size_t end = buffer_.find('\n', searched);
      if (end != std::string::npos) {
        line = std::string_view(buffer_).substr(used_, end - used_);
        used_ = end + 1;
        ++number_;
        return true;
      }
      buffer_.erase(0, used_);  // once for all lines of a piece
      used_ = 0;
      searched = buffer_.size();
      if (searched > kLongestLine) {
        return fail(ErrorCode::bad_data, fmt::format("line {} is too long", number_ + 1), path_,
                    "this is no export of a store");
      }
      Bytes piece(kReadAtOnce);
      SIXPOINT_ASSIGN(const std::size_t count, file_->read_at(offset_, piece));
      buffer_ += as_text(std::span(piece).first(count));
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
      !line["table"].is_string() || !line.contains("row") || !line.contains("hash") ||
      !line["hash"].is_string()) {
    return bad("the line is neither a row nor an attachment");
  }
  ImportedRow row;
  row.seq = line["seq"].get<std::int64_t>();
  row.table = find_table(line["table"].get<std::string>());
  if (row.table == nullptr) {
    return bad(fmt::format("row {} is of a table that this program does not know", row.seq));
  }
  auto columns = row_from_json(*row.table, line["row"]);
  if (!columns) {
    return bad(fmt::format("row {} ({}): {}", row.seq, row.table->name, columns.error().what));
  }
  row.columns = *std::move(columns);
  auto hash = from_hex(line["hash"].get_ref<const std::string&>());
  if (!hash) {
    return bad(fmt::format("row {} ({}): hash is no hash", row.seq, row.table->name));
  }
  row.hash = *std::move(hash);
  return row;
}

// The row must be what the store has in its place.
Status check_same(Database& database, const ImportedRow& row) {
  const std::vector<Value> seq = {row.seq};
  SIXPOINT_ASSIGN(const auto there,
                  database.query(fmt::format("SELECT {} FROM {} WHERE seq = $1",
                                             column_list(*row.table), row.table->name),
                                 seq));
  if (there.size() != 1 ||
      !std::equal(row.columns.begin(), row.columns.end(), there[0].begin() + 1) ||
      there[0].back() != Value(row.hash)) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("{} is not what the store has in its place: the file comes from another "
                    "store, or one of the two was changed",
                    name_of(row.view())),
        {}, "import it into a new store, and run 'audit verify' on both");
  }
  return {};
}

Status import_line(Database& database, HistoryWriter& writer, std::string_view text,
                   ExchangeReport& report) {
  SIXPOINT_ASSIGN(const Json line, parse_json_line(text));
  if (line.contains("attachment")) {
    SIXPOINT_ASSIGN(auto attachment, attachment_from_json(line));
    ++report.attachments;
    return writer.add_attachment(attachment.first, std::move(attachment.second));
  }
  SIXPOINT_ASSIGN(const ImportedRow row, to_row(line));
  ++report.rows;
  if (row.seq != report.rows) {
    return fail(ErrorCode::bad_data,
                fmt::format("{} stands where row {} should", name_of(row.view()), report.rows), {},
                "rows are missing or out of order: export again");
  }
  if (row.seq <= writer.head().rows) {
    return check_same(database, row);
  }
  ++report.added;
  return writer.append_copy(row.view());
}

Result<ExchangeReport> import_lines(Database& database, LineReader& lines) {
  std::string_view text;
  SIXPOINT_ASSIGN(const bool any, lines.next(text));
  SIXPOINT_ASSIGN(const Json first, parse_json_line(any ? text : "{}"));
  SIXPOINT_ASSIGN(const ExportHeader header, header_from_json(first));
  SIXPOINT_ASSIGN(auto transaction, Transaction::writing(database));
  SIXPOINT_ASSIGN(auto writer, HistoryWriter::open(database));
  const std::int64_t before = writer.head().rows;
  ExchangeReport report;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, lines.next(text));
    if (!more) {
      break;
    }
    SIXPOINT_CHECK(import_line(database, writer, text, report));
  }
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

}  // namespace

Result<ExchangeReport> import_json_lines(Store& store, FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const FileInfo info, files.info(path));
  if (info.is_folder || path.ends_with(".csv")) {
    return fail(ErrorCode::bad_data, "a store is imported from JSON Lines, not from CSV", path,
                "make the file with 'sixpoint store export' without --csv");
  }
  SIXPOINT_ASSIGN(auto lines, LineReader::open(files, path));
  auto report = import_lines(store.database(), lines);
  if (!report) {
    Error error = std::move(report).error();
    if (error.where.empty() || error.code == ErrorCode::bad_data) {
      error.where = lines.number() == 0 ? path : fmt::format("{}, line {}", path, lines.number());
    }
    return fail(std::move(error));
  }
  return report;
}

}  // namespace sixpoint::db

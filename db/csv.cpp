#include "db/csv.h"

#include <fmt/format.h>

namespace sixpoint::db {
namespace {

constexpr std::size_t kChunk = 1U << 16;
constexpr std::size_t kLongestRecord = 256U << 20;
constexpr std::size_t kMostFields = 1000;

}  // namespace

Result<CsvReader> CsvReader::open(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto file, files.open(path));
  return CsvReader(std::move(file), path);
}

tl::unexpected<Error> CsvReader::bad(const std::string& what) const {
  return fail(ErrorCode::bad_data, what, fmt::format("{}, record {}", path_, number_),
              "export again; a spreadsheet program may have rewritten the file");
}

Result<int> CsvReader::peek() {
  if (used_ == buffer_.size()) {
    buffer_.resize(kChunk);
    SIXPOINT_ASSIGN(const std::size_t count, file_->read_at(offset_, buffer_));
    buffer_.resize(count);
    used_ = 0;
    offset_ += count;
  }
  return used_ == buffer_.size() ? -1 : buffer_[used_];
}

Result<int> CsvReader::take() {
  SIXPOINT_ASSIGN(const int byte, peek());
  used_ += byte < 0 ? 0 : 1;
  return byte;
}

Result<bool> CsvReader::next(CsvRecord& record) {
  record.clear();
  SIXPOINT_ASSIGN(const int first, peek());
  if (first < 0) {
    return false;
  }
  ++number_;
  std::string text;
  std::size_t size = 0;
  enum class At { start, plain, quoted, closed };
  At at = At::start;
  const auto end_field = [&] {
    record.push_back(at == At::start ? std::nullopt : std::optional(std::move(text)));
    text.clear();
    at = At::start;
  };
  while (true) {
    SIXPOINT_ASSIGN(const int byte, take());
    if (++size > kLongestRecord || record.size() >= kMostFields) {
      return bad("the record is too long");
    }
    if (at == At::quoted) {
      if (byte < 0) {
        return bad("the file ends inside of a quoted text");
      }
      if (byte != '"') {
        text += static_cast<char>(byte);
        continue;
      }
      SIXPOINT_ASSIGN(const int after, peek());
      if (after == '"') {
        text += '"';
        ++used_;
      } else {
        at = At::closed;
      }
      continue;
    }
    int line_end = byte;
    if (byte == '\r') {
      SIXPOINT_ASSIGN(const int after, peek());
      line_end = after == '\n' ? '\n' : byte;
      used_ += after == '\n' ? 1 : 0;
    }
    if (line_end < 0 || line_end == '\n') {
      end_field();
      return true;
    }
    if (byte == ',') {
      end_field();
    } else if (at == At::closed) {
      return bad("something follows a closing quote");
    } else if (byte == '"' && at == At::start) {
      at = At::quoted;
    } else {
      text += static_cast<char>(byte);
      at = At::plain;
    }
  }
}

std::string csv_field(const std::optional<std::string>& text) {
  if (!text) {
    return "";
  }
  if (!text->empty() && text->find_first_of(",\"\r\n") == std::string::npos) {
    return *text;
  }
  std::string quoted = "\"";
  for (const char c : *text) {
    quoted += c;
    if (c == '"') {
      quoted += c;
    }
  }
  return quoted + '"';
}

}  // namespace sixpoint::db

// Comma-separated values as RFC 4180 has them, read one record at a time however long the file is.
// One addition, which spreadsheets do not mind: an empty field is NULL, "" is an empty text.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::db {

using CsvRecord = std::vector<std::optional<std::string>>;

class CsvReader {
 public:
  static Result<CsvReader> open(FileSystem& files, const std::string& path);
  // False at the end. bad_data, naming the record, for a quote that does not end, characters after
  // a closing quote, more than 1000 fields, and records above 256 MiB. Lines may end with CR LF or
  // LF.
  Result<bool> next(CsvRecord& record);
  std::int64_t number() const { return number_; }  // of the record that next() gave, from 1
  const std::string& path() const { return path_; }

 private:
  CsvReader(std::unique_ptr<ReadableFile> file, std::string path)
      : file_(std::move(file)), path_(std::move(path)) {}
  // The next byte, or -1 at the end.
  Result<int> take();
  Result<int> peek();
  tl::unexpected<Error> bad(const std::string& what) const;

  std::unique_ptr<ReadableFile> file_;
  std::string path_;
  Bytes buffer_;
  std::size_t used_ = 0;
  std::uint64_t offset_ = 0;
  std::int64_t number_ = 0;
};

// One field, quoted where it must be.
std::string csv_field(const std::optional<std::string>& text);

}  // namespace sixpoint::db

// What Recording holds, and RecordingWriter::copy() reaches into (private to this room).
#pragma once

#include <mutex>

#include <zip.h>

#include "gt3x/container/inflating_source.h"
#include "gt3x/recording.h"

namespace sixpoint::gt3x {

struct Recording::Archive {
  Archive(std::unique_ptr<ReadableFile> opened, std::string where)
      : file(std::move(opened)), path(std::move(where)) {}
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;
  ~Archive() {
    if (zip != nullptr) {
      zip_discard(zip);
    }
  }

  // The packed bytes of one entry. They keep `archive` open.
  static Result<std::unique_ptr<ByteSource>> open_packed(const std::shared_ptr<Archive>& archive,
                                                         std::size_t index);

  static zip_int64_t origin(void* user, void* data, zip_uint64_t length, zip_source_cmd_t command);

  Status open_zip();
  Status read_entries();
  Result<EntryInfo> read_entry(zip_uint64_t index) const;
  std::optional<std::size_t> index_of(const std::string& name) const;
  Result<EntryFacts> facts_of(std::size_t index) const;
  tl::unexpected<Error> bad(std::string what, std::string hint = {}) const;

  // Every call of libzip that touches the file: entries are read by threads of their own
  // (read_ahead.h). Recursive, because libzip calls back.
  mutable std::recursive_mutex mutex;
  std::unique_ptr<ReadableFile> file;
  std::string path;
  std::uint64_t at = 0;
  std::optional<Error> failure;  // what the file system said, when it did
  zip_error_t error{};
  zip_t* zip = nullptr;
  std::vector<EntryInfo> entries;
  Info info;
  RecordingForm form = RecordingForm::log;
};

}  // namespace sixpoint::gt3x

// What Recording holds, and RecordingWriter::copy() reaches into (private to this room).
#pragma once

#include <mutex>

#include <zip.h>

#include "gt3x/container/inflating_source.h"
#include "gt3x/container/local_headers.h"
#include "gt3x/recording.h"

namespace sixpoint::gt3x {

struct Recording::Archive {
  Archive(std::unique_ptr<ReadableFile> opened, std::string where, const RecordingOptions& how)
      : file(std::move(opened)), path(std::move(where)), options(how), end(file->size()) {}
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

  // The entries, by the archive's list or without it.
  Status find_entries();
  Status open_zip();
  Status read_list();
  Status read_local_headers();
  Result<EntryHeader> listed_header(zip_uint64_t index) const;
  Status add_entry(const EntryHeader& header);
  Status check_entries();
  Status read_info(Recording& recording);

  void note(Damage kind, const std::string& entry, const std::string& why);

  std::optional<std::size_t> index_of(const std::string& name) const;
  Result<EntryFacts> facts_of(std::size_t index) const;
  tl::unexpected<Error> bad(std::string what, std::string hint) const;
  tl::unexpected<Error> list_is_damaged() const;

  // Every call of libzip that touches the file: entries are read by threads of their own
  // (read_ahead.h). Recursive, because libzip calls back.
  mutable std::recursive_mutex mutex;
  std::shared_ptr<const ReadableFile> file;
  std::string path;
  RecordingOptions options;
  std::uint64_t end;  // of the archive (container/archive_end.h)
  std::uint64_t at = 0;
  std::optional<Error> failure;  // what the file system said, when it did
  zip_error_t error{};
  zip_t* zip = nullptr;
  std::vector<EntryInfo> entries;
  // For each entry: its number in the archive's list. Or, where there is no list, local_entries.
  std::vector<zip_uint64_t> listed;
  std::vector<LocalEntry> local_entries;
  std::vector<RecordingDamage> damage;
  Info info;
  RecordingForm form = RecordingForm::log;
};

}  // namespace sixpoint::gt3x

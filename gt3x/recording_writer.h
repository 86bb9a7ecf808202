// Writes a .gt3x file: entries in the order in which they were added, whole or not at all.
//
//   SIXPOINT_ASSIGN(auto out, RecordingWriter::create(env.files, path));
//   SIXPOINT_CHECK(out.add("log.bin", std::move(source)));  // pulled piece by piece at commit()
//   SIXPOINT_CHECK(out.add("info.txt", info.serialise()));
//   SIXPOINT_CHECK(out.commit());
//
// The archive goes to a temporary file beside the target; commit() writes, syncs, renames and syncs
// the folder (base/atomic_file.h). Without commit(), or when it fails, no target appears. The same
// entries give the same bytes: they are stored (as the vendor's own files are) and carry one fixed
// time stamp.
//
// One object belongs to one thread.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "base/env.h"
#include "gt3x/container/byte_source.h"

namespace sixpoint::gt3x {

class Recording;

enum class Compression {
  store,    // the default: fast, the vendor's way, and independent of zlib's version
  deflate,  // smaller by a third or so
};

class RecordingWriter {
 public:
  // cannot_create where the temporary file cannot be made.
  static Result<RecordingWriter> create(FileSystem& files, const std::string& path);

  RecordingWriter(RecordingWriter&&) noexcept;
  RecordingWriter& operator=(RecordingWriter&&) noexcept;
  ~RecordingWriter();

  // A name may be added once and must be a plain file name; `usage` otherwise. A source that knows
  // its size makes an entry that every zip reader can read; one that does not makes a zip64 entry.
  Status add(const std::string& name, Bytes bytes, Compression compression = Compression::store);
  Status add(const std::string& name, std::string_view text,
             Compression compression = Compression::store);
  Status add(const std::string& name, std::unique_ptr<ByteSource> source,
             Compression compression = Compression::store);

  // Carries an entry of another archive over untouched, its compressed bytes as they are. The entry
  // is read once first, so that a damaged one is found (bad_data) and not carried on.
  Status copy(Recording& from, const std::string& name);

  // Once. Errors of a source come back as they are.
  Status commit();

 private:
  struct Archive;
  explicit RecordingWriter(std::unique_ptr<Archive> archive);
  std::unique_ptr<Archive> archive_;
};

}  // namespace sixpoint::gt3x

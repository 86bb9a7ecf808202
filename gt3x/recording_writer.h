// Writes a .gt3x file: entries in the order in which they were added, whole or not at all.
//
//   SIXPOINT_ASSIGN(auto out, RecordingWriter::create(env.files, path));
//   SIXPOINT_CHECK(out.add("log.bin", source));  // read to its end, piece by piece
//   SIXPOINT_CHECK(out.add("info.txt", info.serialise()));
//   SIXPOINT_CHECK(out.commit());
//   out.sha256();  // of the file, taken as its bytes went by
//
// The archive goes to a temporary file beside the target; commit() syncs it, renames it and syncs
// the folder (base/atomic_file.h). Without commit(), or when something fails, no target appears.
// The same entries give the same bytes, with the same version of libdeflate, whatever `jobs` is
// (container/zip_writer.h).
//
// One object belongs to one thread.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "base/env.h"
#include "gt3x/container/byte_source.h"
#include "gt3x/container/inflating_source.h"

namespace sixpoint::gt3x {

class Recording;

struct WriterOptions {
  // Deflated, a recording takes a third to two thirds of its size, and unzip, Python's zipfile and
  // R's unz read it. Stored (as the vendor's own downloads are) it is written faster.
  Packing packing = Packing::deflate;
  // Threads that pack, beside the calling one; 1: the calling one packs.
  unsigned jobs = 1;
};

class RecordingWriter {
 public:
  // cannot_create where the temporary file cannot be made.
  static Result<RecordingWriter> create(FileSystem& files, const std::string& path,
                                        const WriterOptions& options = {});

  RecordingWriter(RecordingWriter&&) noexcept;
  RecordingWriter& operator=(RecordingWriter&&) noexcept;
  ~RecordingWriter();

  // A name may be added once and must stay inside (entry_rule.h); `usage` otherwise. bad_data for
  // one more than a recording may have (ArchiveLimits), as it would be refused when it is read.
  // Errors of a source come back as they are.
  Status add(const std::string& name, ByteSource& source);
  Status add(const std::string& name, Bytes bytes);
  Status add(const std::string& name, std::string_view text);

  // Carries an entry of another archive over untouched, its packed bytes as they are. The entry is
  // unpacked once first, so that a damaged one is found (bad_data) and not carried on.
  Status copy(Recording& from, const std::string& name);

  // Once. What failed in add() or copy() fails again here.
  Status commit();

  // In lower-case hex digits; of a committed file.
  const std::string& sha256() const;

 private:
  struct Archive;
  explicit RecordingWriter(std::unique_ptr<Archive> archive);
  std::unique_ptr<Archive> archive_;
};

}  // namespace sixpoint::gt3x

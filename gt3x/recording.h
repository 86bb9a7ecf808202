// A .gt3x or .agdc file, opened for reading.
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, path));
//   recording.info().serial();
//   SIXPOINT_ASSIGN(auto log, recording.open_log());  // record by record, or
//   SampleReader samples(recording);                  // second by second (sample_reader.h)
//
// The file is read through the FileSystem that was given, piece by piece; nothing is unpacked to
// disk and no entry is held in memory whole, but info.txt.
//
// One object, and everything opened from it, belongs to one thread; large entries are unpacked on
// threads of their own, which end with what open_entry() and open_log() gave. The file stays open
// as long as any of them lives. The original is never changed: there is no way to write through
// this.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "gt3x/container/byte_source.h"
#include "gt3x/forms/info.h"
#include "gt3x/log/log_reader.h"

namespace sixpoint::gt3x {

struct EntryInfo {
  std::string name;
  std::uint64_t size = 0;
  std::uint64_t compressed_size = 0;
};

enum class RecordingForm {
  log,      // current form: log.bin
  activity  // old form (GT3X+ and ActiSleep+ with firmware 2.5.0 or earlier): activity.bin
};

class Recording {
 public:
  // no_input where there is no such file; bad_data where it is no zip, is cut short, holds neither
  // log.bin nor activity.bin, no info.txt, two entries of one name, entries named with a path,
  // encrypted ones, or sizes that no recording has.
  static Result<Recording> open(FileSystem& files, const std::string& path);

  const std::string& path() const;
  const Info& info() const;
  const std::vector<EntryInfo>& entries() const;  // in the order of the archive
  RecordingForm form() const;
  bool has_log() const { return form() == RecordingForm::log; }
  bool has_entry(const std::string& name) const;

  // The bytes of one entry, decompressed. A damaged stream and a wrong CRC come as bad_data from
  // read(), the latter only at the end: what is written from it must not be kept before.
  Result<std::unique_ptr<ByteSource>> open_entry(const std::string& name);

  // bad_data for a file of the old form.
  Result<LogReader> open_log();

 private:
  friend class RecordingWriter;
  struct Archive;
  class PackedEntry;
  explicit Recording(std::shared_ptr<Archive> archive);
  std::shared_ptr<Archive> archive_;
};

}  // namespace sixpoint::gt3x

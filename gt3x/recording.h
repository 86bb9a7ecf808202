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
#include "gt3x/container/delivery.h"
#include "gt3x/container/entry_rule.h"
#include "gt3x/forms/agdc.h"
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

struct RecordingOptions {
  // Delivers what is left of a damaged file (container/delivery.h) and lists the damage. Off: a
  // damaged file is refused.
  bool salvage = false;
  ArchiveLimits limits;
};

// A damage that was met and passed, with the option salvage.
struct RecordingDamage {
  Damage kind = Damage::none;
  std::string entry;  // empty: the archive
  std::string why;
};

class Recording {
 public:
  // no_input where there is no such file; bad_data where it is no zip, is cut short, holds neither
  // log.bin nor activity.bin, no info.txt, two entries of one name, or one that why_refused()
  // (container/entry_rule.h) refuses. Folders are no entries.
  //
  // With salvage: without a list of entries they are found by their own headers. Where info.txt is
  // lost or damaged, info() holds what is left of it, and what the log says (salvaged_info.h).
  static Result<Recording> open(FileSystem& files, const std::string& path,
                                const RecordingOptions& options = {});

  const std::string& path() const;
  const Info& info() const;
  const std::vector<EntryInfo>& entries() const;  // in the order of the archive
  RecordingForm form() const;
  bool has_log() const { return form() == RecordingForm::log; }
  bool has_entry(const std::string& name) const;

  // Bytes of the file behind the archive's end; they are not read.
  std::uint64_t bytes_behind() const;

  // Empty without the option salvage, and where nothing was found yet: an entry's damage shows when
  // it is read, and is complete when it was read to its end. Each is listed once.
  const std::vector<RecordingDamage>& damage() const;
  bool is_damaged(const std::string& entry) const;

  // The bytes of one entry, decompressed. A damaged stream and a wrong CRC come as bad_data from
  // read(), the latter only at the end: what is written from it must not be kept before. With
  // salvage they end there instead.
  Result<std::unique_ptr<ByteSource>> open_entry(const std::string& name);

  // bad_data for a file of the old form.
  Result<LogReader> open_log();

  // The same for who wants the first records alone: unpacked on the caller's thread, in small
  // pieces. To its end it takes longer than open_log().
  Result<LogReader> open_log_beginning();

 private:
  friend class RecordingWriter;
  struct Archive;
  enum class Unpacking { ahead, when_asked };
  Result<std::unique_ptr<ByteSource>> open_entry(const std::string& name, Unpacking how);
  Result<LogReader> open_log(Unpacking how);
  class PackedEntry;
  explicit Recording(std::shared_ptr<Archive> archive);
  std::shared_ptr<Archive> archive_;
};

// What calibration.json says of the samples of an .agdc. bad_data where there is none, where it is
// none (parse_agdc_calibration), and where it says that they are g times the file's scale and
// info.txt holds no such scale (1, as of raw counts).
Result<AgdcCalibration> agdc_calibration(Recording& recording, double rate_hz);

// Whether ACTIVITY3 records hold raw counts:
//
// | calibration.json                              | raw counts                   |
// |-----------------------------------------------|------------------------------|
// | "isCalibrated", and agdc_calibration() has it | no: g times the file's scale |
// | any other, or none                            | yes                          |
bool holds_raw_counts(Recording& recording, double rate_hz);

}  // namespace sixpoint::gt3x

// One pass over a recording: what it says about itself, and what its still periods say.
//
//   SIXPOINT_ASSIGN(const Survey found, survey(env.files, "in.gt3x"));
//   triage(found.facts);              // is it affected?
//   found.magnitude.mean_mg;          // how far from 1 g it is at rest
//
// Everything that triage, solving and repair need to know before a file gets its name. Memory is
// bounded by the still blocks (calib::StillBlockOptions::max_blocks).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "base/stored_constants.h"
#include "calib/still_blocks.h"
#include "gt3x/forms/agdc.h"
#include "gt3x/forms/eeprom.h"
#include "gt3x/forms/info.h"
#include "gt3x/forms/parameters.h"
#include "gt3x/log/log_reader.h"
#include "gt3x/log/record.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/salvage_losses.h"
#include "gt3x/sample_reader.h"
#include "repair/triage/still_scan.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {

// The zip entry that a repaired file carries beside log.bin and info.txt (docs/repair.md). Readers
// that open log.bin and info.txt by name do not see it; its presence is what makes a second repair
// answer `already_repaired`.
inline constexpr const char* kRepairMark = "sixpoint-repair.json";
// The same in the log itself, before the first record, so that packing the archive anew does not
// lose it: a METADATA record, JSON in the vendor's form, with this MetadataType.
inline constexpr const char* kRepairMarkType = "SixpointRepair";
bool is_repair_mark(const gt3x::Record& record);
// Either of the two; reads the log up to its first good record.
Result<bool> carries_repair_mark(gt3x::Recording& recording);

// The scale of samples whose file names none (wGT3X-BT at 8 g and 12 bits).
inline constexpr double kUsualScale_lsb_per_g = 256;

// Samples in one ACTIVITY2 record.
inline constexpr std::size_t kMaxWideSamples = gt3x::kMaxPayload / sizeof(gt3x::Counts);

struct Survey {
  FileFacts facts;
  std::string model;
  double rate_hz = 0;
  // Of the first PARAMETERS, else as below. Where others come later, each holds for the samples
  // behind it (gt3x::accel_scale_lsb_per_g, which `export` follows too).
  double accel_scale_lsb_per_g = 0;
  bool accel_scale_known = false;  // false: 256 was assumed
  // Where no PARAMETERS say it: info.txt, else the model, else the one above.
  double header_scale_lsb_per_g = 0;
  bool already_repaired = false;  // a mark is there: the zip entry or the record in the log
  // What had to be assumed, a sentence each: a scale that cannot be and was replaced.
  std::vector<std::string> notes;
  // The constants that were in force for at least one sample, in order; usually one set. For a sample hold:
  //
  // | the last PARAMETERS before it                       | constants                                   |
  // |-----------------------------------------------------|---------------------------------------------|
  // | all nine numbers                                    | these                                       |
  // | some of the nine, or none, and none contradicts     | the last complete ones before, else the     |
  // | those that are in force                             | first complete ones behind (said in notes)  |
  // | some of the nine, and one contradicts               | not known: constants_problem                |
  // | there are none                                      | the first complete ones behind (said)       |
  //
  // repair/rescale/rescaled_log.h undoes the same ones (promise R22).
  std::vector<StoredConstants> constants;
  // What an .agdc file's samples are, in which nothing can be repaired. The still blocks' mean_g are
  // what `export` makes of them:
  //
  // | calibration.json                | raw_counts | agdc             | mean_g                       |
  // |---------------------------------|------------|------------------|------------------------------|
  // | says how counts become g        | true       | says how         | by its offset and its matrix |
  // | is missing, or does not fit     | true       | none             | by the usual scale: a guess  |
  // | was applied already             | false      | already_applied  | by the file's scale          |
  // | (any other form of recording)   | false      | none             | by the file's scale          |
  bool raw_counts = false;
  std::optional<gt3x::AgdcCalibration> agdc;
  // Why they cannot be used (none in the file, positive = negative, or no samples to use them on),
  // where that is so.
  std::optional<Error> constants_problem;

  std::uint64_t samples = 0;
  std::uint64_t clipped_samples = 0;  // an axis at the limit of 12 bits
  std::uint64_t sample_records = 0;   // ACTIVITY and ACTIVITY2 with samples in them
  std::uint64_t log_bytes = 0;
  std::uint64_t log_bytes_wide = 0;  // with every ACTIVITY record written as ACTIVITY2 records
  bool beyond_12_bits = false;       // a count outside [-2048, 2047], in ACTIVITY2 records
  gt3x::LogStatistics log;
  std::vector<gt3x::SalvageLoss> losses;  // with the option salvage

  std::vector<calib::StillBlock> blocks;
  // Of a recording with temperatures: also the blocks at rest while something hums (a climate
  // chamber's fan), which are no still blocks and whose means still show how zeros drift.
  std::vector<calib::StillBlock> resting;
  calib::PlausibilityTally plausibility;
  calib::StillBlockTally still_tally;
  MagnitudeError magnitude;  // of the file as it is, by its own scale
  double duration_s = 0;     // samples over rate
};

// What eeprom.bin of a recording of the old form says; bad_data where there is none, or another
// unit's.
Result<gt3x::UnitMemory> unit_memory(gt3x::Recording& recording);

// What the header says, and what the records in force at the first sample add.
FileFacts header_facts(const gt3x::Info& info);
void add_facts(const gt3x::Parameters& in_force, FileFacts& facts);
void add_facts(const gt3x::UnitMemory& memory, FileFacts& facts);
// The PARAMETERS that hold for a log's first samples. `scan`, `solve`, `repair`, `inspect` and the
// readings of Python and R all take these; records whose checksum is wrong do not count.
//
// |                            | before the first sample    | else                       |
// |----------------------------|----------------------------|----------------------------|
// | date, firmware             | the last record            | the first record behind    |
// | constants                  | the last complete record   | the first complete behind  |
// | scale of the first samples | the last record            | info.txt (the header)      |
//
// A later record need not repeat the firmware. Of a log without samples, all records stand before.
struct FirstParameters {
  std::optional<gt3x::Parameters> record;
  bool record_stands_before = false;
  std::optional<StoredConstants> constants;
  bool constants_stand_before = false;

  // None where `record` has some of the nine numbers, and one is another one: then nothing is known
  // (the table of Survey::constants).
  std::optional<StoredConstants> known_constants() const;
};
// `with_constants`: reads on until a record has them, to the end where none has.
Result<FirstParameters> first_parameters(gt3x::Recording& recording, bool with_constants);
// The same of a recording that `read` read to its end, so that nothing is looked for that is not there.
Result<FirstParameters> first_parameters(gt3x::Recording& recording,
                                         const gt3x::SampleReader& read);
// Header and first parameters; reads no further than the first samples where parameters stand before
// them, and to the end where there are none.
Result<FileFacts> facts_of(FileSystem& files, const std::string& path);

// no_input, bad_data (no zip, damaged entry ...), as gt3x::Recording and LogReader have it;
// bad_data also for a sample rate of 0. Of the old form (activity.bin) the constants are those in
// eeprom.bin; without them its still periods are found all the same.
Result<Survey> survey(FileSystem& files, const std::string& path,
                      const calib::StillBlockOptions& options = {},
                      const gt3x::RecordingOptions& how = {});

// The same for a log that is read for another purpose too, item by item.
//
//   SIXPOINT_ASSIGN(auto passing, LogSurvey::begin(recording, options));
//   SIXPOINT_CHECK(passing.take(*item));  // each item of recording.open_log(), in order
//   const Survey found = passing.finish(log.statistics());
//
// One object belongs to one thread at a time; the recording must outlive it.
class LogSurvey {
 public:
  // Reads the log's first records; errors as survey() has them.
  static Result<LogSurvey> begin(gt3x::Recording& recording,
                                 const calib::StillBlockOptions& options);
  LogSurvey(LogSurvey&&) noexcept;
  LogSurvey& operator=(LogSurvey&&) noexcept;
  ~LogSurvey();

  // From now on take() tells of every still block that it finds and keeps (StillScan::on_block).
  void on_block(StillScan::OnBlock tell);
  Status take(const gt3x::LogItem& item);
  // Behind the last item, with what the reader counted. Losses are not filled in.
  Survey finish(const gt3x::LogStatistics& log);

 private:
  friend Result<Survey> survey_beginning(gt3x::Recording& recording,
                                         const calib::StillBlockOptions& options,
                                         std::uint64_t samples);
  class Pass;
  explicit LogSurvey(std::unique_ptr<Pass> pass);
  std::unique_ptr<Pass> pass_;
};

// Of the records up to so many samples alone: what the whole of a log will probably say.
Result<Survey> survey_beginning(gt3x::Recording& recording, const calib::StillBlockOptions& options,
                                std::uint64_t samples);

// [{kind, entry, from, to, why}], times by the file's clock, no zone; null for what is not known.
nlohmann::ordered_json losses_to_json(const std::vector<gt3x::SalvageLoss>& losses);

}  // namespace sixpoint::repair

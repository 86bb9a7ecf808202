// Asks the sources of constants for a file, in the order of sources.h.
//
//   ConstantsFinderOptions options;
//   options.store = &store;
//   ConstantsFinder finder(env, options);
//   SIXPOINT_ASSIGN(const ConstantsChoice choice, finder.choose(path, survey));
//
// | source                                       | has constants that fit when                  |
// |----------------------------------------------|----------------------------------------------|
// | constants that the user named                | why_unfit() (sources.h) says nothing         |
// | a calibration file (method 2)                | the same, it was recorded under `current`,   |
// |                                              | its solution is verified, and it may lend    |
// |                                              | its constants (gate.h, why_not_lent())       |
// | the file's own still periods (method 1)      | their solution is verified                   |
// | the store (method 3, the jig) or a snapshot  | it has a set of this unit under `current`    |
// | the unit's other files in this run           | repair/units/unit_answer.h has some          |
//
// A calibration file recorded under `legacy` would make the data worse, so it is refused.
#pragma once

#include <mutex>
#include <optional>
#include <string>

#include "calib/solve.h"
#include "db/store.h"
#include "repair/rescale/constants_snapshot.h"
#include "repair/rescale/repair_file.h"
#include "repair/rescale/sources.h"
#include "repair/rescale/unit_constants.h"

namespace sixpoint::repair {

struct ConstantsFinderOptions {
  // Constants from a file that the user named.
  std::optional<calib::ConstantsRecord> given;
  // Not owned; may be null.
  db::Store* store = nullptr;
  // What the store answered earlier, instead of the store (an archive's shards). Not owned; may be
  // null.
  const ConstantsSnapshot* snapshot = nullptr;
  std::optional<std::string> calibration_file;
  // The unit's other files. Not owned; may be null: they are not asked then.
  UnitConstants* unit = nullptr;
  // What the user named beside the members above. A store that no one named is the default store.
  bool scan = false;
  bool store_named = false;
  // The file's own still periods, where a named source has nothing that fits.
  bool or_scan = false;
  // A prior over a model's constants is no measurement of this unit: used only when asked for.
  bool allow_prior = false;
  calib::SolveOptions solve;
  calib::StillBlockOptions still;
};

// The sources that a finder with these options asks, in order.
std::vector<SourceKind> sources_in_order(const ConstantsFinderOptions& options);

// Solves the still blocks of a surveyed recording; serial and filter of the report are filled in, and
// its notes say all that matters for people: also why the constants are not for other recordings.
// bad_data where the recording's constants cannot be undone, its scale is not known, or it was
// repaired already.
Result<calib::SolveReport> solve_survey(const std::string& path, const Survey& survey,
                                        const calib::SolveOptions& options);

// What a recording is that constants are solved from, as ConstantsOrigin::kind has it:
//
// | at rest             | length        | kind             |
// |---------------------|---------------|------------------|
// | at least half of it | up to 2 hours | calibration_file |
// | otherwise           |               | file_scan        |
std::string recording_kind(const Survey& survey);

// Safe to call from several threads: store and calibration file are read by one at a time.
class ConstantsFinder final : public ConstantsSource {
 public:
  ConstantsFinder(Env& env, ConstantsFinderOptions options);
  Result<ConstantsChoice> choose(const std::string& path, const Survey& survey) override;
  // Of the sources before the first that needs samples.
  std::optional<ChosenConstants> foreseen(const FileFacts& facts) override;

 private:
  struct CalibrationFile {
    std::optional<calib::ConstantsRecord> record;
    std::string serial;
    std::string refusal;  // why there is no record
  };
  Status ask(SourceKind kind, const std::string& path, const Survey& survey,
             ConstantsChoice& choice);
  Status ask_store(const Survey& survey, ConstantsChoice& choice);
  void ask_calibration_file(const Survey& survey, ConstantsChoice& choice);
  Status ask_scan(const std::string& path, const Survey& survey, ConstantsChoice& choice);
  CalibrationFile read_calibration_file(const std::string& path);

  Env& env_;
  ConstantsFinderOptions options_;
  std::mutex mutex_;
  std::optional<CalibrationFile> calibration_file_;
};

}  // namespace sixpoint::repair

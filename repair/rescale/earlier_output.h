// What an output that is there already means: done, made otherwise than now, changed, or not ours.
//
//   const std::string now = recipe_digest(recipe);
//   if (judge_earlier_output(found, known, input_sha256, now) == EarlierOutput::done) {
//     // it was made from this very input, as it would be made now
//   }
//
// | output there | its mark names this input | known SHA-256 | recipe of its mark | answer   |
// |--------------|---------------------------|---------------|--------------------|----------|
// | no           | -                         | -             | -                  | none     |
// | yes          | no, or it has no mark     | -             | -                  | foreign  |
// | yes          | yes                       | another       | -                  | changed  |
// | yes          | yes                       | its own, none | the same           | done     |
// | yes          | yes                       | its own, none | another, or none   | outdated |
//
// Known is what the folder's manifest says of the output. It is none where the manifest has no line
// of the output, where that line is of another input, and where the mark says that the output was
// made after the manifest was written: by a run that could not write its own.
//
// An output that is `done` by this table is one only if all its entries but its mark are those that
// would be written now, in their order, and nothing lies behind them (repair_file.cpp,
// compare_with_output()); else it is `changed`.
#pragma once

#include <optional>
#include <string>

#include "base/time.h"
#include "calib/constants.h"

namespace sixpoint::repair {

// Raised whenever this program makes other bytes of the same file, constants and options.
inline constexpr int kRepairRules = 3;

// All that decides the bytes of a repaired file, beside the file itself.
struct Recipe {
  std::optional<calib::ConstantsRecord> constants;
  bool rotation_undone = false;
  bool wide = false;
  bool store_only = false;
  bool salvaged = false;  // something was lost
  int rules = kRepairRules;
};
// 64 hex digits; the mark carries it.
std::string recipe_digest(const Recipe& recipe);

// An output that is there, and what its mark says (empty where it does not say).
struct FoundOutput {
  std::string input_sha256;
  std::string recipe;
  std::optional<UtcTime> made_at;
  std::string sha256;  // of the whole output
};

// What the manifest of an earlier run says of an output.
struct KnownOutput {
  std::string input_sha256;
  std::string sha256;
  UtcTime as_of;  // when the manifest was written
};

enum class EarlierOutput { none, foreign, changed, done, outdated };
EarlierOutput judge_earlier_output(const std::optional<FoundOutput>& found,
                                   const std::optional<KnownOutput>& known,
                                   const std::string& input_sha256, const std::string& recipe);

}  // namespace sixpoint::repair

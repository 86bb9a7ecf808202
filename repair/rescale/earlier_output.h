// What an output that is there already means: done, made otherwise than now, or not ours.
//
//   const std::string now = recipe_digest(recipe);
//   if (judge_earlier_output(found, input_sha256, now) == EarlierOutput::done) {
//     // nothing to do: it was made from this very input, as it would be made now
//   }
//
// | output there | its mark names this input | recipe of its mark | answer   |
// |--------------|---------------------------|--------------------|----------|
// | no           | -                         | -                  | none     |
// | yes          | no, or it has no mark     | -                  | foreign  |
// | yes          | yes                       | the same           | done     |
// | yes          | yes                       | another, or none   | outdated |
#pragma once

#include <optional>
#include <string>

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
};

enum class EarlierOutput { none, foreign, done, outdated };
EarlierOutput judge_earlier_output(const std::optional<FoundOutput>& found,
                                   const std::string& input_sha256, const std::string& recipe);

}  // namespace sixpoint::repair

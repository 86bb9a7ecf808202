// One unit, many files: which constants its affected files have together. A sensor keeps its
// constants within a few mg, so what one file lacks another may hold.
//
//   const UnitAnswer answer = unit_answer(files, now);   // all of one serial number
//   if (answer.record) {
//     answer.record->brief();
//   }
//
// The first row that fits decides:
//
// | the unit's files in this run                           | row           | constants          |
// |--------------------------------------------------------|---------------|--------------------|
// | one                                                    | alone         | none: it was asked |
// | of several serial numbers                              | contradiction | none               |
// | one or more have verified constants of their own, and  | sibling       | of a calibration   |
// | all of these agree with the best                       |               | file before others,|
// |                                                        |               | then the surest,   |
// |                                                        |               | then the earliest  |
// | ... one of them disagrees with the best                | contradiction | none               |
// | none has a still period                                | missing       | none               |
// | the data contradict constants of all still periods     | contradiction | none               |
// | together (calib/verify.h)                              |               |                    |
// | ... a file is beyond kUnitTolerance_mg by them         | contradiction | none               |
// | ... they are verified                                  | pooled        | of all together    |
// | otherwise                                              | missing       | none               |
//
// Files that only help (may_help(): not affected, but recorded under the same filter configuration,
// `current`, by a unit that was calibrated again later) are asked last, and can take nothing away:
//
// | the affected files by themselves     | with those that only help | answer                |
// |--------------------------------------|---------------------------|-----------------------|
// | have verified constants of their own | not looked at             | of the affected files |
// | are pooled                           | not looked at             | of the affected files |
// | contradict one another               | not looked at             | of the affected files |
// | one, or missing                      | pooled                    | pooled, of all        |
// | one, or missing                      | otherwise                 | of the affected files |
//
// Own constants agree as calib/application/agreement.h has it. A file's distance is the root mean
// square over its directions of |magnitude - 1 g|. A file that is there twice, under whatever name,
// counts once. The order in which files are given makes no difference.
//
// Pooled constants hold for the temperatures of all files: their zeros get the standard uncertainty
// of kTemperatureAllowance_mg (agreement.h) as a half-width, 10 / sqrt(3) = 5.8 mg, beside their
// own. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "calib/constants.h"
#include "calib/still_blocks.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {

// As far as one file may be from 1 g by constants of all. The six constants of a real wGT3X-BT
// leave 8.5 mg (calib/verify.h), and 20 C of another temperature move each zero by 10 mg, which is
// 10 mg over the sphere: together 13 mg. Another unit's constants leave 50 mg and more.
inline constexpr double kUnitTolerance_mg = 16;

struct UnitFile {
  std::string path;
  std::string serial;
  calib::Calibration file_constants;          // those that are undone
  std::vector<calib::StillBlock> blocks;      // mean_lsb counts; mean_g is made anew
  std::optional<calib::ConstantsRecord> own;  // verified
  bool is_calibration_file = false;
  bool only_helps = false;  // not affected: it needs no constants itself
};

enum class UnitRow { alone, sibling, pooled, contradiction, missing };
std::string_view to_string(UnitRow row);

struct UnitAnswer {
  UnitRow row = UnitRow::alone;
  std::optional<calib::ConstantsRecord> record;
  std::string why;            // one sentence: where they are from, or why there are none
  std::size_t files = 0;      // without copies
  bool own_suffices = false;  // of the only file, or of one of them
  // By the file's own constants, or where there are new ones by these: "+x" ... "-z".
  std::vector<std::string> missing_sides;
};

// Whether the still periods of a file that is not affected tell about the sensor as the unit's
// affected files saw it. Constants belong to a filter configuration: the same sensor has others
// under `legacy`, so a file of firmware below 1.4.0 or from 1.8.0 on of a unit calibrated before
// 2014-03-24 must not be asked.
//
// | verdict      | filter in force | may help |
// |--------------|-----------------|----------|
// | not_affected | current         | yes      |
// | not_affected | legacy          | no       |
// | not_affected | cannot be told  | no       |
// | any other    | any             | no       |
bool may_help(const FileFacts& facts);

UnitAnswer unit_answer(std::vector<UnitFile> files, UtcTime now);

}  // namespace sixpoint::repair

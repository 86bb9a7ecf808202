// What a repair changes in the results of a whole study: file by file, and in all of them together.
//
//   StudyImpact study;
//   study.cuts = {{"moderate", Measure::enmo_mg, 100}};
//   study.files.push_back({"in/a.gt3x", "out/a.gt3x", before, after, {}});  // two ImpactSummary
//   study.summary().moved;  // files whose ENMO moves by more than twice its uncertainty
//   const std::string text = study.brief();
//
// Uncertainties of files are not put together: those of one unit have a common cause, those of
// different units have not, and how many units there are is not asked here.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "repair/impact/impact.h"

namespace sixpoint::repair {

struct FileImpact {
  std::string before;  // paths
  std::string after;   // empty: it was not looked for, since `before` cannot be read
  ImpactSummary was;   // with the cut points of the study
  ImpactSummary is;
  std::optional<Error> error;  // why there is no answer for this file
};

// How far a file's mean ENMO moves:
//
// | the copy's uncertainty | the mean moves by              | answer     |
// |------------------------|--------------------------------|------------|
// | is not stated          | any                            | nothing    |
// | stated                 | more than twice of it          | true       |
// | stated                 | twice of it at the most        | false      |
std::optional<bool> moves(const FileImpact& file);

struct StudyImpact {
  struct Summary {
    std::size_t files = 0;  // with an answer
    std::size_t failed = 0;
    double recorded_minutes = 0;  // of the copies
    // Means over the files, each weighted by its recorded minutes.
    double enmo_before_mg = 0;
    double enmo_after_mg = 0;
    double mad_before_mg = 0;
    double mad_after_mg = 0;
    std::vector<double> minutes_before;  // sums, by cut point
    std::vector<double> minutes_after;
    std::size_t moved = 0;    // by moves()
    std::size_t unknown = 0;  // moves() has no answer
    double most_mg = 0;       // the largest change of a file's mean ENMO, with its sign
    std::string most_file;
  };

  int epoch_s = EpochOptions{}.epoch_s;
  std::vector<CutPoint> cuts;
  std::vector<FileImpact> files;
  std::size_t without_copy = 0;  // files that have no repaired copy: they are not in the means

  Summary summary() const;
  std::string brief() const;  // a line per file, then the summary
  bool usable() const { return summary().files > 0; }
  nlohmann::ordered_json to_json() const;
};

// A line per file.
std::string study_csv(const StudyImpact& study);

}  // namespace sixpoint::repair

#include "repair/triage/scan_file.h"

#include <fmt/format.h>

#include "calib/coverage.h"
#include "repair/triage/agd.h"
#include "repair/triage/file_tree.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

ScannedFile unreadable_file(const std::string& path, const Error& error) {
  ScannedFile answer;
  answer.path = path;
  answer.verdict = "unreadable";
  Error short_error = error;
  short_error.where.clear();  // the line names the file already
  answer.reasons.push_back(short_error.brief());
  answer.error = error;
  return answer;
}

namespace {

void judge(ScannedFile& answer, bool repaired) {
  const bool fits = !answer.evidence_mg || *answer.evidence_mg <= kEvidenceLimit_mg;
  if (repaired) {
    answer.verdict = to_string(fits ? Verdict::not_affected : Verdict::cannot_tell);
    answer.reasons.insert(
        answer.reasons.begin(),
        fits ? "already repaired by sixpoint"
             : "already repaired by sixpoint, with constants that do not fit, or the unit has a "
               "defect: repair the original again");
    return;
  }
  const Triage triage = repair::triage(answer.facts);
  answer.verdict = to_string(triage.verdict);
  answer.axes_rotated = triage.axes_rotated;
  answer.reasons.insert(answer.reasons.begin(), triage.reasons.begin(), triage.reasons.end());
  if (triage.verdict == Verdict::affected && answer.evidence_mg && fits) {
    answer.reasons.push_back(
        fmt::format("its still periods are within {:.0f} mg of 1 g all the same: it may have been "
                    "corrected by other software; repair writes it only where that improves it",
                    kEvidenceLimit_mg));
  }
  if (triage.verdict == Verdict::not_affected && !fits) {
    answer.reasons.emplace_back(
        "16CPAN03 is not why they do not fit: the unit may hold another one's constants, or have a "
        "defect");
  }
}

// Where the recording of an .agd may lie: NAME.gt3x beside NAME.agd, and beside NAME60sec.agd,
// which is what ActiLife calls its epochs of 60 seconds.
std::vector<std::string> recordings_of_agd(const std::string& path) {
  std::string stem = path.substr(0, path.size() - std::string_view(".agd").size());
  std::vector<std::string> paths = {stem + ".gt3x"};
  if (stem.ends_with("sec")) {
    stem.resize(stem.size() - 3);
    const auto name = stem.find_last_not_of("0123456789");
    if (name != std::string::npos && name + 1 < stem.size()) {
      paths.push_back(stem.substr(0, name + 1) + ".gt3x");
    }
  }
  return paths;
}

void take_date_from_recording(FileSystem& files, ScannedFile& answer) {
  for (const std::string& path : recordings_of_agd(answer.path)) {
    const auto facts = facts_of(files, path);
    if (facts && facts->serial == answer.facts.serial && facts->calibration_time) {
      answer.facts.calibration_time = facts->calibration_time;
      answer.facts.recorded = facts->recorded;
      answer.reasons.push_back("the date of calibration is that of " + path);
      return;
    }
  }
}

ScannedFile scan_agd(FileSystem& files, const std::string& path, const CalibrationLookup& lookup) {
  const auto facts = read_agd_facts(path);
  if (!facts) {
    const bool is_recording = facts_of(files, path).has_value();
    return unreadable_file(
        path, is_recording ? Error{ErrorCode::bad_data, "this is a .gt3x recording and no .agd",
                                   path, "give it a name that ends with .gt3x"}
                           : facts.error());
  }
  ScannedFile answer;
  answer.path = path;
  answer.facts = *facts;
  take_date_from_recording(files, answer);
  if (!date_of_constants(answer.facts) && lookup) {
    if (KnownDate known = lookup(answer.facts.serial); !known.why.empty()) {
      answer.facts.calibration_time = known.time;
      answer.reasons.push_back(std::move(known.why));
    }
  }
  judge(answer, false);
  if (answer.verdict != to_string(Verdict::not_affected)) {
    answer.reasons.push_back(
        "an .agd cannot be repaired: make it again from the repaired raw data");
  }
  if (answer.verdict == to_string(Verdict::cannot_tell) && !date_of_constants(answer.facts)) {
    answer.reasons.push_back(
        "put its recording (.gt3x, the same name) beside it, or name a store that knows the unit "
        "(--store): they say the date");
  }
  return answer;
}

ScannedFile scan_recording(FileSystem& files, const std::string& path) {
  ScannedFile answer;
  answer.path = path;
  const auto survey = repair::survey(files, path);
  if (!survey) {
    return unreadable_file(path, survey.error());
  }
  answer.facts = survey->facts;
  answer.reasons = survey->notes;
  answer.sides = calib::coverage_of(survey->blocks).covered_directions();
  if (!survey->raw_counts && !survey->accel_scale_known) {
    answer.reasons.push_back(
        "it does not say how many counts are 1 g, so the samples give no evidence");
  } else if (survey->raw_counts && !survey->agdc) {
    answer.reasons.push_back(
        "it holds raw counts and no calibration.json that fits them, so the samples give no "
        "evidence");
  } else if (survey->magnitude.blocks > 0) {
    answer.evidence_mg = survey->magnitude.p95_mg;
    if (survey->magnitude.p95_mg > kEvidenceLimit_mg) {
      answer.reasons.push_back(
          fmt::format("its {} still periods are {:.0f} mg from 1 g (95th percentile): the "
                      "constants do not fit the data",
                      survey->magnitude.blocks, survey->magnitude.p95_mg));
    }
  } else {
    answer.reasons.push_back("no still periods, so the samples give no evidence");
  }
  if (survey->log.checksum_failures + survey->log.damaged_stretches > 0) {
    answer.reasons.push_back(fmt::format("damage: {} wrong checksums, {} damaged stretches",
                                         survey->log.checksum_failures,
                                         survey->log.damaged_stretches));
  }
  judge(answer, survey->already_repaired);
  return answer;
}

}  // namespace

ScannedFile scan_file(FileSystem& files, const std::string& path, const CalibrationLookup& lookup) {
  return has_ending(path, ".agd") ? scan_agd(files, path, lookup) : scan_recording(files, path);
}

}  // namespace sixpoint::repair

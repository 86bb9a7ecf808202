#include "repair/triage/scan_file.h"

#include <fmt/format.h>

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
}

ScannedFile scan_agd(const std::string& path) {
  const auto facts = read_agd_facts(path);
  if (!facts) {
    return unreadable_file(path, facts.error());
  }
  ScannedFile answer;
  answer.path = path;
  answer.facts = *facts;
  answer.reasons.push_back("an .agd cannot be repaired: make it again from the repaired raw data");
  judge(answer, false);
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
  if (survey->magnitude.blocks > 0) {
    answer.evidence_mg = survey->magnitude.p95_mg;
    if (survey->magnitude.p95_mg > kEvidenceLimit_mg) {
      answer.reasons.push_back(
          fmt::format("still periods are up to {:.0f} mg from 1 g (95th percentile of {}): the "
                      "constants do not fit the data",
                      survey->magnitude.p95_mg, survey->magnitude.blocks));
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

ScannedFile scan_file(FileSystem& files, const std::string& path) {
  return has_ending(path, ".agd") ? scan_agd(path) : scan_recording(files, path);
}

}  // namespace sixpoint::repair

#include "repair/rescale/gate.h"

#include <fmt/format.h>

#include "repair/triage/scan_file.h"

namespace sixpoint::repair {
namespace {

GateRow row_of(const GateEvidence& evidence) {
  if (evidence.still_blocks == 0) {
    return GateRow::not_checked;
  }
  if (evidence.after_mg > evidence.before_mg) {
    return GateRow::worse;
  }
  if (evidence.before_mg <= kEvidenceLimit_mg &&
      evidence.after_mg > evidence.before_mg - kLeastGain_mg) {
    return GateRow::no_better;
  }
  return evidence.after_mg > kMostLeft_mg ? GateRow::too_much_left : GateRow::helps;
}

std::string reason_of(GateRow row, const GateEvidence& evidence) {
  const auto both = [&](std::string_view text) {
    return fmt::format(fmt::runtime(text), fmt::arg("before", evidence.before_mg),
                       fmt::arg("after", evidence.after_mg));
  };
  switch (row) {
    case GateRow::not_checked:
      return "the file has no still periods: whether the repair helps could not be checked";
    case GateRow::worse:
      return both(
          "the repair would make it worse: still error {before:.1f} mg before, {after:.1f} mg "
          "after");
    case GateRow::no_better:
      return both(
          "the file is within 64 mg as it is, perhaps corrected before, and the repair does not "
          "improve it: still error {before:.1f} mg before, {after:.1f} mg after");
    case GateRow::too_much_left:
      return both(
          "the constants do not fit the file: still error {before:.1f} mg before, {after:.1f} mg "
          "after, more than the 32 mg that right constants can leave");
    case GateRow::helps:
      break;
  }
  return {};
}

}  // namespace

GateEvidence gate_evidence(const Survey& survey, const calib::Calibration& fresh) {
  std::vector<calib::StillBlock> after = survey.blocks;
  for (calib::StillBlock& block : after) {
    block.mean_g = fresh.to_g(block.mean_lsb);
  }
  return {survey.blocks.size(), survey.magnitude.mean_mg, magnitude_error(after).mean_mg};
}

GateAnswer gate(const GateEvidence& evidence, bool force) {
  GateAnswer answer;
  answer.row = row_of(evidence);
  answer.reason = reason_of(answer.row, evidence);
  const bool refused = answer.row != GateRow::not_checked && answer.row != GateRow::helps;
  answer.write = !refused || force;
  answer.forced = refused && force;
  return answer;
}

}  // namespace sixpoint::repair

#include "repair/rescale/gate.h"

#include <algorithm>

#include <fmt/format.h>

#include "calib/direction_cells.h"
#include "repair/triage/scan_file.h"

namespace sixpoint::repair {
namespace {

double most_left_mg(const GateEvidence& evidence) {
  return evidence.directions < kLeastDirections ? kMostLeftInFewDirections_mg : kMostLeft_mg;
}

GateRow row_of(const GateEvidence& evidence) {
  if (evidence.directions == 0) {
    return evidence.refuted_by.empty() ? GateRow::not_checked : GateRow::refuted;
  }
  if (evidence.after_mg > evidence.before_mg) {
    return GateRow::worse;
  }
  if (evidence.before_mg <= kEvidenceLimit_mg &&
      evidence.after_mg > evidence.before_mg - kLeastGain_mg) {
    return GateRow::no_better;
  }
  if (evidence.written_mg && *evidence.written_mg >= evidence.before_mg) {
    return GateRow::rounded_away;
  }
  if (evidence.after_mg > most_left_mg(evidence)) {
    return GateRow::too_much_left;
  }
  if (evidence.directions >= kLeastDirections) {
    return GateRow::helps;
  }
  return evidence.before_mg <= kMostLeft_mg && !evidence.counts_are_the_units_own
             ? GateRow::ambiguous
             : GateRow::weak;
}

bool is_refused(GateRow row) {
  return row == GateRow::refuted || row == GateRow::worse || row == GateRow::no_better ||
         row == GateRow::rounded_away || row == GateRow::too_much_left || row == GateRow::ambiguous;
}

// By constants with a slope above 1 some stored counts have no raw count behind them; a hundredth
// of them shows another origin for certain (PlausibilityTally).
bool counts_are_the_units_own(const Survey& survey) {
  constexpr double kLeastSlope = 1.01;
  const auto shows = [&](const StoredConstants& constants) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const int span_lsb = constants.positive_lsb[a] - constants.negative_lsb[a];
      if (2 * survey.accel_scale_lsb_per_g > kLeastSlope * span_lsb) {
        return true;
      }
    }
    return false;
  };
  return survey.plausibility.plausible() && std::ranges::all_of(survey.constants, shows);
}

std::string reason_of(GateRow row, const GateEvidence& evidence) {
  const auto both = [&](std::string_view text) {
    return fmt::format(fmt::runtime(text), fmt::arg("before", evidence.before_mg),
                       fmt::arg("after", evidence.after_mg));
  };
  switch (row) {
    case GateRow::refuted:
      return fmt::format(
          "the file has no still periods, and those of {}, of the same unit, speak against these "
          "constants: find out what is wrong there, or use other constants",
          printable(evidence.refuted_by));
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
    case GateRow::rounded_away:
      return fmt::format(
          "what the repair would gain is lost when samples are rounded to counts: still error "
          "{:.1f} mg before, {:.1f} mg after",
          evidence.before_mg, evidence.written_mg.value_or(0));
    case GateRow::too_much_left:
      return both(
                 "the constants do not fit the file: still error {before:.1f} mg before, "
                 "{after:.1f} mg after") +
             fmt::format(", more than the {:.0f} mg that right constants can leave",
                         most_left_mg(evidence));
    case GateRow::ambiguous:
      return both(
          "the still periods lie in few directions and look right as they are: still error "
          "{before:.1f} mg before, {after:.1f} mg after; other software may have corrected the "
          "file");
    case GateRow::weak:
      return fmt::format(
          "the still periods lie in {} of the at least {} directions that show every constant: the "
          "check is weak",
          evidence.directions, kLeastDirections);
    case GateRow::helps:
      break;
  }
  return {};
}

}  // namespace

GateEvidence gate_evidence(const Survey& survey, const calib::Calibration& fresh,
                           const PerAxis<double>& cross_axis) {
  calib::CrossAxisMap map;
  map.calibration = fresh;
  map.cross_axis = cross_axis;
  std::vector<calib::StillBlock> after = survey.blocks;
  for (calib::StillBlock& block : after) {
    block.mean_g = map.to_g(block.mean_lsb);
  }
  std::vector<calib::DirectionCell> cells = calib::cells_of(after);
  return {calib::number_neighbourhoods(cells, fresh),
          survey.magnitude.mean_mg,
          magnitude_error(after).mean_mg,
          counts_are_the_units_own(survey),
          std::nullopt,
          {}};
}

std::string why_legacy_repairs_none(const FileFacts& facts) {
  if (filter_in_force(facts) != calib::FilterConfiguration::legacy) {
    return {};
  }
  return fmt::format(
      "it was recorded under the legacy configuration (firmware {} chose it): its constants repair "
      "no affected "
      "file; record one with firmware 1.4.0 to 1.7.0, or put the unit on the jig",
      printable(facts.firmware, 40));
}

std::string why_not_lent(const Survey& survey) {
  FileFacts one = survey.facts;
  one.other_firmware.clear();
  FileFacts other = one;
  other.firmware = survey.facts.other_firmware;
  const bool turns = triage(one).axes_rotated != triage(other).axes_rotated;
  if (!other.firmware.empty() && (turns || filter_in_force(one) != filter_in_force(other))) {
    return fmt::format(
        "the recording names the firmware versions {} and {}, which {} differently: its constants "
        "are not "
        "used for other recordings",
        printable(one.firmware, 40), printable(other.firmware, 40),
        turns ? "lay the axes" : "set the filter");
  }
  if (triage(survey.facts).verdict != Verdict::affected || survey.constants.empty()) {
    return {};
  }
  const auto stored = calib::calibration_from(survey.constants.front());
  if (!stored) {
    return {};
  }
  const GateEvidence evidence = gate_evidence(survey, *stored);
  if (evidence.directions < kLeastDirections || evidence.before_mg > kMostOfCorrected_mg ||
      evidence.counts_are_the_units_own) {
    return {};
  }
  return fmt::format(
      "the recording is affected by its header, and within {:.0f} mg of 1 g as it is: other "
      "software may have corrected it, so its constants are not used for other recordings",
      kMostOfCorrected_mg);
}

bool refutes(GateRow row, const GateEvidence& evidence) {
  return row == GateRow::worse || row == GateRow::too_much_left ||
         (row == GateRow::rounded_away && evidence.before_mg > kMostOfCorrected_mg);
}

std::string what_may_help(bool own_asked, std::size_t sides) {
  constexpr std::size_t kAllSides = 6;
  return !own_asked && sides == kAllSides
             ? "what may help: --scan in place of these constants uses the unit's own still "
               "periods, in which all sides were up"
             : "what may help: the unit on the jig, or a calibration file made by it under "
               "firmware "
               "1.4.0 to 1.7.0";
}

GateAnswer gate(const GateEvidence& evidence, bool force) {
  GateAnswer answer;
  answer.row = row_of(evidence);
  answer.reason = reason_of(answer.row, evidence);
  const bool refused = is_refused(answer.row);
  answer.write = !refused || force;
  answer.forced = refused && force;
  return answer;
}

}  // namespace sixpoint::repair

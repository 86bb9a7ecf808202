#include "repair/rescale/constants_finder.h"

#include <fmt/format.h>

#include "base/sha256.h"
#include "db/records.h"
#include "repair/rescale/gate.h"

namespace sixpoint::repair {
namespace {

std::string joined(const std::vector<std::string>& parts) {
  return fmt::format("{}", fmt::join(parts, "; "));
}

// Why a report has no verified constants, in one sentence.
std::string refusal_of(const calib::SolveReport& report) {
  std::string text = joined(report.verification.reasons);
  const auto& missing = report.verification.missing_directions;
  if (!missing.empty()) {
    text += fmt::format("{}no still period on the sides {}", text.empty() ? "" : "; ",
                        fmt::join(missing, " "));
  }
  return text;
}

}  // namespace

Result<calib::SolveReport> solve_survey(const std::string& path, const Survey& survey,
                                        const calib::SolveOptions& options) {
  if (survey.already_repaired) {
    return fail(
        ErrorCode::bad_data,
        "the recording was repaired already; its counts no longer come from the unit's constants",
        path, "use the original recording");
  }
  if (!survey.raw_counts && !survey.accel_scale_known) {
    return fail(ErrorCode::bad_data,
                "the recording does not say how many counts are 1 g, and its model is not known",
                path, "use a recording whose info.txt has the line 'Acceleration Scale'");
  }
  calib::Calibration file_constants;
  calib::SolveOptions how = options;
  if (survey.raw_counts && survey.agdc) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      file_constants.sensitivity_g_per_lsb[a] = survey.agdc->sensitivity_g_per_lsb[a][a];
      file_constants.zero_lsb[a] = survey.agdc->offset_lsb[a];
    }
    how.file_g = [agdc = *survey.agdc](const PerAxis<double>& mean_lsb) {
      return agdc.apply_to_mean(mean_lsb);
    };
  } else if (survey.constants_problem.has_value()) {
    return fail(*survey.constants_problem);
  } else {
    SIXPOINT_ASSIGN(file_constants, calib::calibration_from(survey.constants.front()));
  }
  SIXPOINT_ASSIGN(auto report, calib::solve_from_still_blocks(survey.blocks, file_constants, how));
  report.serial = survey.facts.serial;
  report.filter = filter_in_force(survey.facts);
  report.notes.insert(report.notes.end(), survey.notes.begin(), survey.notes.end());
  report.temperature =
      calib::temperature_drift(survey.resting, report.calibration.value_or(file_constants));
  if (report.temperature) {
    const calib::TemperatureDrift& drift = *report.temperature;
    report.notes.push_back(fmt::format(
        "left lying from {:.0f} to {:.0f} C, the zeros drift by {:+.2f} {:+.2f} {:+.2f} mg/C (X Y "
        "Z)",
        drift.low_c, drift.high_c, drift.zero_mg_per_c[0], drift.zero_mg_per_c[1],
        drift.zero_mg_per_c[2]));
  }
  for (std::string why : {why_not_lent(survey), why_legacy_repairs_none(survey.facts)}) {
    if (!why.empty()) {
      report.notes.push_back(std::move(why));
    }
  }
  return report;
}

std::string recording_kind(const Survey& survey) {
  constexpr double kLongest_s = 2 * 3600;
  double still_s = 0;
  for (const calib::StillBlock& block : survey.blocks) {
    still_s += block.samples / survey.rate_hz;
  }
  return survey.duration_s <= kLongest_s && still_s >= survey.duration_s / 2 ? "calibration_file"
                                                                             : "file_scan";
}

std::vector<SourceKind> sources_in_order(const ConstantsFinderOptions& options) {
  const bool has_store = options.store != nullptr || options.snapshot != nullptr;
  NamedSources named;
  named.constants = options.given.has_value();
  named.calibration_file = options.calibration_file.has_value();
  named.scan = options.scan;
  named.store = has_store && options.store_named;
  named.or_scan = options.or_scan;
  named.default_store = has_store && !options.store_named;
  named.unit_files = options.unit != nullptr;
  return sources_in_order(named);
}

ConstantsFinder::ConstantsFinder(Env& env, ConstantsFinderOptions options)
    : env_(env), options_(std::move(options)) {}

Status ConstantsFinder::ask_store(const Survey& survey, ConstantsChoice& choice) {
  const std::lock_guard lock(mutex_);
  std::optional<ConstantsSnapshot::Entry> found;
  if (options_.snapshot != nullptr) {
    if (const auto* entry = options_.snapshot->find(survey.facts.serial); entry != nullptr) {
      found = *entry;
    }
  } else {
    SIXPOINT_ASSIGN(found, ConstantsSnapshot::of_unit(*options_.store, survey.facts.serial));
  }
  if (!found.has_value() || !found->withdrawn.empty()) {
    choice.reasons.push_back(fmt::format(
        "the store holds no constants of {} under the current configuration{}", survey.facts.serial,
        found ? fmt::format(" that apply; withdrawn: {}", found->withdrawn) : ""));
    return {};
  }
  if (!found->conflict.empty()) {
    choice.reasons.push_back(found->conflict);
    choice.for_a_person = true;
    return {};
  }
  SIXPOINT_ASSIGN(auto record, calib::parse_constants_record(found->document));
  choice.chosen = ChosenConstants{std::move(record), "store", found->id};
  if (!found->doubt.empty()) {
    choice.reasons.push_back(found->doubt);
  }
  return {};
}

ConstantsFinder::CalibrationFile ConstantsFinder::read_calibration_file(const std::string& path) {
  CalibrationFile result;
  const auto surveyed = survey(env_.files, path, options_.still);
  if (!surveyed) {
    result.refusal = surveyed.error().brief();
    return result;
  }
  result.serial = surveyed->facts.serial;
  if (!filter_in_force(surveyed->facts)) {
    result.refusal = "it cannot be told under which filter configuration it was recorded";
    return result;
  }
  result.refusal = why_legacy_repairs_none(surveyed->facts);
  if (result.refusal.empty()) {
    result.refusal = why_not_lent(*surveyed);
  }
  if (!result.refusal.empty()) {
    return result;
  }
  const auto report = solve_survey(path, *surveyed, options_.solve);
  if (!report) {
    result.refusal = report.error().brief();
    return result;
  }
  if (!report->usable()) {
    result.refusal = refusal_of(*report);
    return result;
  }
  calib::ConstantsOrigin origin;
  origin.file = db::storable_path(path);
  origin.kind = "calibration_file";
  auto hash = file_sha256(env_.files, path);
  if (!hash) {
    result.refusal = hash.error().brief();
    return result;
  }
  origin.sha256 = *std::move(hash);
  auto record = calib::record_of(*report, env_.clock.now(), origin);
  if (!record) {
    result.refusal = record.error().brief();
    return result;
  }
  result.record = *std::move(record);
  return result;
}

void ConstantsFinder::ask_calibration_file(const Survey& survey, ConstantsChoice& choice) {
  const std::lock_guard lock(mutex_);
  if (!calibration_file_.has_value()) {
    calibration_file_ = read_calibration_file(*options_.calibration_file);
  }
  const CalibrationFile& file = *calibration_file_;
  if (!file.serial.empty() && file.serial != survey.facts.serial) {
    choice.reasons.push_back(fmt::format("the calibration file was made by unit {}, not by {}",
                                         printable(file.serial, 60),
                                         printable(survey.facts.serial, 60)));
  } else if (file.record.has_value()) {
    choice.chosen = ChosenConstants{*file.record, "calibration_file", ""};
  } else {
    choice.reasons.push_back("the calibration file cannot be used: " + file.refusal);
  }
}

Status ConstantsFinder::ask_scan(const std::string& path, const Survey& survey,
                                 ConstantsChoice& choice) {
  SIXPOINT_ASSIGN(const auto report, solve_survey(path, survey, options_.solve));
  if (!report.usable()) {
    if (options_.unit != nullptr) {
      options_.unit->add(path, survey, nullptr);
    }
    choice.reasons.push_back("its own still periods do not suffice: " + refusal_of(report));
    return {};
  }
  calib::ConstantsOrigin origin;
  origin.file = db::storable_path(path);
  origin.kind = "file_scan";
  SIXPOINT_ASSIGN(auto record, calib::record_of(report, env_.clock.now(), origin));
  if (options_.unit != nullptr) {
    options_.unit->add(path, survey, &record);
  }
  choice.chosen = ChosenConstants{std::move(record), "scan", ""};
  return {};
}

Status ConstantsFinder::ask(SourceKind kind, const std::string& path, const Survey& survey,
                            ConstantsChoice& choice) {
  switch (kind) {
    case SourceKind::constants:
      choice.chosen = ChosenConstants{*options_.given, "constants", ""};
      break;
    case SourceKind::calibration_file:
      ask_calibration_file(survey, choice);
      break;
    case SourceKind::scan:
      SIXPOINT_CHECK(ask_scan(path, survey, choice));
      break;
    case SourceKind::store:
      SIXPOINT_CHECK(ask_store(survey, choice));
      break;
    case SourceKind::unit_files:
      options_.unit->ask(path, survey, choice);
      break;
  }
  if (choice.chosen) {
    if (auto why = why_unfit(choice.chosen->record, survey.facts, options_.allow_prior)) {
      choice.reasons.push_back(*std::move(why));
      choice.chosen.reset();
    }
  }
  return {};
}

Result<ConstantsChoice> ConstantsFinder::choose(const std::string& path, const Survey& survey) {
  ConstantsChoice choice;
  bool lacks_still_periods = false;
  for (const SourceKind kind : sources_in_order(options_)) {
    SIXPOINT_CHECK(ask(kind, path, survey, choice));
    if (choice.chosen || (choice.for_a_person && !options_.or_scan)) {
      break;
    }
    lacks_still_periods = lacks_still_periods || kind == SourceKind::scan;
  }
  if (!choice.chosen && lacks_still_periods) {
    choice.reasons.emplace_back(
        "needed: the unit on the jig, or a calibration file made by it under firmware 1.4.0 to "
        "1.7.0, lying still on each of its six sides");
  }
  return choice;
}

std::optional<ChosenConstants> ConstantsFinder::foreseen(const FileFacts& facts) {
  Survey head;
  head.facts = facts;
  ConstantsChoice choice;
  for (const SourceKind kind : sources_in_order(options_)) {
    if (kind == SourceKind::scan || kind == SourceKind::unit_files ||
        !ask(kind, {}, head, choice) || choice.for_a_person) {
      return std::nullopt;
    }
    if (choice.chosen) {
      return std::move(choice.chosen);
    }
  }
  return std::nullopt;
}

}  // namespace sixpoint::repair

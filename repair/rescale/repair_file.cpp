#include "repair/repair_file.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "repair/rescaled_log.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kLargestMark = 1U << 20;

Json mark_of(const RepairReport& report, const std::optional<ChosenConstants>& chosen,
             const Survey& survey, UtcTime now) {
  Json mark;
  mark["schema"] = "sixpoint/repair-mark/1";
  mark["repaired_at"] = to_iso8601(now);
  mark["input_sha256"] = report.input_sha256;
  mark["serial"] = report.serial;
  mark["method"] = report.method;
  mark["rotation_undone"] = report.rotation_undone;
  mark["constants_before"] = Json::array();
  for (const StoredConstants& constants : survey.constants) {
    mark["constants_before"].push_back(calib::to_json(constants));
  }
  mark["constants_after"] = chosen ? calib::to_json(chosen->record) : Json(nullptr);
  mark["constants_id"] = report.constants_id.empty() ? Json(nullptr) : Json(report.constants_id);
  return mark;
}

// The mark of a mended file; nothing where there is no such file or mark.
std::optional<Json> mark_in(FileSystem& files, const std::string& path) {
  auto recording = gt3x::Recording::open(files, path);
  if (!recording || !recording->has_entry(kRepairMark)) {
    return std::nullopt;
  }
  auto source = recording->open_entry(kRepairMark);
  if (!source) {
    return std::nullopt;
  }
  const auto bytes = gt3x::read_all(**source, kLargestMark);
  if (!bytes) {
    return std::nullopt;
  }
  auto mark = Json::parse(bytes->begin(), bytes->end(), nullptr, false);
  return mark.is_object() ? std::optional(std::move(mark)) : std::nullopt;
}

std::string text_in(const Json& mark, const char* key) {
  return mark.contains(key) && mark[key].is_string() ? mark[key].get<std::string>() : "";
}

// The writer owns its source and drops it at commit(); the log's tally is wanted after that.
class SharedSource final : public gt3x::ByteSource {
 public:
  explicit SharedSource(std::shared_ptr<gt3x::ByteSource> source) : source_(std::move(source)) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override { return source_->read(out); }
  std::optional<std::uint64_t> size() const override { return source_->size(); }

 private:
  std::shared_ptr<gt3x::ByteSource> source_;
};

class Repair {
 public:
  Repair(Env& env, const std::string& input, const std::string& output, ConstantsSource& source,
         const RepairOptions& options)
      : env_(env), output_(output), source_(source), options_(options) {
    report_.input = input;
    report_.dry_run = options.dry_run;
  }

  RepairReport run() {
    if (Status status = work(); !status) {
      report_.status = RepairStatus::failed;
      report_.error = status.error();
      report_.reasons.push_back(status.error().brief());
      report_.output.clear();
    }
    return std::move(report_);
  }

 private:
  Status work() {
    SIXPOINT_ASSIGN(survey_, survey(env_.files, report_.input, options_.still));
    report_.serial = survey_.facts.serial;
    report_.samples = survey_.samples;
    report_.clipped_before = survey_.clipped_samples;
    report_.clipped_after = survey_.clipped_samples;
    report_.still_blocks = survey_.magnitude.blocks;
    if (survey_.magnitude.blocks > 0) {
      report_.still_error_before_mg = survey_.magnitude.mean_mg;
    }
    if (survey_.already_repaired) {
      report_.status = RepairStatus::already_repaired;
      report_.reasons.emplace_back("the file carries the mark of an earlier repair");
      return {};
    }
    const Triage judged = triage(survey_.facts);
    report_.reasons = judged.reasons;
    const bool rotation_only = judged.verdict == Verdict::not_affected && judged.axes_rotated;
    if (judged.verdict == Verdict::not_affected && !(rotation_only && options_.undo_rotation)) {
      report_.status = RepairStatus::not_affected;
      if (rotation_only) {
        report_.reasons.emplace_back(
            "its constants are right, its axes are not: --undo-rotation turns them back");
      }
      return {};
    }
    if (judged.verdict == Verdict::cannot_tell) {
      report_.status = RepairStatus::not_repairable;
      report_.reasons.emplace_back(
          "what cannot be told affected is not mended: find out what is missing first");
      return {};
    }
    report_.rotation_undone = judged.axes_rotated;
    report_.method = rotation_only ? "rotation" : "";
    if (!rotation_only) {
      if (survey_.constants_problem.has_value()) {
        return fail(*survey_.constants_problem);
      }
      SIXPOINT_CHECK(choose());
      if (!chosen_.has_value()) {
        report_.status = RepairStatus::not_repairable;
        return {};
      }
    }
    return write();
  }

  Status choose() {
    SIXPOINT_ASSIGN(auto choice, source_.choose(report_.input, survey_));
    report_.reasons.insert(report_.reasons.end(), choice.reasons.begin(), choice.reasons.end());
    if (!choice.chosen.has_value()) {
      return {};
    }
    const calib::ConstantsRecord& record = choice.chosen->record;
    if (record.serial != survey_.facts.serial) {
      report_.reasons.push_back(fmt::format("the constants belong to unit {}, not to this one",
                                            printable(record.serial, 60)));
      return {};
    }
    if (record.filter != calib::FilterConfiguration::current) {
      report_.reasons.emplace_back(
          "the constants were measured under the legacy filter configuration; this file was "
          "recorded under the current one: measure the unit under 'current'");
      return {};
    }
    if (record.from_prior && !options_.allow_prior) {
      report_.reasons.emplace_back(
          "the constants rest on a population prior, not on this unit's data; --allow-prior uses "
          "them all the same");
      return {};
    }
    chosen_ = std::move(choice.chosen);
    report_.method = chosen_->method;
    report_.constants_id = chosen_->constants_id;
    return {};
  }

  RescaledLogOptions log_options() const {
    RescaledLogOptions options;
    if (chosen_.has_value()) {
      options.fresh = chosen_->record.calibration;
    }
    options.accel_scale_lsb_per_g = survey_.accel_scale_lsb_per_g;
    options.rate_hz = survey_.rate_hz;
    if (!survey_.constants.empty()) {
      options.first_constants = survey_.constants.front();
    }
    options.undo_rotation = report_.rotation_undone;
    options.wide = options_.wide;
    options.beyond_12_bits = survey_.beyond_12_bits;
    options.affine = chosen_.has_value() && !survey_.plausibility.plausible();
    options.size = options_.wide ? survey_.log_bytes_wide : survey_.log_bytes;
    options.still = options_.still;
    return options;
  }

  void take(RescaledLog& log) {
    report_.clipped_before = log.tally().clipped_before;
    report_.clipped_after = log.tally().clipped_after;
    const MagnitudeError after = log.still_error();
    if (after.blocks > 0) {
      report_.still_error_after_mg = after.mean_mg;
    }
    if (log.tally().affine_counts > 0) {
      report_.reasons.push_back(fmt::format(
          "the counts cannot have come from whole raw counts by the file's constants (averaged, "
          "mended before, or resampled): {} of them mapped by the straight line",
          log.tally().affine_counts));
    }
    if (survey_.log.checksum_failures + survey_.log.damaged_stretches > 0) {
      report_.reasons.push_back(fmt::format(
          "{} records with a wrong checksum and {} damaged stretches were carried over unchanged",
          survey_.log.checksum_failures, survey_.log.damaged_stretches));
    }
    if (survey_.constants.size() > 1) {
      report_.reasons.push_back(fmt::format(
          "the file holds {} different sets of constants; the last before a sample was undone",
          survey_.constants.size()));
    }
  }

  Status write() {
    SIXPOINT_ASSIGN(report_.input_sha256, file_sha256(env_.files, report_.input));
    SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(env_.files, report_.input));
    SIXPOINT_ASSIGN(auto reader, recording.open_log());
    SIXPOINT_ASSIGN(auto made, RescaledLog::make(std::move(reader), log_options()));
    const std::shared_ptr<RescaledLog> log = std::move(made);

    if (options_.dry_run) {
      Bytes piece(1U << 20);
      while (true) {
        SIXPOINT_ASSIGN(const auto count, log->read(piece));
        if (count == 0) {
          break;
        }
      }
      take(*log);
      report_.status = RepairStatus::repaired;
      return {};
    }

    if (env_.files.info(output_)) {
      const auto mark = options_.resume ? mark_in(env_.files, output_) : std::nullopt;
      if (mark && text_in(*mark, "input_sha256") == report_.input_sha256) {
        report_.reasons.emplace_back("mended by an earlier run");
        report_.resumed = true;
        // What was used then, whatever would be chosen today.
        report_.method = text_in(*mark, "method");
        report_.constants_id = text_in(*mark, "constants_id");
        if (const auto then = parse_iso8601(text_in(*mark, "repaired_at")); then) {
          report_.repaired_at = *then;
        }
        report_.output = output_;
        SIXPOINT_ASSIGN(const auto mended, survey(env_.files, output_, options_.still));
        if (mended.magnitude.blocks > 0) {
          report_.still_error_after_mg = mended.magnitude.mean_mg;
        }
        report_.clipped_after = mended.clipped_samples;
        SIXPOINT_ASSIGN(report_.output_sha256, file_sha256(env_.files, output_));
        report_.status = RepairStatus::repaired;
        return {};
      }
      return fail(ErrorCode::cannot_create, "a file of that name is there already", output_,
                  "choose another folder, or --resume to go on with an earlier run");
    }

    SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(env_.files, output_));
    for (const gt3x::EntryInfo& entry : recording.entries()) {
      if (entry.name == "log.bin") {
        SIXPOINT_CHECK(writer.add(entry.name, std::make_unique<SharedSource>(log)));
      } else {
        SIXPOINT_CHECK(writer.copy(recording, entry.name));
      }
    }
    report_.repaired_at = env_.clock.now();
    SIXPOINT_CHECK(
        writer.add(kRepairMark, mark_of(report_, chosen_, survey_, *report_.repaired_at)
                                        .dump(2, ' ', false, Json::error_handler_t::replace) +
                                    "\n"));
    SIXPOINT_CHECK(writer.commit());
    take(*log);
    report_.output = output_;
    SIXPOINT_ASSIGN(report_.output_sha256, file_sha256(env_.files, output_));
    report_.status = RepairStatus::repaired;
    return {};
  }

  Env& env_;
  std::string output_;
  ConstantsSource& source_;
  RepairOptions options_;
  Survey survey_;
  std::optional<ChosenConstants> chosen_;
  RepairReport report_;
};

}  // namespace

std::string_view to_string(RepairStatus status) {
  switch (status) {
    case RepairStatus::repaired:
      return "repaired";
    case RepairStatus::not_affected:
      return "not_affected";
    case RepairStatus::not_repairable:
      return "not_repairable";
    case RepairStatus::already_repaired:
      return "already_repaired";
    case RepairStatus::failed:
      return "failed";
  }
  return "failed";
}

std::string RepairReport::brief() const {
  std::string text = fmt::format("{:<16} {}", to_string(status), printable(input));
  if (status == RepairStatus::repaired && still_error_before_mg && still_error_after_mg) {
    text += fmt::format("  still error {:.1f} -> {:.1f} mg", *still_error_before_mg,
                        *still_error_after_mg);
  }
  return text;
}

Json RepairReport::to_json() const {
  const auto optional_number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  const auto optional_text = [](const std::string& text) {
    return text.empty() ? Json(nullptr) : Json(text);
  };
  Json json;
  json["input"] = input;
  json["output"] = optional_text(output);
  json["status"] = sixpoint::repair::to_string(status);
  json["method"] = optional_text(method);
  json["reasons"] = reasons;
  json["serial"] = serial;
  json["samples"] = samples;
  json["clipped_before"] = clipped_before;
  json["clipped_after"] = clipped_after;
  json["still_blocks"] = still_blocks;
  json["still_error_mg"] = {{"before", optional_number(still_error_before_mg)},
                            {"after", optional_number(still_error_after_mg)}};
  json["rotation_undone"] = rotation_undone;
  json["constants_id"] = optional_text(constants_id);
  json["input_sha256"] = optional_text(input_sha256);
  json["output_sha256"] = optional_text(output_sha256);
  return json;
}

RepairReport repair_file(Env& env, const std::string& input, const std::string& output,
                         ConstantsSource& source, const RepairOptions& options) {
  return Repair(env, input, output, source, options).run();
}

}  // namespace sixpoint::repair

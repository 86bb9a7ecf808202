#include "repair/rescale/repair_file.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "base/sha256.h"
#include "calib/application/agreement.h"
#include "calib/coverage.h"
#include "gt3x/container/read_ahead.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "repair/rescale/applied_map.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/earlier_output.h"
#include "repair/rescale/gate.h"
#include "repair/rescale/repair_mark.h"
#include "repair/rescale/rescaled_log.h"
#include "repair/triage/file_tree.h"
#include "repair/triage/scan_file.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

// So much of a log says whether its counts can have come from its constants.
constexpr std::uint64_t kBeginning_samples = 100'000;

// From so many bytes of log.bin on.
constexpr std::uint64_t kOnThreadsFrom = std::uint64_t{4} << 20;

// Reasons are JSON values that other programs may read, so their words stay as they are.
constexpr const char* kNotDecided =
    "what cannot be told affected is not repaired: find out what is missing first";
constexpr const char* kNotUndone =
    "the file's own constants cannot be undone, so no other constants help: without them its "
    "samples cannot be put right";
constexpr const char* kOfPrior =
    "the constants rest on a population prior (--allow-prior), not on this unit's data alone";
constexpr const char* kDoneBefore = "repaired by an earlier run";
constexpr const char* kMadeOtherwise =
    "the output that is there was made with other constants, options or rules than would be used "
    "now; --redo-outdated replaces it";
constexpr const char* kClipped =
    "samples at the limit of their record, whose true value is unknown: {} before, {} after{}";
constexpr const char* kWideHelps = " (--wide keeps those that were not at it before)";
constexpr const char* kMappedByLine =
    "the counts cannot have come from whole raw counts by the file's constants (averaged, repaired "
    "before, or resampled): {} of them mapped by the straight line";

// Entries that a unit or its software writes beside the samples and that do not depend on them.
bool is_independent_of_samples(const std::string& name) {
  constexpr std::array<std::string_view, 9> kNames = {
      "log.bin",      "info.txt",     "lux.bin",      "battery.bin", "eeprom.bin",
      "firmware.bin", "capsense.bin", "metadata.bin", kSalvageMark};
  return std::ranges::find(kNames, name) != kNames.end();
}

std::vector<StillWindow> windows_of(const Survey& survey) {
  std::vector<StillWindow> windows;
  for (const calib::StillBlock& block : survey.blocks) {
    windows.push_back({block.first_sample, block.samples});
  }
  return windows;
}

// A source that another object owns.
class Borrowed final : public gt3x::ByteSource {
 public:
  explicit Borrowed(gt3x::ByteSource& source) : source_(source) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override { return source_.read(out); }
  std::optional<std::uint64_t> size() const override { return source_.size(); }

 private:
  gt3x::ByteSource& source_;
};

// The output's place: what came there meanwhile stays, and an output that is replaced is one that
// was judged (earlier_output.h).
class OutputFiles final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Result<Placement> placement(const std::string& path) override {
    return Placement{replaces ? Placing::replace : Placing::keep, path};
  }
  bool replaces = false;
};

class Repair {
 public:
  Repair(Env& env, const std::string& input, const std::string& output, ConstantsSource& source,
         const RepairOptions& options)
      : env_(env), output_files_(env.files), output_(output), source_(source), options_(options) {
    report_.input = input;
    report_.dry_run = options.dry_run;
  }

  RepairReport run() {
    if (Status status = work_on_one_file(); !status) {
      report_.status = RepairStatus::failed;
      report_.error = status.error();
      report_.reasons.push_back(status.error().brief());
      report_.output.clear();
      report_.still_error_after_mg.reset();  // of nothing
    }
    return std::move(report_);
  }

 private:
  // The file is opened by its name several times: what is read must be one file.
  Status work_on_one_file() {
    SIXPOINT_ASSIGN(before_, env_.files.info(report_.input));
    SIXPOINT_CHECK(work());
    return report_.output.empty() || report_.resumed ? is_the_same_file() : Status();
  }

  Status is_the_same_file() const {
    SIXPOINT_ASSIGN(const FileInfo now, env_.files.info(report_.input));
    if (now.size != before_.size || now.modified_ns != before_.modified_ns ||
        now.device != before_.device || now.inode != before_.inode) {
      return fail(ErrorCode::bad_data, kChangedMeanwhile, report_.input,
                  "find out what writes to it, and repair it again");
    }
    return {};
  }

  Status work() {
    if (!survey_and_write()) {
      auto surveyed = survey(env_.files, report_.input, options_.still, {options_.salvage, {}});
      if (!surveyed) {
        return has_ending(report_.input, ".agd") ? answer_for_epochs()
                                                 : Status(fail(surveyed.error()));
      }
      survey_ = *std::move(surveyed);
    }
    report_.losses = survey_.losses;
    report_.serial = survey_.facts.serial;
    report_.calibration_time = survey_.facts.calibration_time;
    report_.samples = survey_.samples;
    report_.clipped_before = survey_.clipped_samples;
    report_.clipped_after = survey_.clipped_samples;
    report_.still_blocks = survey_.magnitude.blocks;
    report_.sides = calib::coverage_of(survey_.blocks).covered_directions();
    if (survey_.magnitude.blocks > 0) {
      report_.still_error_before_mg = survey_.magnitude.mean_mg;
    }
    if (!needs_work()) {
      return {};
    }
    if (report_.method.empty()) {
      if (survey_.constants_problem.has_value()) {
        Error error = *survey_.constants_problem;
        if (survey_.samples > 0) {  // else there is nothing to be undone, and the hint stays
          error.hint = kNotUndone;
        }
        return fail(std::move(error));
      }
      SIXPOINT_CHECK(choose());
      if (!chosen_.has_value()) {
        return not_repairable();
      }
      const bool writes = may_write();
      if (report_.waits_for_others) {
        report_.status = RepairStatus::not_repairable;
        return {};
      }
      if (!writes) {
        return not_repairable();
      }
    }
    return write();
  }

  // An .agd holds no samples: what scan says of it. The verdict stays empty: no constants help it,
  // so its unit waits for none.
  Status answer_for_epochs() {
    ScannedFile scanned = scan_file(env_.files, report_.input);
    if (scanned.error) {
      return fail(*std::move(scanned.error));
    }
    report_.serial = scanned.facts.serial;
    report_.calibration_time = scanned.facts.calibration_time;
    report_.reasons = std::move(scanned.reasons);
    report_.status = scanned.verdict == to_string(Verdict::not_affected)
                         ? RepairStatus::not_affected
                         : RepairStatus::not_repairable;
    return {};
  }

  // One pass (repair_file.h); where it was not tried or did not come to its end, two find out why.
  Status survey_and_write() {
    const auto another_way = fail(ErrorCode::internal, "not in one pass", report_.input);
    // How large a log of wide records becomes is known at its end only, and its entry is to say it
    // before: all would be written twice.
    if (options_.dry_run || options_.salvage || options_.wide || env_.files.link_info(output_)) {
      return another_way;
    }
    SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(env_.files, report_.input));
    const auto entry = std::ranges::find(recording.entries(), "log.bin", &gt3x::EntryInfo::name);
    if (entry == recording.entries().end() || entry->size < options_.one_pass_from_bytes) {
      return another_way;
    }
    Repair head(env_, report_.input, output_, source_, options_);
    SIXPOINT_ASSIGN(head.survey_, survey_beginning(recording, options_.still, kBeginning_samples));
    head.survey_.log_bytes = entry->size;
    const bool windows_wait =
        options_.still.block_s * head.survey_.rate_hz <= double{WindowError::kLongestWindow};
    if (!windows_wait || !head.foresee()) {
      return another_way;
    }
    head.survey_.blocks = {};  // the whole survey has its own
    SIXPOINT_ASSIGN(head.report_.input_sha256, file_sha256(env_.files, report_.input));
    SIXPOINT_ASSIGN(auto passing, LogSurvey::begin(recording, options_.still));
    SIXPOINT_ASSIGN(auto reader, recording.open_log());
    const RescaledLogOptions how = head.log_options();
    SIXPOINT_ASSIGN(auto log, RescaledLog::make(std::move(reader), how));
    log->survey_with(passing);
    SIXPOINT_ASSIGN(auto writer, begin_output());
    SIXPOINT_CHECK(head.write_entries(recording, *log, writer));
    survey_ = passing.finish(log->statistics());
    written_.emplace(WrittenLog{std::move(recording), how, std::move(log), std::move(writer),
                                head.report_.input_sha256});
    return {};
  }

  // What will be decided if the whole file says what its beginning says; false where it is not
  // written then, or where that depends on more.
  bool foresee() {
    report_.serial = survey_.facts.serial;
    if (survey_.constants.empty() || !needs_work()) {
      return false;
    }
    if (report_.method.empty()) {
      auto constants = source_.foreseen(survey_.facts);
      if (!constants) {
        return false;
      }
      take_chosen(*std::move(constants));
      map_ = applied_map(chosen_->record, survey_);
      state_map();
    }
    return true;
  }

  // The table in repair_file.h up to the constants; false where the status is decided.
  bool needs_work() {
    if (survey_.already_repaired) {
      report_.status = RepairStatus::already_repaired;
      report_.reasons.emplace_back("the file carries the mark of an earlier repair");
      return false;
    }
    const Triage judged = triage(survey_.facts);
    report_.verdict = to_string(judged.verdict);
    report_.reasons = judged.reasons;
    report_.reasons.insert(report_.reasons.end(), survey_.notes.begin(), survey_.notes.end());
    const bool rotation_only = judged.verdict == Verdict::not_affected && judged.axes_rotated;
    if (judged.verdict == Verdict::not_affected && !(rotation_only && options_.undo_rotation)) {
      report_.status = RepairStatus::not_affected;
      if (rotation_only) {
        report_.reasons.emplace_back(
            "16CPAN03 does not concern its constants, but its axes are turned: --undo-rotation "
            "turns them back");
      }
      return write_whole();
    }
    if (judged.verdict == Verdict::cannot_tell) {
      report_.status = RepairStatus::not_repairable;
      report_.reasons.emplace_back(kNotDecided);
      return write_whole();
    }
    report_.rotation_undone = judged.axes_rotated;
    report_.method = rotation_only ? "rotation" : "";
    return true;
  }

  // A damaged file whose samples stay as they are is written whole all the same; its status says
  // nothing else than without that. The old form has no log, into which its mark would be written.
  bool write_whole() {
    if (report_.losses.empty() || survey_.samples == 0 || survey_.log.bytes == 0) {
      return false;
    }
    report_.method = kSalvageMethod;
    report_.reasons.emplace_back(
        "--salvage: written without what was lost; its samples are as they were");
    return true;
  }

  // Of a file that was written, now or by an earlier run.
  void take_status_of_written() {
    if (report_.method != kSalvageMethod) {
      report_.status = RepairStatus::repaired;
    }
  }

  Status choose() {
    SIXPOINT_ASSIGN(auto choice, source_.choose(report_.input, survey_));
    report_.reasons.insert(report_.reasons.end(), choice.reasons.begin(), choice.reasons.end());
    if (!choice.chosen.has_value()) {
      report_.for_a_person = choice.for_a_person;
      return {};
    }
    if (auto why = why_unfit(choice.chosen->record, survey_.facts, options_.allow_prior)) {
      report_.reasons.push_back(*std::move(why));
      return {};
    }
    take_chosen(*std::move(choice.chosen));
    if (report_.source->from_prior) {
      report_.reasons.emplace_back(kOfPrior);
    }
    return {};
  }

  void take_chosen(ChosenConstants constants) {
    chosen_ = std::move(constants);
    report_.method = chosen_->method;
    report_.constants_id = chosen_->constants_id;
    report_.source = source_used(chosen_->method, chosen_->constants_id, chosen_->record);
  }

  void state_map() {
    report_.cross_axis_applied = map_->has_terms();
    report_.sample_uncertainty_mg = map_->sample_uncertainty_mg;
  }

  // Whether the constants that were chosen may be used on this file: the gate, and what its own
  // still periods say.
  bool may_write() {
    map_ = applied_map(chosen_->record, survey_);
    if (!map_->why.empty()) {
      report_.reasons.push_back(map_->why);
    }
    evidence_ = gate_evidence(survey_, map_->calibration, map_->cross_axis);
    evidence_->refuted_by = options_.refuted_by;
    const GateAnswer answer = gate(*evidence_, options_.force);
    report_.waits_for_others = options_.leave_unchecked && answer.row == GateRow::not_checked;
    report_.refutes_constants = refutes(answer.row, *evidence_);
    if (evidence_->directions > 0) {
      report_.still_error_after_mg = evidence_->after_mg;
    }
    if (!answer.reason.empty()) {
      report_.reasons.push_back(answer.reason);
    }
    report_.forced = answer.forced;
    if (answer.write && chosen_->method != to_string(SourceKind::scan)) {
      if (auto contradiction = own_still_periods_contradict()) {
        report_.reasons.push_back(*std::move(contradiction));
        report_.forced = true;
        report_.refutes_constants = true;
      }
    }
    if (report_.forced && options_.force) {
      report_.reasons.emplace_back("--force: repaired all the same");
    }
    if (!answer.write || (report_.forced && !options_.force)) {
      if (report_.refutes_constants || answer.row == GateRow::no_better) {
        report_.reasons.push_back(
            what_may_help(is_of_still_periods(report_.method), report_.sides.size()));
      }
      report_.forced = false;
      return false;
    }
    state_map();
    return true;
  }

  // The gate once more, with what was written, which report and mark state from here on. Without
  // constants there was no gate.
  bool may_be_kept(RescaledLog& log, std::span<const StillWindow> windows) {
    const auto written_mg = log.still_error_mg(windows);
    if (written_mg) {
      report_.still_error_after_mg = written_mg;
    }
    if (!evidence_) {
      return true;
    }
    evidence_->written_mg = written_mg;
    const GateAnswer answer = gate(*evidence_, options_.force);
    if (answer.row != GateRow::rounded_away) {
      return true;
    }
    report_.reasons.push_back(answer.reason);
    report_.refutes_constants = refutes(answer.row, *evidence_);
    report_.forced = answer.forced;
    if (answer.forced) {
      report_.reasons.emplace_back("--force: repaired all the same");
    }
    return answer.write;
  }

  Status not_repairable() {
    report_.status = RepairStatus::not_repairable;
    return look_for_earlier_output();
  }

  // What is wrong with constants from elsewhere by the file's own still periods, where these have a
  // verified solution.
  std::optional<std::string> own_still_periods_contradict() {
    // A thousand blocks, evenly taken, say the same as ten thousand and cost a tenth.
    constexpr std::size_t kEnoughBlocks = 1000;
    const std::size_t stride = 1 + survey_.blocks.size() / kEnoughBlocks;
    std::vector<calib::StillBlock> all = std::move(survey_.blocks);
    survey_.blocks.clear();
    for (std::size_t at = 0; at < all.size(); at += stride) {
      survey_.blocks.push_back(all[at]);
    }
    const auto own = solve_survey(report_.input, survey_, {});
    survey_.blocks = std::move(all);  // the gate is asked once more, of all of them
    if (!own || !own->usable()) {
      return std::nullopt;
    }
    const calib::ConstantsRecord& record = chosen_->record;
    const SensorsOwn theirs =
        sensors_own(record.calibration, record.uncertainty, record.cross_axis);
    const SensorsOwn files = sensors_own(*own->calibration, own->uncertainty, own->cross_axis);
    const calib::Agreement between = calib::agreement(theirs.calibration, theirs.uncertainty,
                                                      files.calibration, files.uncertainty);
    return between.agree() ? std::nullopt
                           : std::optional(fmt::format(
                                 "the constants disagree with the file's own still periods: {}",
                                 between.brief()));
  }

  RescaledLogOptions log_options() const {
    RescaledLogOptions options;
    if (map_.has_value()) {
      options.fresh = map_->calibration;
      options.cross_axis = map_->cross_axis;
    }
    options.accel_scale_lsb_per_g = survey_.header_scale_lsb_per_g;
    if (!survey_.constants.empty()) {
      options.first_constants = survey_.constants.front();
    }
    options.undo_rotation = report_.rotation_undone;
    options.wide = options_.wide;
    options.beyond_12_bits = survey_.beyond_12_bits;
    options.affine = chosen_.has_value() && !survey_.plausibility.plausible();
    options.leave_out_damage = options_.salvage;
    options.mark = mark_record_of(report_);
    options.size = options_.wide ? survey_.log_bytes_wide : survey_.log_bytes;
    return options;
  }

  void take(const RescaledLog& log) {
    report_.clipped_before = log.tally().clipped_before;
    report_.clipped_after = log.tally().clipped_after;
    if (report_.clipped_after > 0) {
      report_.reasons.push_back(fmt::format(
          kClipped, report_.clipped_before, report_.clipped_after,
          !options_.wide && report_.clipped_after > report_.clipped_before ? kWideHelps : ""));
    }
    if (log.tally().affine_counts > 0) {
      report_.reasons.push_back(fmt::format(kMappedByLine, log.tally().affine_counts));
    }
    if (!report_.losses.empty()) {
      report_.reasons.push_back(
          fmt::format("--salvage: {} losses, which its marks state", report_.losses.size()));
    } else if (survey_.log.checksum_failures + survey_.log.damaged_stretches > 0) {
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

  // What lies at the output's name may be the recording: nobody is told to remove that.
  Status refuse_recording_as_output() const {
    const auto there = env_.files.info(output_);
    const bool has_no_inodes = before_.device == 0 && before_.inode == 0;
    if (!there || has_no_inodes || there->device != before_.device ||
        there->inode != before_.inode) {
      return {};
    }
    const auto is_link = [&](const std::string& path) {
      const auto info = env_.files.link_info(path);
      return info && info->is_link;
    };
    // Where the input is named by a link, this may be that very link.
    return is_link(output_) && !is_link(report_.input)
               ? fail(ErrorCode::cannot_create, "this is a link to the recording itself", output_,
                      "remove the link, or choose another output folder")
               : fail(ErrorCode::cannot_create, "this is the recording itself", output_,
                      kAnotherFolder);
  }

  Status write() {
    SIXPOINT_CHECK(refuse_recording_as_output());
    if (written_) {
      report_.input_sha256 = written_->input_sha256;
    } else {
      SIXPOINT_ASSIGN(report_.input_sha256, file_sha256(env_.files, report_.input));
    }
    RescaledLogOptions how = log_options();  // with the mark, which holds the hash
    const std::vector<StillWindow> windows = windows_of(survey_);
    survey_.blocks = {};  // all that they had to say was said by now
    if (!written_ || !(written_->how == how)) {
      written_.reset();
      const auto mark = mark_in(env_.files, output_);
      SIXPOINT_ASSIGN(const auto found, found_output(mark));
      const EarlierOutput earlier =
          judge_earlier_output(found, options_.known_output, report_.input_sha256, recipe());
      const bool is_done = earlier == EarlierOutput::done && options_.resume;
      if (earlier != EarlierOutput::none && !is_done &&
          !(earlier == EarlierOutput::outdated && options_.redo_outdated)) {
        return leave_earlier_output(earlier);
      }
      if (is_done) {
        how.mark.clear();  // the output has the one of its run
      }
      SIXPOINT_ASSIGN(auto recording,
                      gt3x::Recording::open(env_.files, report_.input, {options_.salvage, {}}));
      SIXPOINT_ASSIGN(auto reader, recording.open_log());
      SIXPOINT_ASSIGN(auto log, RescaledLog::make(std::move(reader), how));
      log->expect_still(windows);
      if (is_done) {
        SIXPOINT_CHECK(compare_with_output(recording, *log));
      } else if (options_.dry_run) {
        SIXPOINT_CHECK(read_through(*log));
      }
      if (options_.dry_run || is_done) {
        if (!may_be_kept(*log, windows)) {
          return not_repairable();
        }
        finish(recording, *log);
        if (is_done) {
          take_earlier_output(mark.value_or(Json()), *found);
        }
        return {};
      }
      output_files_.replaces = earlier == EarlierOutput::outdated;
      SIXPOINT_ASSIGN(auto writer, begin_output());
      SIXPOINT_CHECK(write_entries(recording, *log, writer));
      written_.emplace(WrittenLog{std::move(recording), how, std::move(log), std::move(writer),
                                  report_.input_sha256});
    }
    if (!may_be_kept(*written_->log, windows)) {
      written_.reset();
      return not_repairable();
    }
    SIXPOINT_CHECK(commit(written_->writer));
    finish(written_->recording, *written_->log);
    return {};
  }

  void finish(const gt3x::Recording& recording, const RescaledLog& log) {
    take(log);
    name_what_was_not_repaired(recording, log.tally().epoch_records);
    take_status_of_written();
  }

  // Epochs were computed by the unit, or by software, from the samples as they were.
  void name_what_was_not_repaired(const gt3x::Recording& recording, std::uint64_t epoch_records) {
    if (report_.method == kSalvageMethod) {
      return;  // nothing was
    }
    std::vector<std::string> names;
    for (const gt3x::EntryInfo& entry : recording.entries()) {
      if (!is_independent_of_samples(entry.name)) {
        names.push_back(printable(entry.name, 60));
      }
    }
    if (!names.empty()) {
      report_.reasons.push_back(fmt::format(
          "carried over as they were: {}; what was computed from the samples must be made anew",
          fmt::join(names, ", ")));
    }
    if (epoch_records > 0) {
      report_.reasons.push_back(fmt::format(
          "{} EPOCH records were computed by the unit from the wrong samples; they were carried "
          "over and must be made anew",
          epoch_records));
    }
  }

  static Status read_through(RescaledLog& log) {
    Bytes piece(1U << 20);
    std::size_t count = 0;
    do {
      SIXPOINT_ASSIGN(count, log.read(piece));
    } while (count > 0);
    return {};
  }

  Result<gt3x::RecordingWriter> begin_output() {
    SIXPOINT_CHECK(make_synced_folders(env_.files, folder_of(output_)));
    gt3x::WriterOptions how;
    how.packing = options_.store_only ? gt3x::Packing::store : gt3x::Packing::deflate;
    how.jobs = options_.jobs;
    return gt3x::RecordingWriter::create(output_files_, output_, how);
  }

  // All but the mark. A large log is read on a thread of its own: packing or writing it takes as
  // long as reading it, or longer.
  Status write_entries(gt3x::Recording& recording, RescaledLog& log,
                       gt3x::RecordingWriter& writer) const {
    const std::string salvage_mark = mark_name(report_);
    for (const gt3x::EntryInfo& entry : recording.entries()) {
      if (entry.name == salvage_mark) {
        continue;  // a file that was salvaged before; its record in the log stays
      }
      if (entry.name == "log.bin" && entry.size < kOnThreadsFrom) {
        SIXPOINT_CHECK(writer.add(entry.name, log));
      } else if (entry.name == "log.bin") {
        gt3x::ReadAhead ahead(std::make_unique<Borrowed>(log));
        SIXPOINT_CHECK(writer.add(entry.name, ahead));
      } else {
        SIXPOINT_CHECK(carry_over(recording, entry.name, writer));
      }
    }
    return recording.has_entry("info.txt") ? Status()
                                           : writer.add("info.txt", recording.info().serialise());
  }

  Status commit(gt3x::RecordingWriter& writer) {
    report_.repaired_at = env_.clock.now();
    SIXPOINT_CHECK(writer.add(mark_name(report_),
                              mark_of(report_, chosen_, survey_, recipe(), *report_.repaired_at)
                                      .dump(2, ' ', false, Json::error_handler_t::replace) +
                                  "\n"));
    SIXPOINT_CHECK(is_the_same_file());  // before it gets its name
    SIXPOINT_CHECK(writer.commit());
    report_.output = output_;
    report_.output_sha256 = writer.sha256();
    return {};
  }

  bool is_damaged(const std::string& entry) const {
    return std::ranges::find(report_.losses, entry, &gt3x::SalvageLoss::entry) !=
           report_.losses.end();
  }

  // An entry as it is; of a damaged one, what is left of it.
  Status carry_over(gt3x::Recording& recording, const std::string& name,
                    gt3x::RecordingWriter& writer) const {
    if (!is_damaged(name)) {
      return writer.copy(recording, name);
    }
    SIXPOINT_ASSIGN(const auto source, open_carried_over(recording, name));
    return writer.add(name, *source);
  }

  // The bytes that carry_over() writes, and those of an info.txt that is lost.
  Result<std::unique_ptr<gt3x::ByteSource>> open_carried_over(gt3x::Recording& recording,
                                                              const std::string& name) const {
    if (name == "info.txt" && (is_damaged(name) || !recording.has_entry(name))) {
      const std::string info = recording.info().serialise();
      return std::make_unique<gt3x::MemorySource>(Bytes(info.begin(), info.end()));
    }
    return recording.open_entry(name);
  }

  std::string recipe() const {
    Recipe recipe;
    if (chosen_) {
      recipe.constants = chosen_->record;
    }
    recipe.rotation_undone = report_.rotation_undone;
    recipe.wide = options_.wide;
    recipe.store_only = options_.store_only;
    recipe.salvaged = !report_.losses.empty();
    return recipe_digest(recipe);
  }

  // What lies where the output goes; nothing where nothing does.
  Result<std::optional<FoundOutput>> found_output(const std::optional<Json>& mark) const {
    if (!env_.files.link_info(output_)) {
      return std::nullopt;
    }
    FoundOutput found;
    if (mark) {
      found.input_sha256 = text_in(*mark, "input_sha256");
      found.recipe = text_in(*mark, "recipe");
      if (const auto then = parse_iso8601(text_in(*mark, "repaired_at")); then) {
        found.made_at = *then;
      }
      SIXPOINT_ASSIGN(found.sha256, file_sha256(env_.files, output_));
    }
    return found;
  }

  // A file that would not be written now: does the output of an earlier run lie there?
  Status look_for_earlier_output() {
    const auto mark = mark_in(env_.files, output_);
    if (!mark) {
      return {};
    }
    SIXPOINT_ASSIGN(report_.input_sha256, file_sha256(env_.files, report_.input));
    if (text_in(*mark, "input_sha256") == report_.input_sha256) {
      call_outdated();
      report_.reasons.push_back(
          fmt::format("an earlier run wrote {}, which would not be written now: look at the two, "
                      "and remove it",
                      printable(output_)));
    }
    return {};
  }

  // The output that is there stays: nothing was made that a still error could be stated of.
  void call_outdated() {
    report_.status = RepairStatus::outdated;
    report_.still_error_after_mg.reset();
  }

  // What is there is neither taken nor replaced.
  Status leave_earlier_output(EarlierOutput earlier) {
    if (earlier == EarlierOutput::outdated) {
      call_outdated();
      report_.reasons.emplace_back(kMadeOtherwise);
      return {};
    }
    if (earlier == EarlierOutput::changed) {
      return output_was_changed();
    }
    return fail(ErrorCode::cannot_create, "a file of that name is there already", output_,
                options_.resume
                    ? "it was not made of this recording, or cannot be read: look at it, and "
                      "remove it or choose another folder"
                    : "choose another folder, or --resume to go on with an earlier run");
  }

  Status output_was_changed() const {
    return fail(ErrorCode::cannot_create,
                "the output of an earlier run is not as that run wrote it", output_,
                "it was changed, or is damaged: look at it, and remove it");
  }

  // Whether the output of an earlier run holds what write_entries() would write now, but for the
  // marks. `log` has none.
  Status compare_with_output(gt3x::Recording& recording, RescaledLog& log) const {
    auto there = gt3x::Recording::open(env_.files, output_);
    if (!there || there->bytes_behind() > 0) {
      return output_was_changed();
    }
    const std::vector<std::string> names = names_of_output(recording);
    if (!std::ranges::equal(names, there->entries(), {}, {}, &gt3x::EntryInfo::name)) {
      return output_was_changed();
    }
    for (const std::string& name : names) {
      if (name == "log.bin") {
        SIXPOINT_CHECK(compare_logs(log, *there));
      } else if (name != mark_name(report_)) {
        SIXPOINT_ASSIGN(const auto expected, open_carried_over(recording, name));
        SIXPOINT_ASSIGN(const std::string ours, sha256_of(*expected));
        const auto found = there->open_entry(name);
        const auto theirs = found ? sha256_of(**found) : Result<std::string>(fail(found.error()));
        if (!theirs || *theirs != ours) {
          return output_was_changed();
        }
      }
    }
    return {};
  }

  // Of its entries, in their order.
  std::vector<std::string> names_of_output(const gt3x::Recording& recording) const {
    std::vector<std::string> names;
    for (const gt3x::EntryInfo& entry : recording.entries()) {
      if (entry.name != mark_name(report_)) {
        names.push_back(entry.name);
      }
    }
    if (!recording.has_entry("info.txt")) {
      names.emplace_back("info.txt");
    }
    names.push_back(mark_name(report_));
    return names;
  }

  static Result<std::string> sha256_of(gt3x::ByteSource& source) {
    Sha256 hash;
    Bytes piece(1U << 16);
    for (;;) {
      SIXPOINT_ASSIGN(const std::size_t count, source.read(piece));
      if (count == 0) {
        return to_hex(hash.finish());
      }
      hash.update(std::span(piece).first(count));
    }
  }

  Status compare_logs(RescaledLog& log, gt3x::Recording& there) const {
    auto reader = there.open_log();
    if (!reader) {
      return output_was_changed();
    }
    Bytes expected;
    for (bool at_mark = true;;) {
      const auto item = reader->next();
      if (!item) {
        return output_was_changed();
      }
      if (!*item) {
        break;
      }
      if (at_mark && (*item)->kind == gt3x::LogItem::Kind::record && (*item)->record.checksum_ok) {
        at_mark = false;  // the first good record
        continue;
      }
      expected.resize((*item)->raw.size());
      SIXPOINT_ASSIGN(const std::size_t count, log.read(expected));
      if (count < expected.size() || !std::ranges::equal(expected, (*item)->raw)) {
        return output_was_changed();
      }
    }
    expected.resize(1);
    SIXPOINT_ASSIGN(const std::size_t more, log.read(expected));
    return more == 0 ? Status() : output_was_changed();
  }

  // What an earlier run made of this very input, with the constants that were used then.
  void take_earlier_output(const Json& mark, const FoundOutput& found) {
    report_.reasons.emplace_back(kDoneBefore);
    report_.resumed = true;
    report_.method = text_in(mark, "method");
    report_.constants_id = text_in(mark, "constants_id");
    report_.source = parse_source_used(mark.value("source", Json(nullptr)));
    report_.forced = mark.value("forced", Json(false)) == Json(true);
    report_.cross_axis_applied = mark.value("cross_axis_applied", Json(false)) == Json(true);
    report_.sample_uncertainty_mg = three_in(mark, "sample_uncertainty_mg");
    report_.repaired_at = found.made_at;
    report_.output = output_;
    report_.output_sha256 = found.sha256;
  }

  Env& env_;
  OutputFiles output_files_;
  std::string output_;
  ConstantsSource& source_;
  RepairOptions options_;
  FileInfo before_;  // the input, before it was read
  Survey survey_;
  std::optional<ChosenConstants> chosen_;
  std::optional<AppliedMap> map_;  // of chosen_
  std::optional<GateEvidence> evidence_;
  // The new file up to its mark, in the temporary file.
  struct WrittenLog {
    gt3x::Recording recording;
    RescaledLogOptions how;
    std::unique_ptr<RescaledLog> log;
    gt3x::RecordingWriter writer;
    std::string input_sha256;
  };
  std::optional<WrittenLog> written_;
  RepairReport report_;
};

}  // namespace

RepairReport repair_file(Env& env, const std::string& input, const std::string& output,
                         ConstantsSource& source, const RepairOptions& options) {
  return Repair(env, input, output, source, options).run();
}

}  // namespace sixpoint::repair

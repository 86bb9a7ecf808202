#include "station/capture/capture_run.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/time.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "repair/rescale/constants_finder.h"
#include "repair/triage/survey.h"
#include "station/capture/calibration_file.h"
#include "station/capture/recording_pieces.h"
#include "station/capture/sides_to_repeat.h"
#include "station/run/jig_run.h"

namespace sixpoint::station {

namespace {

// By convention: differences up to this come from rounding to whole seconds at the sides' ends.
constexpr double kShort_s = 5;
constexpr std::chrono::seconds kCheckUnitEvery{1};
constexpr std::chrono::milliseconds kAskEvery{200};

// The samples of a record that holds some.
bool samples_of(const gt3x::LogItem& item, std::vector<gt3x::Counts>& samples) {
  if (item.kind != gt3x::LogItem::Kind::record || !item.record.checksum_ok) {
    return false;
  }
  if (item.record.is(gt3x::RecordType::activity)) {
    gt3x::unpack_activity(item.record.payload, samples);
    return true;
  }
  if (item.record.is(gt3x::RecordType::activity2)) {
    gt3x::unpack_activity2(item.record.payload, samples);
    return true;
  }
  return false;
}

// Traces that a clock or a sensor which failed leaves in a recording.
struct Oddities {
  double jumped_s = 0;              // sum of the steps between records, beyond one second each
  PerAxis<std::size_t> repeated{};  // samples: the longest run of one count
};

Result<Oddities> find_oddities(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(gt3x::Recording recording, gt3x::Recording::open(files, path));
  SIXPOINT_ASSIGN(gt3x::LogReader log, recording.open_log());
  Oddities oddities;
  PerAxis<std::size_t> run{};
  gt3x::Counts before{};
  std::vector<gt3x::Counts> samples;
  std::optional<std::uint32_t> last;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      return oddities;
    }
    if (!samples_of(*item, samples)) {
      continue;
    }
    if (last) {
      oddities.jumped_s += static_cast<double>(item->record.unix_time) - *last - 1;
    }
    last = item->record.unix_time;
    for (const gt3x::Counts& sample : samples) {
      // A unit that charges stores zeros on all axes: no measurement.
      const bool is_measured = (sample[0] | sample[1] | sample[2]) != 0;
      for (std::size_t a = 0; a < kAxes; ++a) {
        run[a] = is_measured ? (sample[a] == before[a] ? run[a] + 1 : 1) : 0;
        oddities.repeated[a] = std::max(oddities.repeated[a], run[a]);
      }
      before = sample;
    }
  }
}

// The unit recorded without a pause, so two blocks are at most a side and a turn apart. A jump of
// its clock is no time in which its zeros could have drifted.
void undo_jumps(std::vector<calib::StillBlock>& blocks, double longest_s) {
  double shift_s = 0;
  for (std::size_t i = 1; i < blocks.size(); ++i) {
    blocks[i].start_time_s += shift_s;
    const double gap_s = blocks[i].start_time_s - blocks[i - 1].start_time_s;
    if (!(gap_s > 0 && gap_s <= longest_s)) {
      shift_s += longest_s - gap_s;
      blocks[i].start_time_s += longest_s - gap_s;
    }
  }
}

// True where the clock of the unit jumped.
bool note_jump(const Oddities& oddities, CaptureReport& report) {
  if (std::abs(oddities.jumped_s) <= kShort_s) {
    return false;
  }
  report.notes.push_back(
      fmt::format("the times in the recording jump by {:+.0f} s: the unit's clock was wrong",
                  oddities.jumped_s));
  return true;
}

// Why the recording is no measurement: an axis that repeated itself for as long as the jig allows.
// The longest of the real recordings is 1 s.
std::vector<std::string> why_stuck(const Oddities& oddities, double rate_hz) {
  std::vector<std::string> why;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double repeated_s = static_cast<double>(oddities.repeated[a]) / rate_hz;
    if (repeated_s >= JigRunOptions{}.stuck_s) {
      why.push_back(
          fmt::format("axis {} repeated one reading for {:.0f} s: the sensor is frozen, "
                      "or this axis is stuck; keep the unit back",
                      kAxisNames[a], repeated_s));
    }
  }
  return why;
}

Status check_and_solve(Env& env, const CaptureOptions& options, const std::string& path,
                       std::optional<double> wanted_s, CaptureReport& report) {
  SIXPOINT_ASSIGN(repair::Survey survey, repair::survey(env.files, path));
  if (survey.facts.serial != report.serial) {
    return fail(ErrorCode::bad_data,
                fmt::format("the recording is of {}", printable(survey.facts.serial, 40)), path,
                "another unit was plugged in; begin anew");
  }
  if (wanted_s && survey.duration_s < *wanted_s - kShort_s) {
    report.notes.push_back(
        fmt::format("the recording holds {:.0f} s of {:.0f}: is the unit's memory full, or its "
                    "battery empty?",
                    survey.duration_s, *wanted_s));
  }
  if (survey.log.damaged_bytes > 0) {
    report.notes.push_back(fmt::format(
        "{} bytes of the recording are damaged and left out; 'sixpoint inspect' says where",
        survey.log.damaged_bytes));
  }
  SIXPOINT_ASSIGN(const Oddities oddities, find_oddities(env.files, path));
  // Only a unit that this program told to record, without a pause, has no other gaps.
  if (wanted_s && report.pieces.empty() && note_jump(oddities, report)) {
    report.clock_jumped = true;
    undo_jumps(survey.blocks, options.side_s + options.turn_s);
  }
  report.refusal = why_stuck(oddities, survey.rate_hz);
  if (!report.refusal.empty()) {
    report.solved.reset();
    return {};
  }
  const auto begin = env.clock.elapsed();
  SIXPOINT_ASSIGN(report.solved, repair::solve_survey(path, survey, options.solve));
  report.solved->seconds = std::chrono::duration<double>(env.clock.elapsed() - begin).count();
  return {};
}

}  // namespace

Result<CaptureReport> run_file_capture(device::Unit& unit, Env& env,
                                       const CaptureOptions& options) {
  CaptureReport report;
  report.serial = unit.identity().serial;
  report.firmware = unit.identity().firmware;
  SIXPOINT_ASSIGN(const auto recordings, unit.recordings());
  if (recordings.empty()) {
    return fail(ErrorCode::bad_data, "the unit holds no recording", unit.address(),
                "let it record while it lies on each of its six sides for a minute");
  }
  SIXPOINT_CHECK(unit.download(recordings.back(), env.files, options.output));
  report.file = options.output;
  SIXPOINT_ASSIGN(report.file_sha256, file_sha256(env.files, options.output));
  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(env.files, options.output));
  const auto filter = repair::filter_in_force(survey.facts);
  report.recording_filter = filter.value_or(report.recording_filter);
  report.refusal = why_recording_cannot_help({report.serial, report.firmware, filter, true});
  if (report.refusal.empty()) {
    SIXPOINT_CHECK(check_and_solve(env, options, options.output, std::nullopt, report));
  }
  return report;
}

Result<CaptureReport> judge_file_of_before(Env& env, const CaptureOptions& options,
                                           CaptureReport report, const std::string& why) {
  if (report.file.empty()) {  // an earlier program made and judged it
    SIXPOINT_ASSIGN(report.file_sha256, file_sha256(env.files, options.output));
    report.file = options.output;
    SIXPOINT_CHECK(check_and_solve(env, options, options.output, std::nullopt, report));
  }
  report.notes.push_back("no side was repeated, the recording of before is judged: " + why);
  return report;
}

namespace {

class CaptureRun {
 public:
  CaptureRun(UnitOnJig on_jig, Env& env, const CaptureOptions& options, const CaptureHooks& hooks)
      : on_jig_(on_jig),
        env_(env),
        options_(options),
        hooks_(hooks),
        poses_(device::kPoses.begin(), device::kPoses.end()) {
    if (options.corners) {
      poses_.insert(poses_.end(), device::kCorners.begin(), device::kCorners.end());
    }
  }

  Result<CaptureReport> run(const std::optional<CaptureResume>& resume) {
    if (options_.corners && on_jig_.jig->turns_by_itself() && corner_jig() == nullptr) {
      return fail(ErrorCode::usage, "this jig lays a unit on its six sides only",
                  on_jig_.jig->name(),
                  "leave out '--sides corners', or turn it by hand (--jig manual)");
    }
    report_.serial = unit().identity().serial;
    report_.firmware = unit().identity().firmware;
    if (resume) {
      progress_ = *resume;
    }
    auto done = record_and_judge(resume.has_value());
    // `internal`: the program ends, and a later one goes on.
    if (done || progress_.asked_again == 0 || done.error().code == ErrorCode::internal) {
      return done;
    }
    // A side that cannot be repeated takes nothing away from what was recorded before.
    return judge_file_of_before(env_, options_, std::move(report_), done.error().brief());
  }

 private:
  enum class Step { done, stopped, away };

  Result<CaptureReport> record_and_judge(bool goes_on) {
    SIXPOINT_ASSIGN(const device::FilterState filter, unit().filter());
    report_.recording_filter = filter.recording;
    report_.refusal =
        why_recording_cannot_help({report_.serial, report_.firmware, filter.recording, true});
    if (!report_.refusal.empty()) {
      return report_;
    }
    if (goes_on) {
      if (progress_.asked_again > 0) {
        remove_beside();
      }
      SIXPOINT_CHECK(retry([&] { return begin_anew(); }));
    } else {
      SIXPOINT_CHECK(refuse_existing(env_.files, options_.output));
      progress_.started = unit().clock().now();
      SIXPOINT_CHECK(begin_recording());
    }
    for (;;) {
      const Result<bool> all_sides = record_sides();
      if (!all_sides && (gone_ || all_sides.error().code == ErrorCode::internal)) {
        return fail(all_sides.error());  // the unit records on
      }
      Status ended = end_recording();
      if (ended && !all_sides) {
        ended = fail(all_sides.error());
      }
      SIXPOINT_CHECK(ended);
      if (!*all_sides) {
        if (progress_.asked_again > 0) {
          return judge_file_of_before(env_, options_, std::move(report_), "it was stopped");
        }
        report_.stopped = true;
        return report_;
      }
      SIXPOINT_CHECK(progress_.asked_again > 0 ? fetch_anew() : fetch(options_.output));
      if (!report_.refusal.empty()) {
        return report_;
      }
      const auto sides =
          hooks_.again && may_make_pieces()
              ? sides_to_repeat(*report_.solved, progress_.asked_again, options_.most_repeats)
              : std::vector<device::Pose>();
      if (sides.empty()) {
        return report_;
      }
      SIXPOINT_CHECK(ask_again(sides));
    }
  }

  device::Unit& unit() { return *on_jig_.unit; }
  // Null where the jig cannot.
  device::CornerJig* corner_jig() { return dynamic_cast<device::CornerJig*>(on_jig_.jig); }

  // Repeats `step` while it fails because the unit is away; waits for the unit in between.
  template <class Action>
  auto retry(Action step) -> decltype(step()) {
    for (int attempt = 1;; ++attempt) {
      auto result = step();
      if (result || attempt >= options_.downloads ||
          result.error().code != ErrorCode::device_unavailable) {
        return result;
      }
      if (const Status back = come_back(result.error()); !back) {
        return fail(back.error());
      }
    }
  }

  Status come_back(const Error& why) {
    if (hooks_.reopen) {
      gone_ = true;
      SIXPOINT_ASSIGN(on_jig_, hooks_.reopen(why));
      gone_ = false;
    } else {
      SIXPOINT_CHECK(unit().reconnect(from_seconds(options_.replug_patience_s)));
    }
    report_.notes.push_back(fmt::format("the unit came back ({})", why.what));
    return {};
  }

  Status begin_recording() {
    const UtcTime began = unit().clock().now();
    piece_began_ = unit().clock().elapsed();
    auto begun = unit().start_recording(options_.rate_hz, began);
    if (!begun && begun.error().code == ErrorCode::io) {
      // A program that was killed may have left it streaming.
      SIXPOINT_CHECK(unit().stop_stream());
      begun = unit().start_recording(options_.rate_hz, began);
    }
    SIXPOINT_ASSIGN(recording_, begun);
    save();
    return {};
  }

  // The unit was away, or another program began this capture: the recording so far is ended and
  // stays in the unit, and a new one begins. Sides of a recording that the unit lost are repeated.
  Status begin_anew() {
    pieces_ = true;
    if (const auto stopped = unit().stop_recording();
        !stopped && stopped.error().code != ErrorCode::io) {
      return fail(stopped.error());
    }
    SIXPOINT_ASSIGN(const auto recordings, unit().recordings());
    const auto lost = [&](const CaptureResume::Side& side) {
      return std::none_of(recordings.begin(), recordings.end(),
                          [&](const auto& one) { return one.id == side.recording; });
    };
    const auto before = progress_.done.size();
    std::erase_if(progress_.done, lost);
    if (const auto gone = before - progress_.done.size(); gone > 0) {
      report_.notes.push_back(fmt::format("the unit lost its recording; {} side{} asked again",
                                          gone, gone == 1 ? " is" : "s are"));
    }
    return begin_recording();
  }

  // The sides are recorded anew, in a recording of their own; the others stay as they are.
  Status ask_again(const std::vector<device::Pose>& sides) {
    std::string names;
    for (const device::Pose side : sides) {
      names += names.empty() ? "" : ", ";
      names += device::to_string(side);
      std::erase_if(progress_.done,
                    [side](const auto& one) { return one.pose == CapturePose(side); });
    }
    report_.notes.push_back(
        fmt::format("too few still readings with {} up: asked for again", names));
    ++progress_.asked_again;
    SIXPOINT_CHECK(retry([&] { return begin_anew(); }));
    hooks_.again(sides);
    return {};
  }

  // The pieces that a repeated side makes have names of their own, and replace no file.
  bool may_make_pieces() {
    const auto is_free = [this](const std::string& name) {
      const auto& own = report_.pieces;
      if (std::find(own.begin(), own.end(), name) == own.end() && env_.files.info(name)) {
        report_.notes.push_back("no side is asked for again: there is a file " + name);
        return false;
      }
      return true;
    };
    const std::string beside = beside_name();
    bool are_free = is_free(beside);
    for (std::size_t number = 1; are_free && number <= poses_.size(); ++number) {
      are_free =
          is_free(piece_name(options_.output, number)) && is_free(piece_name(beside, number));
    }
    return are_free;
  }

  // "c.gt3x" is "c-new.gt3x" until it is whole.
  std::string beside_name() const {
    const std::size_t dot = piece_name(options_.output, 0).rfind("-0");
    return options_.output.substr(0, dot) + "-new" + options_.output.substr(dot);
  }

  // Whether the second download makes a file of this name: the whole, a piece, or the part of one
  // that a download leaves where it breaks off ("c-new-1.gt3x.0123456789ab.part", WireUnit).
  bool is_beside(std::string_view name) const {
    constexpr std::string_view kBefore = ".before";
    constexpr std::string_view kPart = ".part";
    constexpr std::size_t kDigits = 12;
    if (name.ends_with(std::string(kPart).append(kBefore))) {
      name.remove_suffix(kBefore.size());
    }
    if (name.ends_with(kPart)) {
      name.remove_suffix(kPart.size());
      const std::size_t end = name.find_last_not_of("0123456789abcdef");
      if (end == std::string_view::npos || name[end] != '.' || name.size() - end - 1 != kDigits) {
        return false;
      }
      name = name.substr(0, end);
    }
    const std::string beside = beside_name();
    bool found = name == beside;
    for (std::size_t number = 1; !found && number <= poses_.size(); ++number) {
      found = name == piece_name(beside, number);
    }
    return found;
  }

  // Only after may_make_pieces(): then no other file has such a name.
  void remove_beside() {
    const std::string prefix = options_.output.substr(0, options_.output.rfind('/') + 1);
    const auto names = env_.files.list(folder_of(options_.output));
    for (const std::string& name : names ? *names : std::vector<std::string>()) {
      if (is_beside(prefix + name)) {
        static_cast<void>(env_.files.remove(prefix + name));
      }
    }
    AtomicFile::remove_left_over(env_.files, beside_name());
  }

  // After a side was repeated: all is downloaded and judged beside what this capture made before,
  // also in an earlier program, and then takes its place. Where that fails, file and judgement of
  // before stay.
  Status fetch_anew() {
    const CaptureReport before = report_;
    report_.pieces.clear();
    report_.solved.reset();
    const std::string beside = beside_name();
    Status done = fetch(beside);
    if (done) {
      done = take_place(beside);
    }
    if (!done) {
      remove_beside();
      auto notes = std::move(report_.notes);
      report_ = before;
      report_.notes = std::move(notes);
    }
    return done;
  }

  Status take_place(const std::string& beside) {
    SIXPOINT_CHECK(env_.files.rename(beside, options_.output));
    // The new file holds from here on. A piece that cannot be renamed keeps its name.
    report_.file = options_.output;
    auto& pieces = report_.pieces;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      std::string name = piece_name(options_.output, i + 1);
      if (env_.files.rename(pieces[i], name)) {
        pieces[i] = std::move(name);
      }
    }
    // Pieces of before, also those that an earlier program made (may_make_pieces()).
    for (std::size_t number = 1; number <= poses_.size(); ++number) {
      const std::string name = piece_name(options_.output, number);
      if (std::find(pieces.begin(), pieces.end(), name) == pieces.end()) {
        static_cast<void>(env_.files.remove(name));
      }
    }
    static_cast<void>(env_.files.sync_folder(folder_of(options_.output)));
    return {};
  }

  void save() {
    if (hooks_.progress) {
      hooks_.progress(progress_);
    }
  }

  // Sets away_. Only a driver that can reopen the unit is told; other errors do not mean that the
  // unit is unplugged.
  bool is_away() {
    if (!hooks_.reopen) {
      return false;
    }
    const auto identity = unit().identify();
    if (identity || identity.error().code != ErrorCode::device_unavailable) {
      return false;
    }
    away_ = identity.error();
    return true;
  }

  SideAnswer ask(const CapturePose& pose, std::size_t number) {
    const auto* const side = std::get_if<device::Pose>(&pose);
    return side != nullptr
               ? hooks_.ask(*side, number, poses_.size())
               : hooks_.ask_corner(std::get<device::Corner>(pose), number, poses_.size());
  }

  Result<Step> place(const CapturePose& pose, std::size_t number) {
    for (;;) {
      switch (ask(pose, number)) {
        case SideAnswer::placed:
          return Step::done;
        case SideAnswer::stop:
          return Step::stopped;
        case SideAnswer::leave:
          return fail(ErrorCode::internal, "the program ends");
        case SideAnswer::waiting:
          if (is_away()) {
            return Step::away;
          }
          break;
      }
    }
  }

  Result<Step> rest() {
    Clock& clock = unit().clock();
    const auto until = clock.elapsed() + from_seconds(options_.turn_s + options_.side_s);
    auto checked = clock.elapsed();
    for (auto now = checked; now < until; now = clock.elapsed()) {
      const SideAnswer answer = hooks_.next_answer ? hooks_.next_answer() : SideAnswer::waiting;
      if (answer == SideAnswer::leave) {
        return fail(ErrorCode::internal, "the program ends");
      }
      if (answer == SideAnswer::stop) {
        return Step::stopped;
      }
      if (now - checked >= kCheckUnitEvery) {
        checked = now;
        if (is_away()) {
          return Step::away;
        }
      }
      clock.sleep(std::min<std::chrono::nanoseconds>(until - now, kAskEvery));
    }
    return is_away() ? Step::away : Step::done;
  }

  Status turn_to(const CapturePose& pose) {
    if (const auto* const side = std::get_if<device::Pose>(&pose); side != nullptr) {
      return on_jig_.jig->go_to(*side);
    }
    // Without a jig a person has stood it there.
    return corner_jig() != nullptr ? corner_jig()->go_to_corner(std::get<device::Corner>(pose))
                                   : Status{};
  }

  Result<Step> record_side(const CapturePose& pose, std::size_t number) {
    SIXPOINT_ASSIGN(const Step placed, place(pose, number));
    if (placed != Step::done) {
      return placed;
    }
    SIXPOINT_CHECK(look_at_jig());
    SIXPOINT_CHECK(turn_to(pose));
    auto rested = rest();
    SIXPOINT_CHECK(look_at_jig());
    return rested;
  }

  // A stop or a fault of a motorised jig ends the capture.
  Status look_at_jig() const {
    return on_jig_.jig->turns_by_itself() ? device::check_jig(*on_jig_.jig) : Status{};
  }

  bool is_done(const CapturePose& pose) const {
    return std::any_of(progress_.done.begin(), progress_.done.end(),
                       [&pose](const CaptureResume::Side& one) { return one.pose == pose; });
  }

  // True when all sides are recorded, false when the person stopped.
  Result<bool> record_sides() {
    for (std::size_t number = 1; number <= poses_.size();) {
      const CapturePose& pose = poses_[number - 1];
      if (is_done(pose)) {
        ++number;
        continue;
      }
      SIXPOINT_ASSIGN(const Step step, record_side(pose, number));
      if (step == Step::stopped) {
        return false;
      }
      if (step == Step::away) {
        SIXPOINT_CHECK(come_back(away_));
        SIXPOINT_CHECK(retry([&] { return begin_anew(); }));
        number = 1;
        continue;
      }
      progress_.done.push_back({pose, recording_});
      save();
    }
    return true;
  }

  // Also after an error: a unit that is left recording empties its battery.
  Status end_recording() {
    SIXPOINT_CHECK(retry([&] { return unit().identify(); }));
    const auto stopped = retry([&] { return unit().stop_recording(); });
    wanted_s_ = std::chrono::duration<double>(unit().clock().elapsed() - piece_began_).count();
    if (!stopped) {
      if (stopped.error().code != ErrorCode::io) {
        return fail(stopped.error());
      }
      report_.notes.push_back(
          "the unit had stopped recording by itself: it started anew, or its "
          "battery or memory gave out");
    }
    return {};
  }

  // The recordings of this capture, oldest first.
  Result<std::vector<device::RecordingInfo>> list_recordings() {
    SIXPOINT_ASSIGN(auto made, retry([&] { return unit().recordings(); }));
    const auto& sides = progress_.done;
    std::erase_if(made, [&](const device::RecordingInfo& recording) {
      return std::none_of(sides.begin(), sides.end(),
                          [&](const auto& side) { return side.recording == recording.id; });
    });
    const bool complete = std::all_of(sides.begin(), sides.end(), [&](const auto& side) {
      return std::any_of(made.begin(), made.end(),
                         [&](const auto& recording) { return recording.id == side.recording; });
    });
    if (!complete) {
      return fail(ErrorCode::io, "the unit does not list the recording it made", report_.serial,
                  "plug the unit in again and repeat");
    }
    return made;
  }

  Status fetch(const std::string& path) {
    SIXPOINT_ASSIGN(const auto made, list_recordings());
    report_.file = path;
    if (made.size() == 1) {
      SIXPOINT_CHECK(download(made.front(), path));
      report_.file_sha256 = to_hex(made.front().sha256);
      return check_and_solve(env_, options_, path,
                             pieces_ ? std::nullopt : std::optional(wanted_s_), report_);
    }
    for (std::size_t i = 0; i < made.size(); ++i) {
      report_.pieces.push_back(piece_name(path, i + 1));
      SIXPOINT_CHECK(download(made[i], report_.pieces.back()));
      SIXPOINT_ASSIGN(const Oddities oddities, find_oddities(env_.files, report_.pieces.back()));
      note_jump(oddities, report_);
    }
    SIXPOINT_CHECK(join_recordings(env_.files, report_.pieces, path));
    SIXPOINT_ASSIGN(report_.file_sha256, file_sha256(env_.files, path));
    return check_and_solve(env_, options_, path, std::nullopt, report_);
  }

  // What an earlier program downloaded already is not downloaded again.
  Status download(const device::RecordingInfo& recording, const std::string& path) {
    if (pieces_ && env_.files.info(path)) {
      SIXPOINT_ASSIGN(const std::string there, file_sha256(env_.files, path));
      if (there == to_hex(recording.sha256)) {
        return {};
      }
    }
    return retry([&] { return unit().download(recording, env_.files, path, {}); });
  }

  UnitOnJig on_jig_;
  Env& env_;
  const CaptureOptions& options_;
  const CaptureHooks& hooks_;
  std::vector<CapturePose> poses_;  // in the order in which they are asked for
  CaptureReport report_;
  CaptureResume progress_;
  std::uint16_t recording_ = 0;              // under way
  std::chrono::nanoseconds piece_began_{0};  // by the clock that no one sets
  double wanted_s_ = 0;
  bool pieces_ = false;  // the unit was away, or an earlier program began this
  Error away_;           // why the unit is away
  bool gone_ = false;    // the unit did not come back: on_jig_ is not valid any more
};

}  // namespace

Result<CaptureReport> run_capture(UnitOnJig on_jig, Env& env, const CaptureOptions& options,
                                  const CaptureHooks& hooks,
                                  const std::optional<CaptureResume>& resume) {
  return CaptureRun(on_jig, env, options, hooks).run(resume);
}

}  // namespace sixpoint::station

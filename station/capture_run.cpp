#include "station/capture_run.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/sha256.h"
#include "gt3x/recording.h"
#include "repair/constants_finder.h"
#include "repair/survey.h"

namespace sixpoint::station {

namespace {

std::chrono::nanoseconds from_seconds(double time_s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(time_s));
}

// A turn between two seconds may cost one at either end.
constexpr double kShort_s = 5;

struct Oddities {
  double jumped_s = 0;  // how far the times of the seconds are off one another, summed up
  int repeated_s = 0;   // the longest stretch of seconds with the very same samples
};

// What a clock or a sensor that failed leaves in a recording.
Result<Oddities> look_for_oddities(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(gt3x::Recording recording, gt3x::Recording::open(files, path));
  SIXPOINT_ASSIGN(gt3x::LogReader log, recording.open_log());
  Oddities oddities;
  int repeated_s = 0;
  Bytes before;
  std::optional<std::uint32_t> last;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      return oddities;
    }
    if (item->kind != gt3x::LogItem::Kind::record || !item->record.checksum_ok ||
        (item->record.type != static_cast<std::uint8_t>(gt3x::RecordType::activity) &&
         item->record.type != static_cast<std::uint8_t>(gt3x::RecordType::activity2))) {
      continue;
    }
    if (last) {
      oddities.jumped_s += static_cast<double>(item->record.unix_time) - *last - 1;
    }
    last = item->record.unix_time;
    const auto payload = item->record.payload;
    repeated_s = std::equal(payload.begin(), payload.end(), before.begin(), before.end())
                     ? repeated_s + 1
                     : 0;
    oddities.repeated_s = std::max(oddities.repeated_s, repeated_s);
    before.assign(payload.begin(), payload.end());
  }
}

// True when the unit went through all sides.
Result<bool> go_round(device::Unit& unit, device::Jig& jig, const CaptureOptions& options,
                      const SidePrompt& prompt) {
  std::size_t number = 0;
  for (const device::Pose side : device::kPoses) {
    if (!prompt(side, ++number, device::kPoses.size())) {
      return false;
    }
    SIXPOINT_CHECK(jig.go_to(side));
    const auto until = unit.clock().elapsed() + from_seconds(options.turn_s + options.side_s);
    for (auto now = unit.clock().elapsed(); now < until; now = unit.clock().elapsed()) {
      if (options.cancelled && options.cancelled()) {
        return false;
      }
      unit.clock().sleep(
          std::min<std::chrono::nanoseconds>(until - now, std::chrono::milliseconds(200)));
    }
  }
  return true;
}

// The unit recorded without a pause while it was watched: no two blocks are further apart than a
// side and a turn. What its clock jumped by is no time in which its zeros could have drifted.
void undo_jumps(std::vector<calib::StillBlock>& blocks, double longest_s) {
  double shift_s = 0;
  for (std::size_t i = 1; i < blocks.size(); ++i) {
    blocks[i].start_time_s += shift_s;
    const double gap_s = blocks[i].start_time_s - blocks[i - 1].start_time_s;
    if (!(gap_s > 0 && gap_s <= longest_s)) {
      const double put_right_s = longest_s - gap_s;
      shift_s += put_right_s;
      blocks[i].start_time_s += put_right_s;
    }
  }
}

// True where the clock of the unit jumped.
Result<bool> note_oddities(FileSystem& files, const std::string& path, CaptureReport& report) {
  SIXPOINT_ASSIGN(const Oddities oddities, look_for_oddities(files, path));
  if (std::abs(oddities.jumped_s) > kShort_s) {
    report.notes.push_back(
        fmt::format("the times in the recording jump by {:+.0f} s: the unit's clock was wrong",
                    oddities.jumped_s));
  }
  if (oddities.repeated_s > kShort_s) {
    report.notes.push_back(fmt::format(
        "the sensor repeated the very same readings for {} s: it is frozen", oddities.repeated_s));
  }
  return std::abs(oddities.jumped_s) > kShort_s;
}

Result<std::string> hash_of(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto file, files.open(path));
  Sha256 hash;
  Bytes piece(1U << 20U);
  for (std::uint64_t offset = 0;;) {
    SIXPOINT_ASSIGN(const std::size_t count, file->read_at(offset, piece));
    if (count == 0) {
      return to_hex(hash.finish());
    }
    hash.update(std::span<const std::uint8_t>(piece).first(count));
    offset += count;
  }
}

// The file is there: what it says about itself, and its constants.
Status check_and_solve(Env& env, const CaptureOptions& options, std::optional<double> wanted_s,
                       CaptureReport& report) {
  SIXPOINT_ASSIGN(repair::Survey survey, repair::survey(env.files, options.output));
  if (survey.facts.serial != report.serial) {
    return fail(ErrorCode::bad_data,
                fmt::format("the recording is of {}", printable(survey.facts.serial, 40)),
                options.output, "another unit was plugged in; begin anew");
  }
  if (wanted_s && survey.duration_s < *wanted_s - kShort_s) {
    report.notes.push_back(
        fmt::format("the recording holds {:.0f} s of {:.0f}: is the unit's memory full, or its "
                    "battery empty?",
                    survey.duration_s, *wanted_s));
  }
  SIXPOINT_ASSIGN(const bool jumped, note_oddities(env.files, options.output, report));
  if (jumped && wanted_s) {
    undo_jumps(survey.blocks, options.side_s + options.turn_s);
  }
  const auto begin = env.clock.elapsed();
  SIXPOINT_ASSIGN(report.solved, repair::solve_survey(options.output, survey, options.solve));
  report.solved->seconds = std::chrono::duration<double>(env.clock.elapsed() - begin).count();
  return {};
}

// Does `step` until it succeeds, and waits for the unit in between where that is what failed.
template <class Step>
auto with_the_same_unit(device::Unit& unit, const CaptureOptions& options, CaptureReport& report,
                        Step step) -> decltype(step()) {
  for (int attempt = 1;; ++attempt) {
    auto result = step();
    if (result || attempt >= options.downloads ||
        result.error().code != ErrorCode::device_unavailable) {
      return result;
    }
    if (const Status back = unit.reconnect(from_seconds(options.replug_patience_s)); !back) {
      return fail(back.error());
    }
    report.notes.push_back(fmt::format("the unit came back ({})", result.error().what));
  }
}

}  // namespace

std::vector<std::string> why_recording_cannot_help(const device::FilterState& filter,
                                                   const std::string& serial,
                                                   const std::string& firmware) {
  if (filter.recording == calib::FilterConfiguration::current) {
    return {};
  }
  return {fmt::format("{} with firmware {} records under the filter 'legacy', for which its stored "
                      "constants are right; affected files were recorded under 'current'",
                      printable(serial, 40), printable(firmware, 40)),
          "install a firmware from 1.4.0 to 1.7.0 on this unit and capture again, or measure it on "
          "the jig ('sixpoint jig' sets the filter itself)"};
}

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
  SIXPOINT_ASSIGN(report.file_sha256, hash_of(env.files, options.output));
  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(env.files, options.output));
  if (const auto filter = repair::filter_in_force(survey.facts)) {
    report.recording_filter = *filter;
    report.refusal = why_recording_cannot_help({*filter, *filter}, report.serial, report.firmware);
    if (!report.refusal.empty()) {
      return report;
    }
  }
  SIXPOINT_CHECK(check_and_solve(env, options, std::nullopt, report));
  return report;
}

Result<CaptureReport> run_capture(device::Unit& unit, device::Jig& jig, Env& env,
                                  const CaptureOptions& options, const SidePrompt& prompt) {
  CaptureReport report;
  report.serial = unit.identity().serial;
  report.firmware = unit.identity().firmware;
  SIXPOINT_ASSIGN(const device::FilterState filter, unit.filter());
  report.recording_filter = filter.recording;
  report.refusal = why_recording_cannot_help(filter, report.serial, report.firmware);
  if (!report.refusal.empty()) {
    return report;
  }
  if (env.files.info(options.output)) {
    return fail(ErrorCode::cannot_create, "the file exists already", options.output,
                "choose another name with -o, or remove it");
  }

  const UtcTime started = unit.clock().now();
  SIXPOINT_ASSIGN(const std::uint16_t id, unit.start_recording(options.rate_hz, started));
  const Result<bool> round = go_round(unit, jig, options, prompt);
  // First of all: a unit left recording runs empty. Perhaps it is another by now: ask.
  SIXPOINT_CHECK(with_the_same_unit(unit, options, report, [&] { return unit.identify(); }));
  const auto stopped = with_the_same_unit(
      unit, options, report, [&]() -> Result<std::uint16_t> { return unit.stop_recording(); });
  const double wanted_s = std::chrono::duration<double>(unit.clock().now() - started).count();
  if (!stopped) {
    if (stopped.error().code != ErrorCode::io) {
      return fail(stopped.error());
    }
    // It is not recording any more: what there is, is in its list.
    report.notes.push_back(
        "the unit had stopped recording by itself: it started anew, or its "
        "battery or memory gave out");
  }
  SIXPOINT_CHECK(round);
  if (!*round) {
    report.stopped = true;
    return report;
  }

  SIXPOINT_ASSIGN(const auto recordings,
                  with_the_same_unit(unit, options, report, [&] { return unit.recordings(); }));
  const device::RecordingInfo* made = nullptr;
  for (const device::RecordingInfo& recording : recordings) {
    made = recording.id == id ? &recording : made;
  }
  if (made == nullptr) {
    return fail(ErrorCode::io, "the unit does not list the recording it made", report.serial,
                "plug the unit in again and repeat");
  }
  SIXPOINT_CHECK(with_the_same_unit(
      unit, options, report, [&] { return unit.download(*made, env.files, options.output); }));
  report.file = options.output;
  report.file_sha256 = to_hex(made->sha256);

  SIXPOINT_CHECK(check_and_solve(env, options, wanted_s, report));
  return report;
}

}  // namespace sixpoint::station

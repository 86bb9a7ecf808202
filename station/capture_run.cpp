#include "station/capture_run.h"

#include <fmt/format.h>

#include "repair/constants_finder.h"
#include "repair/survey.h"

namespace sixpoint::station {

namespace {

std::chrono::nanoseconds from_seconds(double time_s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(time_s));
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

  SIXPOINT_ASSIGN(const std::uint16_t id, unit.start_recording(options.rate_hz, env.clock.now()));
  const Result<bool> round = go_round(unit, jig, options, prompt);
  SIXPOINT_CHECK(unit.stop_recording());  // first of all: a unit left recording runs empty
  SIXPOINT_CHECK(round);
  if (!*round) {
    report.stopped = true;
    return report;
  }

  SIXPOINT_ASSIGN(const auto recordings, unit.recordings());
  const device::RecordingInfo* made = nullptr;
  for (const device::RecordingInfo& recording : recordings) {
    made = recording.id == id ? &recording : made;
  }
  if (made == nullptr) {
    return fail(ErrorCode::io, "the unit does not list the recording it made", report.serial,
                "plug the unit in again and repeat");
  }
  SIXPOINT_CHECK(unit.download(*made, env.files, options.output));
  report.file = options.output;
  report.file_sha256 = to_hex(made->sha256);

  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(env.files, options.output));
  if (survey.facts.serial != report.serial) {
    return fail(ErrorCode::bad_data,
                fmt::format("the recording is of {}", printable(survey.facts.serial, 40)),
                options.output, "another unit was plugged in; begin anew");
  }
  const auto begin = env.clock.elapsed();
  SIXPOINT_ASSIGN(report.solved, repair::solve_survey(options.output, survey, options.solve));
  report.solved->seconds = std::chrono::duration<double>(env.clock.elapsed() - begin).count();
  return report;
}

}  // namespace sixpoint::station

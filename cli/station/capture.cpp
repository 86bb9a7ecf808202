// sixpoint capture: the customer's calibration file, in the terminal.
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "calib/poses/efficiency.h"
#include "cli/command.h"
#include "cli/devices/replay_rule.h"
#include "cli/people_text.h"
#include "cli/station/jig_options.h"
#include "cli/station/record_option.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "station/capture/capture_run.h"
#include "station/records/station_guard.h"

namespace sixpoint::cli {

namespace {

struct CaptureCommandOptions : JigOptions {
  std::string output;
  std::string constants_out;
  std::string station;
  std::string limits;
  std::string sides = "faces";
  int rate_hz = 30;
  double side_s = 40;
  double turn_s = 5;
  int patience_s = 60;
};

struct CaptureDone {
  station::CaptureReport report;
  std::optional<SavedConstants> saved;
};

Result<station::CaptureOptions> capture_options(Context& context,
                                                const CaptureCommandOptions& options,
                                                const std::string& serial) {
  station::CaptureOptions capture;
  capture.corners = options.sides == "corners";
  capture.rate_hz = options.rate_hz;
  capture.side_s = options.side_s;
  capture.turn_s = options.turn_s;
  capture.replug_patience_s = options.patience_s;
  capture.output = options.output;
  if (capture.output.empty()) {
    const std::string day = to_iso8601(context.env.clock.now()).substr(0, 10);
    capture.output = fmt::format("{}-calibration-{}.gt3x", printable(serial, 20), day);
  }
  SIXPOINT_ASSIGN(const auto gravity, local_gravity(options.gravity));
  if (gravity) {
    capture.solve.gravity_g = gravity->g();
    capture.solve.gravity_sd_g = gravity->sd_g();
  }
  return capture;
}

std::string in_words(device::Pose side) {
  return fmt::format("{} - its {} axis points {}", device::to_string(side),
                     kAxisNames[device::axis_of(side)], device::sign_of(side) > 0 ? "up" : "down");
}

std::string in_words(const device::Corner& corner) {
  PerAxis<std::string_view> ways;
  for (std::size_t a = 0; a < kAxes; ++a) {
    ways[a] = corner.signs[a] > 0 ? "up" : "down";
  }
  return fmt::format("{} - stood on a corner, in a mug for example, its x axis {}, y {}, z {}",
                     device::to_string(corner), ways[0], ways[1], ways[2]);
}

// Asks the person to turn the unit; a jig that turns by itself needs no answer. `stop` is there
// with such a jig only.
station::SideAnswer ask(Context& context, double side_s, std::optional<StopRequest>& stop,
                        mocks::VirtualHands* hands, const std::string& what) {
  if (stop && stop->requested()) {
    return station::SideAnswer::stop;
  }
  const bool by_itself = stop.has_value();
  context.people << fmt::format(
                        "{}; then leave it alone for {:.0f} s{}\n", what, side_s,
                        by_itself ? "" : ". Lay it down, then press Enter (s and Enter: stop)")
                 << std::flush;
  if (by_itself) {
    return station::SideAnswer::placed;
  }
  for (std::string line; std::getline(context.in, line);) {
    const PromptWord word = prompt_word(line);
    if (word != PromptWord::other) {
      return word == PromptWord::stop ? station::SideAnswer::stop : station::SideAnswer::placed;
    }
    const auto done = hands != nullptr ? hands->obey(line) : Result<std::string>();
    context.people << (hands == nullptr ? fmt::format("'{}' is no word here", printable(line, 40))
                       : done           ? *done
                                        : done.error().brief())
                   << "; Enter alone: it lies there; s and Enter: stop\n"
                   << std::flush;
  }
  return station::SideAnswer::stop;
}

Result<CaptureDone> capture(Context& context, const CaptureCommandOptions& options,
                            Outputs& outputs, device::SessionRecorder& recorder) {
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.input(options.limits));
  SIXPOINT_CHECK(read_for_device(options.device, outputs));
  if (!options.constants_out.empty()) {
    SIXPOINT_CHECK(refuse_of_replay(options.device, "--constants-out"));
  }
  SIXPOINT_CHECK(outputs.file("--constants-out", options.constants_out));
  SIXPOINT_CHECK(outputs.file_to_keep("--output", options.output));
  // Ctrl-C ends the recording of a unit that a jig turns, in order. By hand it ends this program at
  // once. Made before the threads of the device are.
  std::optional<StopRequest> stop(std::in_place);
  SIXPOINT_ASSIGN(const JiggedUnit opened, open_unit(context, options, outputs, recorder));
  if (!opened.jig->turns_by_itself()) {
    stop.reset();
  }
  device::Unit& unit = *opened.unit;
  SIXPOINT_ASSIGN(const auto how, capture_options(context, options, unit.identity().serial));
  if (options.output.empty()) {
    SIXPOINT_CHECK(outputs.file_to_keep("--output", how.output));
  }
  Env env = outputs.env();
  context.people << fmt::format("unit {} with firmware {}\n", printable(unit.identity().serial),
                                printable(unit.identity().firmware));
  // The lock of the station and the limit on failures hold for every way to constants.
  auto store = open_store(context, options.store);
  warn_without_store(context, store);
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.limits));
  SIXPOINT_CHECK(station::StationGuard(context.env, guard_folder(options.store), limits)
                     .may_start(store, unit.identity().serial, options.station));
  CaptureDone done;
  if (unit.abilities().records_on_command) {
    if (opened.hands) {
      context.people << kWordsForHands << std::flush;
    }
    station::CaptureHooks hooks;
    hooks.ask = [&](device::Pose side, std::size_t number, std::size_t of) {
      return ask(context, options.side_s, stop, opened.hands.get(),
                 fmt::format("side {} of {}: {}", number, of, in_words(side)));
    };
    hooks.ask_corner = [&](const device::Corner& corner, std::size_t number, std::size_t of) {
      return ask(context, options.side_s, stop, opened.hands.get(),
                 fmt::format("corner {} of {}: {}", number, of, in_words(corner)));
    };
    hooks.next_answer = [&stop] {
      return stop && stop->requested() ? station::SideAnswer::stop : station::SideAnswer::waiting;
    };
    if (!opened.jig->turns_by_itself()) {  // a jig would lay it the same way again
      hooks.again = [&](const std::vector<device::Pose>& /*sides*/) {
        context.people << "these sides have too few still readings: they are asked for again, the "
                          "others are kept\n"
                       << std::flush;
      };
    }
    SIXPOINT_ASSIGN(done.report, station::run_capture(opened.on_jig(), env, how, hooks));
  } else {
    context.people << "this unit offers files only: the recording that it holds is taken\n";
    SIXPOINT_ASSIGN(done.report, station::run_file_capture(unit, env, how));
  }
  if (is_replay(options.device)) {
    done.report.notes.emplace_back("a replayed session is no measurement: no constants are stored");
  } else if (done.report.usable()) {
    store = open_store(context, options.store);  // minutes have gone by
    SIXPOINT_ASSIGN(done.saved, save_capture(context, env, options.store, store, done.report,
                                             options.constants_out));
    if (done.saved->file_problem) {
      report_error(context, *done.saved->file_problem);
    }
  }
  return done;
}

Json to_json(const CaptureDone& done) {
  Json json = document("capture");
  // The keys of `solve`, whether something was solved or not.
  json.update(calib::solve_json(done.report.solved.value_or(calib::SolveReport())));
  if (!done.report.solved) {
    json["serial"] = done.report.serial;
    json["filter"] = calib::to_string(done.report.recording_filter);
    json["method"] = nullptr;
    json["verdict"] = done.report.stopped ? "stopped" : "refused";
    json["reasons"] = done.report.refusal;
    json["gravity_m_per_s2"] = nullptr;
    json["verification"] = nullptr;
  }
  json["notes"] = done.report.notes;
  json["file"] = text_or_null(done.report.file);
  json["sha256"] = text_or_null(done.report.file_sha256);
  json["stored_id"] = done.saved ? Json(done.saved->id) : Json(nullptr);
  json["kept"] = done.saved ? kept_to_json(done.saved->place) : Json(nullptr);
  if (done.saved && done.saved->file_problem) {
    json["error"] = error_to_json(*done.saved->file_problem);
  }
  return json;
}

void print_capture(Context& context, const CaptureDone& done) {
  const station::CaptureReport& report = done.report;
  for (const std::string& note : report.notes) {
    context.people << "note: " << note << '\n';
  }
  if (report.stopped) {
    context.people << "stopped; the recording so far stays in the unit\n";
    return;
  }
  if (!report.refusal.empty()) {
    context.log().error("{}", fmt::join(report.refusal, "; "));
    return;
  }
  context.text() << fmt::format("{}: {}\n", printable(report.file), report.solved->brief());
  const auto& missing = report.solved->verification.missing_directions;
  if (!missing.empty()) {
    context.text() << fmt::format(
        "repeat these sides: {}; the file is kept: give -o another name\n",
        fmt::join(missing, " "));
  }
  if (done.saved) {
    context.text() << "constants " << kept_as(done.saved->place, done.saved->id) << '\n';
  }
  if (report.usable() && !report.clock_jumped) {  // else 'repair' may refuse the file
    next_step(context, false,
              {"repair", "RECORDINGS", "--calibration-file", report.file, "-o", "repaired"});
  }
}

int exit_code_of(const station::CaptureReport& report) {
  if (report.stopped) {
    return kExitStopped;
  }
  if (report.usable()) {
    return kExitPassed;
  }
  // Sides that are missing can be repeated; everything else is a verdict.
  return report.solved && !report.solved->verification.missing_directions.empty()
             ? kExitInconclusive
             : kExitFailed;
}

Status run_capture(const CaptureCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  device::SessionRecorder recorder;
  const Result<CaptureDone> done = capture(context, options, outputs, recorder);
  finish_session(context, recorder, options.record);
  if (!done) {
    return fail(done.error());
  }
  context.worsen(exit_code_of(done->report));
  if (options.json) {
    print_json(context, to_json(*done));
  } else {
    print_capture(context, *done);
  }
  return {};
}

}  // namespace

void add_capture(CLI::App& app, Context& context) {
  auto [command, options] = add_command<CaptureCommandOptions>(
      app, context, "capture",
      "make a calibration file: the unit records on its six sides, and is solved", run_capture);
  add_jig_options(command, options);
  command
      .add_option("--sides", options.sides,
                  "'faces': the six sides; 'corners': and then the eight corners, which show the "
                  "cross-axis terms")
      ->check(CLI::IsMember({"faces", "corners"}))
      ->capture_default_str();
  command.add_option("-o,--output", options.output,
                     "the .gt3x to make (default: SERIAL-calibration-DAY.gt3x)");
  command.add_option("--constants-out", options.constants_out,
                     "also write the constants into this constants.json");
  command.add_option("--station", options.station, "where it is recorded: its lock holds here too");
  command.add_option("--limits", options.limits,
                     "a TOML file of limits (docs/limits.md); else the built-in ones");
  refuse_old_output(command, "--constants", "--constants-out");
  const auto add_number = [&command = command](const char* name, auto& value, auto least, auto most,
                                               const char* about) {
    command.add_option(name, value, about)->check(CLI::Range(least, most))->capture_default_str();
  };
  command.add_option("--rate", options.rate_hz, "sample rate in Hz")
      ->check(CLI::IsMember({30, 40, 50, 60, 70, 80, 90, 100}))  // docs/protocol.md
      ->capture_default_str();
  add_number("--side-seconds", options.side_s, 1.0, 3600.0, "how long the unit rests on a side");
  add_number("--turn-seconds", options.turn_s, 0.0, 60.0, "and before that, to let go of it");
  add_number("--patience", options.patience_s, 0, 3600,
             "seconds to wait for a unit that is not plugged in when its recording is fetched");
}

}  // namespace sixpoint::cli

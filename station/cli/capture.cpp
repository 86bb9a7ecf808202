// sixpoint capture: the customer's calibration file, in the terminal.
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "calib/gravity.h"
#include "gt3x/model.h"
#include "station/capture_run.h"
#include "station/cli/command.h"
#include "station/cli/record_option.h"
#include "station/cli/store_option.h"
#include "station/devices.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string device;
  std::string jig;
  std::string output;
  std::string constants_file;
  std::string store;
  std::string record;
  std::optional<double> gravity_m_per_s2;
  int rate_hz = 30;
  double side_s = 40;
  double turn_s = 5;
  int patience_s = 60;
  bool json = false;
};

struct Done {
  station::CaptureReport report;
  std::optional<std::string> stored_id;
  std::optional<db::Kept> kept;
};

Status keep(Context& context, const Options& options, Done& done) {
  calib::ConstantsOrigin origin;
  origin.sha256 = done.report.file_sha256;
  origin.file = file_name_of(done.report.file);
  SIXPOINT_ASSIGN(const calib::ConstantsRecord record,
                  calib::record_of(*done.report.solved, context.env.clock.now(), origin));
  if (!options.constants_file.empty()) {
    SIXPOINT_CHECK(write_file(context.env.files, options.constants_file,
                              calib::to_json(record).dump(2) + "\n"));
  }
  db::ConstantsRecord row;
  row.made_at = record.made_at;
  row.serial = record.serial;
  row.filter = calib::to_string(record.filter);
  row.method = record.method;
  row.document = calib::to_json(record).dump();
  auto store = open_store(context, options.store);
  SIXPOINT_ASSIGN(
      done.kept, keep_records(context, options.store, store, [&](db::Keeper& keeper) -> Status {
        SIXPOINT_ASSIGN(done.stored_id,
                        keeper.add_constants(row, std::string(gt3x::model_of(record.serial))));
        return {};
      }));
  return {};
}

Result<Done> run(Context& context, const Options& options, device::SessionRecorder& recorder) {
  SIXPOINT_CHECK(begin_session(context, recorder, options.record));
  SIXPOINT_ASSIGN(const auto unit, station::known_units().open(
                                       station::with_jig(options.device, options.jig), context.env,
                                       [&recorder](device::Link& link) { recorder.attach(link); }));
  std::unique_ptr<device::Jig> own_jig;
  SIXPOINT_ASSIGN(device::Jig* const chosen,
                  station::choose_jig(options.jig, *unit, context.env, own_jig));
  device::Jig& jig = *chosen;

  station::CaptureOptions capture;
  capture.rate_hz = options.rate_hz;
  capture.side_s = options.side_s;
  capture.turn_s = options.turn_s;
  capture.replug_patience_s = options.patience_s;
  capture.output = options.output;
  if (capture.output.empty()) {
    const std::string day = to_iso8601(context.env.clock.now()).substr(0, 10);
    capture.output =
        fmt::format("{}-calibration-{}.gt3x", printable(unit->identity().serial, 20), day);
  }
  if (options.gravity_m_per_s2) {
    SIXPOINT_ASSIGN(const calib::LocalGravity gravity,
                    calib::gravity_entered(*options.gravity_m_per_s2));
    capture.solve.gravity_g = gravity.g();
    capture.solve.gravity_sd_g = gravity.sd_g();
  }
  context.people << fmt::format("unit {} with firmware {}\n", printable(unit->identity().serial),
                                printable(unit->identity().firmware));

  const bool by_itself = jig.turns_by_itself();
  const station::SidePrompt prompt = [&](device::Pose side, std::size_t number, std::size_t of) {
    context.people << fmt::format(
        "side {} of {}: {} - its {} axis points {}; then leave it alone for {:.0f} s{}\n", number,
        of, device::to_string(side), kAxisNames[device::axis_of(side)],
        device::sign_of(side) > 0 ? "up" : "down", options.side_s,
        by_itself ? "" : ". Lay it down, then press Enter (q and Enter: stop)");
    context.people << std::flush;
    if (by_itself) {
      return true;
    }
    std::string line;
    return static_cast<bool>(std::getline(context.in, line)) && line != "q";
  };
  Done done;
  if (unit->abilities().records_on_command) {
    SIXPOINT_ASSIGN(done.report, station::run_capture(*unit, jig, context.env, capture, prompt));
  } else {
    context.people << "this unit offers files only: the recording that it holds is taken\n";
    SIXPOINT_ASSIGN(done.report, station::run_file_capture(*unit, context.env, capture));
  }
  if (done.report.usable()) {
    SIXPOINT_CHECK(keep(context, options, done));
  }
  return done;
}

Json to_json(const Done& done) {
  Json json = document("capture");
  if (done.report.solved) {
    json.update(calib::to_json(*done.report.solved));
  } else {
    json["serial"] = done.report.serial;
    json["filter"] = calib::to_string(done.report.recording_filter);
    json["verified"] = false;
    json["verdict"] = done.report.stopped ? "stopped" : "refused";
    json["reasons"] = done.report.refusal;
  }
  json["notes"] = done.report.notes;
  json["file"] = done.report.file.empty() ? Json(nullptr) : Json(done.report.file);
  json["sha256"] = done.report.file_sha256.empty() ? Json(nullptr) : Json(done.report.file_sha256);
  json["stored_id"] = done.stored_id ? Json(*done.stored_id) : Json(nullptr);
  json["kept"] = done.kept ? kept_to_json(*done.kept) : Json(nullptr);
  return json;
}

void print(Context& context, const Done& done) {
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
  context.out << fmt::format("{}: {}\n", printable(report.file), report.solved->brief());
  const auto& missing = report.solved->verification.missing_directions;
  if (!missing.empty()) {
    context.out << fmt::format("repeat these sides: {}\n", fmt::join(missing, " "));
  }
  if (done.stored_id) {
    context.out << fmt::format("constants stored as {}\n", *done.stored_id);
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

}  // namespace

void add_capture(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "capture", "make a calibration file: the unit records on its six sides, and is solved");
  command
      ->add_option("--device", options->device,
                   "the unit, for example virtual:seed=7 (docs/virtual.md)")
      ->required();
  command->add_option("--jig", options->jig,
                      "manual (a person turns the unit), virtual, or hid:SERIAL (a motorised jig)");
  command->add_option("-o,--output", options->output,
                      "the .gt3x to make (default: SERIAL-calibration-DAY.gt3x)");
  command->add_option("--constants", options->constants_file,
                      "also write the constants into this constants.json");
  command->add_option("--gravity", options->gravity_m_per_s2, "local gravity in m/s2");
  command->add_option("--rate", options->rate_hz, "sample rate in Hz")
      ->check(CLI::Range(30, 100))
      ->capture_default_str();
  command->add_option("--side-seconds", options->side_s, "how long the unit rests on a side")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  command
      ->add_option("--turn-seconds", options->turn_s,
                   "and before that, for the hand to let go of it")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  command
      ->add_option(
          "--patience", options->patience_s,
          "seconds to wait for a unit that is not plugged in when its recording is fetched")
      ->check(CLI::Range(0, 3600))
      ->capture_default_str();
  add_store_option(*command, options->store);
  add_record_option(*command, options->record);
  command->add_flag("--json", options->json, "answer as JSON");
  command->callback([options, &context] {
    device::SessionRecorder recorder;
    const Result<Done> done = run(context, *options, recorder);
    finish_session(context, recorder, options->record);
    if (!done) {
      report_error(context, "capture", done.error(), options->json);
      return;
    }
    context.worsen(exit_code_of(done->report));
    if (options->json) {
      print_json(context, to_json(*done));
    } else {
      print(context, *done);
    }
  });
}

}  // namespace sixpoint::cli

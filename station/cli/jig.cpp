// sixpoint jig: the technician's six-orientation run, in the terminal.
#include <memory>

#include <fmt/format.h>

#include "calib/gravity.h"
#include "db/journal.h"
#include "device/unit.h"
#include "gt3x/model.h"
#include "station/cli/command.h"
#include "station/cli/record_option.h"
#include "station/cli/store_option.h"
#include "station/devices.h"
#include "station/jig_session.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string device;
  std::string jig;
  std::string operator_name;
  std::string station;
  std::string filter = "current";
  std::string store;
  std::string record;
  std::optional<double> gravity_m_per_s2;
  std::optional<double> latitude_deg;
  double altitude_m = 0;
  bool write = false;
  bool json = false;
};

struct Done {
  station::JigReport report;
  double residual_limit_mg = 0;  // that the verdict used
  std::string run_id;
  std::optional<std::string> constants_id;
};

int exit_code_of(station::JigVerdict verdict) {
  switch (verdict) {
    case station::JigVerdict::pass:
      return kExitPassed;
    case station::JigVerdict::fail:
      return kExitFailed;
    case station::JigVerdict::inconclusive:
      return kExitInconclusive;
    case station::JigVerdict::stopped:
      return kExitStopped;
  }
  return kExitFailed;
}

// Into the store, or into the journal, which takes the same.
template <class Keeper>
Status keep_in(Keeper& keeper, const Options& options, Done& done) {
  const station::JigReport& report = done.report;
  const std::string model(gt3x::model_of(report.serial));
  db::RunRecord run;
  run.serial = report.serial;
  run.model = model;
  run.kind = "jig";
  run.filter = calib::to_string(report.filter);
  run.started = report.started;
  run.ended = report.ended;
  run.operator_name = options.operator_name;
  run.station = options.station;
  run.jig = report.jig;
  run.verdict = station::to_string(report.verdict);
  run.software = "sixpoint " SIXPOINT_VERSION;
  run.document = report.to_json().dump();
  run.gravity_m_per_s2 = report.gravity.m_per_s2;
  run.codes = report.reasons;
  if (!report.faces.empty()) {
    double sum_c = 0;
    for (const station::PoseReading& face : report.faces) {
      sum_c += face.temperature_c;
    }
    run.temperature_c = sum_c / static_cast<double>(report.faces.size());
  }
  run.limits = Json{{"residual_mg", done.residual_limit_mg}}.dump();
  SIXPOINT_ASSIGN(
      done.run_id,
      keeper.add_run(run, {{"samples.csv", Bytes(report.raw_csv.begin(), report.raw_csv.end())}}));
  if (report.written) {
    db::UnitWrite write;
    write.run_id = done.run_id;
    write.serial = report.serial;
    write.written = report.ended;
    write.as_found =
        report.as_found ? calib::to_json(report.as_found->constants).dump() : std::string("null");
    write.as_left = calib::to_json(report.six->best().stored).dump();
    write.read_back = calib::to_json(report.as_left->constants).dump();
    SIXPOINT_CHECK(keeper.add_unit_write(write));
  }
  if (report.usable()) {
    calib::ConstantsRecord constants = report.record();
    constants.made_from.station = options.station;
    db::ConstantsRecord row;
    row.made_at = report.ended;
    row.serial = report.serial;
    row.filter = calib::to_string(report.filter);
    row.method = constants.method;
    row.run_id = done.run_id;
    row.document = calib::to_json(constants).dump();
    SIXPOINT_ASSIGN(done.constants_id, keeper.add_constants(row, model));
  }
  return {};
}

// A run is not lost because the server is away: it waits in the journal, which every later run and
// 'sixpoint store catch-up' empties in order.
Status keep(Context& context, const Options& options, Done& done) {
  auto store = open_store(context, options.store);
  if (!is_on_server(options.store)) {
    return store ? keep_in(*store, options, done) : Status(fail(store.error()));
  }
  SIXPOINT_ASSIGN(auto journal,
                  db::Journal::open(context.env.files, journal_folder(options.store)));
  Status status = store ? Status() : Status(fail(store.error()));
  if (status) {
    const auto taken = journal.catch_up(*store);
    status = taken ? keep_in(*store, options, done) : Status(fail(taken.error()));
  }
  if (status || status.error().code != ErrorCode::device_unavailable) {
    return status;
  }
  // What the store did take before it went away is named the same, and stored once.
  SIXPOINT_CHECK(keep_in(journal, options, done));
  context.log().warn("{}; the run is kept in this station's journal and goes into the store later",
                     status.error().brief());
  return {};
}

Result<Done> run(Context& context, const Options& options, device::SessionRecorder& recorder) {
  station::JigSessionOptions session;
  SIXPOINT_ASSIGN(session.filter, calib::parse_filter_configuration(options.filter));
  if (options.gravity_m_per_s2) {
    SIXPOINT_ASSIGN(session.gravity, calib::gravity_entered(*options.gravity_m_per_s2));
  } else if (options.latitude_deg) {
    SIXPOINT_ASSIGN(session.gravity, calib::gravity_at(*options.latitude_deg, options.altitude_m));
  }
  session.run.write = options.write;

  session.keep_interrupted = true;

  SIXPOINT_ASSIGN(const auto unit,
                  station::known_units().open(
                      station::with_jig(options.device, options.jig), context.env,
                      [&recorder](device::Link& link) { recorder.attach(link); }));
  if (!unit->abilities().streams || !unit->abilities().holds_constants) {
    return fail(ErrorCode::usage, "this unit offers files and no live samples", unit->address(),
                "calibrate it by a file: 'sixpoint capture'");
  }
  std::unique_ptr<device::Jig> own_jig;
  SIXPOINT_ASSIGN(device::Jig* const chosen,
                  station::choose_jig(options.jig, *unit, context.env, own_jig));
  device::Jig& jig = *chosen;

  context.people << fmt::format("unit {} with firmware {}; jig: {}\n",
                                printable(unit->identity().serial),
                                printable(unit->identity().firmware), jig.name());
  const station::JigTeller tell = [&context](const station::JigAction& action) {
    switch (action.kind) {
      case station::JigAction::Kind::refused:
        context.people << fmt::format("  refused: {}; once more\n", action.text);
        break;
      case station::JigAction::Kind::accepted:
      case station::JigAction::Kind::dropped:
      case station::JigAction::Kind::fit:
      case station::JigAction::Kind::write:
      case station::JigAction::Kind::finished:
        context.people << "  " << action.text << '\n';
        break;
      case station::JigAction::Kind::place:
        context.people << action.text << '\n';
        break;
    }
    context.people << std::flush;
  };
  station::JigHooks hooks;
  hooks.tell = tell;
  hooks.reopen = station::wait_for_unit(*unit, jig, [&context](const std::string& text) {
    context.people << text << '\n' << std::flush;
  });
  Done done;
  SIXPOINT_ASSIGN(done.report, station::run_jig({unit.get(), &jig}, context.env, session, hooks));
  done.residual_limit_mg = session.residual_limit_mg;
  SIXPOINT_CHECK(keep(context, options, done));
  return done;
}

Json to_json(const Done& done) {
  Json json = document("jig");
  json["run"] = done.run_id;
  const Json report = done.report.to_json();
  for (const auto& [key, value] : report.items()) {
    json[key] = value;
  }
  if (done.report.ended_by) {
    json["error"] = error_to_json(*done.report.ended_by);
  }
  json["stored_id"] = done.constants_id ? Json(*done.constants_id) : Json(nullptr);
  json["certificate"] = nullptr;
  return json;
}

void print(Context& context, const Done& done) {
  const station::JigReport& report = done.report;
  context.out << report.brief() << '\n';
  if (report.six) {
    const calib::SixPoseSolution& best = report.six->best();
    context.out << "     sensitivity         zero        +1 g   -1 g    0 g\n";
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      context.out << fmt::format("  {}  {:8.3f} LSB/g {:8.3f} LSB {:6} {:6} {:6}\n",
                                 kAxisNames[axis], 1 / best.calibration.sensitivity_g_per_lsb[axis],
                                 best.calibration.zero_lsb[axis], best.stored.positive_lsb[axis],
                                 best.stored.negative_lsb[axis], best.stored.zero_lsb[axis]);
    }
  }
  context.out << fmt::format("run {}\n", done.run_id);
  if (done.constants_id) {
    context.out << fmt::format("constants stored as {}\n", *done.constants_id);
  }
}

}  // namespace

void add_jig(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("jig", "measure a unit in its six poses and store its constants");
  command
      ->add_option("--device", options->device,
                   "the unit, for example virtual:seed=7 (docs/virtual.md)")
      ->required();
  command->add_option("--jig", options->jig,
                      "manual (a person turns the unit), virtual, or hid:SERIAL (a motorised jig)");
  command->add_option("--operator", options->operator_name, "who runs it, for the record");
  command->add_option("--station", options->station, "where it is run, for the record");
  command->add_option("--filter", options->filter, "filter configuration: current or legacy")
      ->capture_default_str();
  command->add_option("--gravity", options->gravity_m_per_s2,
                      "local gravity in m/s2; unknown: standard gravity, and its uncertainty");
  command->add_option("--latitude", options->latitude_deg,
                      "... or computed from the latitude in degrees");
  command->add_option("--altitude", options->altitude_m, "... and metres above sea level");
  command->add_flag("--write", options->write,
                    "write the constants into the unit, read them back and measure again");
  add_store_option(*command, options->store);
  add_record_option(*command, options->record);
  command->add_flag("--json", options->json, "answer as JSON");
  command->callback([options, &context] {
    device::SessionRecorder recorder;
    const Result<Done> done = run(context, *options, recorder);
    save_session(context, recorder, options->record);
    if (!done) {
      report_error(context, "jig", done.error(), options->json);
      return;
    }
    const std::optional<Error>& ended_by = done->report.ended_by;
    if (ended_by) {
      context.log().error("{}", ended_by->brief());
    }
    context.worsen(ended_by ? static_cast<int>(ended_by->code)
                            : exit_code_of(done->report.verdict));
    if (options->json) {
      print_json(context, to_json(*done));
    } else {
      print(context, *done);
    }
  });
}

}  // namespace sixpoint::cli

// sixpoint jig: the technician's six-orientation run, in the terminal.
#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "calib/gravity.h"
#include "device/unit.h"
#include "gt3x/model.h"
#include "station/cli/command.h"
#include "station/cli/record_option.h"
#include "station/cli/store_option.h"
#include "station/devices.h"
#include "station/jig_session.h"
#include "station/software.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string device;
  std::string jig;
  std::string jig_id;
  std::string jig_due;
  std::string retest_of;
  std::string operator_name;
  std::string station;
  std::string filter = "current";
  std::string store;
  std::string record;
  std::optional<double> gravity_m_per_s2;
  std::optional<double> latitude_deg;
  double altitude_m = 0;
  double dwell_s = station::JigRunOptions{}.dwell_s;
  bool write = false;
  bool json = false;
};

struct Done {
  station::JigReport report;
  std::string run_id;
  std::optional<std::string> constants_id;
  Result<db::Kept> kept = db::Kept{};
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

// The limits that the verdict used, whole: a verdict is nothing without them.
Json limits_of(const station::JigSessionOptions& session) {
  return {{"residual_mg", session.residual_limit_mg},
          {"tilt_deg", session.run.tilt_limit_deg},
          {"moved_mg", session.run.moved_mg},
          {"still_factor", session.run.still_factor},
          {"moved_factor", session.run.moved_factor},
          {"first_noise_mg", session.run.first_noise_limit_mg},
          {"dwell_s", session.run.dwell_s},
          {"rate_hz", session.run.rate_hz}};
}

// What is known before the unit is measured; refused here, it costs no one a run.
Result<db::RunRecord> record_before(Context& context, const Options& options,
                                    const station::JigSessionOptions& session,
                                    const std::string& serial, const std::string& jig,
                                    Result<db::Store>& store) {
  db::RunRecord run;
  run.serial = serial;
  run.model = gt3x::model_of(serial);
  run.kind = "jig";
  run.filter = calib::to_string(session.filter);
  run.operator_name = options.operator_name;
  run.station = options.station;
  run.jig = options.jig_id.empty() ? jig : options.jig_id;
  run.software = station::software_name();
  run.build = station::software_build();
  run.limits = limits_of(session).dump();
  run.gravity_m_per_s2 = session.gravity.m_per_s2;
  run.document = "{}";
  if (!options.jig_due.empty()) {
    const auto due = parse_iso8601(options.jig_due);
    if (!due) {
      return fail(ErrorCode::usage, due.error().what, "--jig-due", "write it as 2027-03-31");
    }
    run.jig_due = *due;
    if (*due < context.env.clock.now()) {
      context.log().warn("the jig was due for its own calibration on {}", to_iso8601(*due));
    }
  }
  if (!options.retest_of.empty()) {
    // In the journal a run that refers to none would block all that come after it.
    if (!store) {
      return fail(store.error());
    }
    SIXPOINT_ASSIGN(const auto history, store->unit_history(serial));
    const auto earlier = std::find_if(
        history.runs.rbegin(), history.runs.rend(), [&](const db::RunRecord& candidate) {
          return candidate.kind == "jig" &&
                 (options.retest_of == "last" || options.retest_of == candidate.id);
        });
    if (earlier == history.runs.rend()) {
      return fail(ErrorCode::no_input,
                  fmt::format("the store has no such jig run of unit {}", printable(serial)),
                  "--retest-of " + printable(options.retest_of, 60),
                  "'sixpoint history SERIAL' lists its runs; or leave the option out");
    }
    run.retest_of = earlier->id;
  }
  SIXPOINT_CHECK(db::id_of(run, {}));
  return run;
}

Status add_records(db::Keeper& keeper, const Options& options, const db::RunRecord& run,
                   Done& done) {
  const station::JigReport& report = done.report;
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
    SIXPOINT_ASSIGN(done.constants_id, keeper.add_constants(row, run.model));
  }
  return {};
}

void complete(db::RunRecord& run, const station::JigReport& report) {
  run.started = report.started;
  run.ended = report.ended;
  run.verdict = station::to_string(report.verdict);
  // The unit's own words may hold anything; a run is kept whatever they are.
  run.document = report.to_json().dump(-1, ' ', false, Json::error_handler_t::replace);
  for (const std::string& reason : report.reasons) {
    run.codes.push_back(db::storable_path(printable(reason, 1500)));
  }
  if (!report.faces.empty()) {
    double sum_c = 0;
    for (const station::PoseReading& face : report.faces) {
      sum_c += face.temperature_c;
    }
    run.temperature_c = sum_c / static_cast<double>(report.faces.size());
  }
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
  session.run.dwell_s = options.dwell_s;

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
  // Opened before the work, so that what nobody can store is said now; a store that is away or
  // refuses is no reason not to measure.
  auto store = open_store(context, options.store);
  if (!store && store.error().code == ErrorCode::usage) {
    return fail(store.error());
  }
  SIXPOINT_ASSIGN(auto record, record_before(context, options, session, unit->identity().serial,
                                             jig.name(), store));
  station::JigHooks hooks;
  hooks.tell = tell;
  hooks.reopen = station::wait_for_unit(*unit, jig, [&context](const std::string& text) {
    context.people << text << '\n' << std::flush;
  });
  Done done;
  SIXPOINT_ASSIGN(done.report, station::run_jig({unit.get(), &jig}, context.env, session, hooks));
  complete(record, done.report);
  done.kept = keep_records(context, options.store, store, [&](db::Keeper& keeper) {
    return add_records(keeper, options, record, done);
  });
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
  json["kept"] = done.kept ? kept_to_json(*done.kept) : Json(nullptr);
  if (!done.kept) {
    json["error"] = error_to_json(done.kept.error());
  }
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
  if (!done.kept) {
    return;
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
  command->add_option("--jig-id", options->jig_id,
                      "the jig's own number, for the record (which units were on it?)");
  command->add_option("--jig-due", options->jig_due,
                      "when the jig itself is due for calibration (2027-03-31), for the record");
  command->add_option("--retest-of", options->retest_of,
                      "the run that this one repeats: its id, or 'last' for the unit's last one");
  command->add_option("--operator", options->operator_name, "who runs it, for the record");
  command->add_option("--station", options->station, "where it is run, for the record");
  command->add_option("--filter", options->filter, "filter configuration: current or legacy")
      ->capture_default_str();
  command->add_option("--gravity", options->gravity_m_per_s2,
                      "local gravity in m/s2; unknown: standard gravity, and its uncertainty");
  command->add_option("--latitude", options->latitude_deg,
                      "... or computed from the latitude in degrees");
  command->add_option("--altitude", options->altitude_m, "... and metres above sea level");
  command->add_option("--dwell", options->dwell_s, "seconds that each pose is measured for")
      ->check(CLI::Range(0.5, 600.0))
      ->capture_default_str();
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
    if (!done->kept) {
      // The report below is then the only copy.
      context.log().error("{}", done->kept.error().brief());
      context.worsen(static_cast<int>(done->kept.error().code));
    }
    if (options->json) {
      print_json(context, to_json(*done));
    } else {
      print(context, *done);
    }
  });
}

}  // namespace sixpoint::cli

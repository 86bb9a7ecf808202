// sixpoint jig: the technician's six-orientation run, in the terminal.
#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "calib/gravity.h"
#include "device/unit.h"
#include "station/certificate.h"
#include "station/cli/command.h"
#include "station/cli/record_option.h"
#include "station/cli/store_option.h"
#include "station/devices.h"
#include "station/jig_session.h"
#include "station/run_folder.h"
#include "station/run_records.h"
#include "station/station_records.h"

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
  std::string limits;
  std::string study;
  std::string certificate;
  std::string label;
  std::string store;
  std::string record;
  std::string state;
  bool anew = false;
  std::optional<double> gravity_m_per_s2;
  std::optional<double> latitude_deg;
  double altitude_m = 0;
  double dwell_s = station::JigRunOptions{}.dwell_s;
  int patience_s = static_cast<int>(station::kReturnPatience.count());
  bool write = false;
  bool json = false;
};

struct Done {
  station::JigReport report;
  std::string run_id;
  std::optional<std::string> constants_id;
  bool certified = false;
  bool labelled = false;
  Result<db::Kept> kept = db::Kept{};
};

// What is known before the unit is measured; refused here, it costs no one a run.
Result<db::RunRecord> record_before(Context& context, const Options& options,
                                    const station::JigSessionOptions& session,
                                    const std::string& serial, const std::string& jig,
                                    Result<db::Store>& store) {
  db::RunRecord run =
      station::run_record_before(session, serial, options.jig_id.empty() ? jig : options.jig_id);
  if (!options.study.empty()) {
    run.kind = station::kStudyKind;
  }
  run.operator_name = options.operator_name;
  run.station = options.station;
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

Status check_outputs(const Options& options) {
  const std::string& path = options.certificate;
  if (!path.empty() && !path.ends_with(".pdf") && !path.ends_with(".json")) {
    return fail(ErrorCode::usage, "a certificate is a .pdf or a .json", path,
                "end the file's name with one of them");
  }
  if (!options.label.empty() && !options.write) {
    return fail(ErrorCode::usage, "a label says that the unit holds what was measured", "--label",
                "add --write, which writes the constants and reads them back");
  }
  if (!options.study.empty() &&
      (options.operator_name.empty() || !options.certificate.empty() || options.write)) {
    return fail(ErrorCode::usage, "a gage study compares operators and changes no unit", "--study",
                "name the --operator, and leave out --write and --certificate");
  }
  return {};
}

// Certificate and label from the record as it is stored, so that they can be made again from there.
// A run without a result has none; what cannot be made is said and is no reason to lose the run.
void make_papers(Context& context, const Options& options, const db::RunRecord& run, Done& done) {
  const auto settle = [&](const Status& made, bool& flag) {
    flag = made.has_value();
    if (!made) {
      context.log().error("{}", made.error().brief());
      if (made.error().code != ErrorCode::bad_data) {
        context.worsen(static_cast<int>(made.error().code));
      }
    }
  };
  if (!options.certificate.empty()) {
    settle(station::write_certificate(context.env.files, options.certificate, run), done.certified);
  }
  if (!options.label.empty()) {
    const auto label = station::label_zpl(run);
    settle(
        label ? write_file(context.env.files, options.label, *label) : Status(fail(label.error())),
        done.labelled);
  }
}

// What the operator typed since the last call, without waiting: a line that begins with u or s.
std::optional<station::OperatorWord> terminal_word() {
  pollfd keyboard{STDIN_FILENO, POLLIN, 0};
  if (poll(&keyboard, 1, 0) <= 0 || (keyboard.revents & POLLIN) == 0) {
    return std::nullopt;
  }
  std::array<char, 80> line{};
  if (read(STDIN_FILENO, line.data(), line.size()) <= 0) {
    return std::nullopt;
  }
  switch (line[0]) {
    case 'u':
      return station::OperatorWord::undo;
    case 's':
    case 'q':
      return station::OperatorWord::stop;
    default:
      return std::nullopt;
  }
}

// A run on the disk while it is under way: the next program goes on with it. Where the disk does
// not take it, the run goes on without.
class RunOnDisk {
 public:
  RunOnDisk(Context& context, std::string folder, station::UnfinishedRun state)
      : context_(context), folder_(context.env, std::move(folder)), state_(std::move(state)) {}

  // What an earlier program left of this unit's run under this filter.
  std::optional<station::JigResume> begin(bool anew) {
    auto left = folder_.load();
    if (!left) {
      context_.log().warn("{}; it is put aside", left.error().brief());
      watch(folder_.set_aside());
      return std::nullopt;
    }
    if (*left && ((*left)->serial != state_.serial || (*left)->filter != state_.filter || anew)) {
      watch(folder_.clear());
      left->reset();
    }
    if (!*left) {
      return std::nullopt;
    }
    return std::move((*left)->resume);
  }
  void hang_into(station::JigHooks& hooks) {
    hooks.raw = [this](std::string_view rows) { watch(folder_.append(rows)); };
    hooks.progress = [this](const station::JigReport& report, const station::JigRun& machine) {
      state_.resume.started = report.started;
      state_.resume.as_found = report.as_found;
      state_.resume.written = report.written ? report.as_left : std::nullopt;
      state_.resume.progress = machine.progress();
      if (machine.phase() != station::JigPhase::finished) {
        watch(folder_.save(state_));
      }
    };
  }
  void end() { watch(folder_.clear()); }

 private:
  void watch(const Status& status) {
    if (!status && !std::exchange(failed_, true)) {
      context_.log().warn("this run would not survive the end of the program: {}",
                          status.error().brief());
    }
  }

  Context& context_;
  station::RunFolder folder_;
  station::UnfinishedRun state_;
  bool failed_ = false;
};

// Nothing where the run is not to be kept: a jig that turns by itself begins anew in two minutes,
// and a gage study measures each run whole.
std::optional<RunOnDisk> run_on_disk(Context& context, const Options& options,
                                     const device::Unit& unit, const device::Jig& jig,
                                     calib::FilterConfiguration filter) {
  const bool by_hand = context.people_at_terminal && !jig.turns_by_itself();
  if (!options.study.empty() || (options.state.empty() && !by_hand)) {
    return std::nullopt;
  }
  const std::string& serial = unit.identity().serial;
  const std::string who = (options.store.empty() ? default_store() : options.store) + "\n" + serial;
  const std::string folder =
      options.state.empty() ? folder_of(journal_folder("")) + "/../jig" : options.state;
  station::UnfinishedRun state;
  state.device = options.device;
  state.serial = serial;
  state.firmware = unit.identity().firmware;
  state.operator_name = options.operator_name;
  state.station = options.station;
  state.write = options.write;
  state.filter = filter;
  const auto digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(who.data()), who.size()));
  return std::optional<RunOnDisk>(
      std::in_place, context, folder + "/" + to_hex(std::span(digest).first(6)), std::move(state));
}

Result<Done> run(Context& context, const Options& options, device::SessionRecorder& recorder) {
  SIXPOINT_CHECK(begin_session(context, recorder, options.record));
  SIXPOINT_CHECK(check_outputs(options));
  station::JigSessionOptions session;
  if (!options.limits.empty()) {
    SIXPOINT_ASSIGN(session.limits, station::read_limits(context.env.files, options.limits));
  }
  SIXPOINT_ASSIGN(session.filter, calib::parse_filter_configuration(options.filter));
  if (options.gravity_m_per_s2) {
    SIXPOINT_ASSIGN(session.gravity, calib::gravity_entered(*options.gravity_m_per_s2));
  } else if (options.latitude_deg) {
    SIXPOINT_ASSIGN(session.gravity, calib::gravity_at(*options.latitude_deg, options.altitude_m));
  }
  session.run.write = options.write;
  session.run.dwell_s = options.dwell_s;

  session.keep_interrupted = true;

  SIXPOINT_ASSIGN(const auto unit, station::known_units().open(
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
  const auto allowed = [&]() -> Result<station::RetestState> {
    if (!store) {
      return fail(store.error());
    }
    return options.study.empty() ? station::may_start(*store, unit->identity().serial,
                                                      options.station, session.limits)
                                 : station::RetestState{};
  }();
  if (allowed) {
    session.retest = *allowed;
  } else if (store && allowed.error().code == ErrorCode::configuration) {
    return fail(allowed.error());
  } else {
    // A store that answers wrongly or not at all is no reason not to measure.
    context.log().warn(
        "the store does not answer: whether the station is locked and how often the "
        "unit failed is not known");
  }
  SIXPOINT_ASSIGN(auto record, record_before(context, options, session, unit->identity().serial,
                                             jig.name(), store));
  if (record.retest_of.empty()) {
    record.retest_of = session.retest.retest_of;
  }
  station::JigHooks hooks;
  hooks.tell = tell;
  hooks.reopen = station::wait_for_unit(
      *unit, jig,
      [&context](const std::string& text) { context.people << text << '\n'
                                                           << std::flush; },
      std::chrono::seconds(options.patience_s));
  if (context.people_at_terminal && isatty(STDIN_FILENO) == 1) {
    context.people << "u and Enter: undo the last pose; s and Enter: stop\n" << std::flush;
    hooks.words = terminal_word;
  }
  auto on_disk = run_on_disk(context, options, *unit, jig, session.filter);
  std::optional<station::JigResume> left;
  if (on_disk) {
    left = on_disk->begin(options.anew);
    on_disk->hang_into(hooks);
  }
  if (left) {
    const station::JigProgress& had = left->progress;
    context.people << fmt::format(
                          "the run of {} goes on; it has {} placements (--anew begins anew)\n",
                          to_iso8601(left->started),
                          had.faces.size() + had.reversed.size() + had.reseat.size() +
                              had.recheck.size())
                   << std::flush;
  }
  Done done;
  SIXPOINT_ASSIGN(done.report,
                  station::run_jig({unit.get(), &jig}, context.env, session, hooks, left));
  station::complete_run_record(record, done.report, options.study);
  station::RunIds stored;
  done.kept = keep_records(context, options.store, store, [&](db::Keeper& keeper) -> Status {
    SIXPOINT_ASSIGN(stored, station::add_run_records(keeper, done.report, record));
    return {};
  });
  done.run_id = stored.run_id;
  done.constants_id = stored.constants_id;
  record.id = done.run_id;
  if (on_disk && done.kept) {
    on_disk->end();
  }
  if (done.kept) {
    make_papers(context, options, record, done);
  }
  return done;
}

Json to_json(const Options& options, const Done& done) {
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
  json["certificate"] = done.certified ? Json(options.certificate) : Json(nullptr);
  json["label"] = done.labelled ? Json(options.label) : Json(nullptr);
  json["kept"] = done.kept ? kept_to_json(*done.kept) : Json(nullptr);
  if (!done.kept) {
    json["error"] = error_to_json(done.kept.error());
  }
  return json;
}

void print(Context& context, const Done& done) {
  const station::JigReport& report = done.report;
  context.out << report.brief() << '\n';
  if (!report.usable()) {
    for (const std::string& action : station::next_actions(report.codes)) {
      context.out << "  what to do: " << action << '\n';
    }
  }
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
  command
      ->add_option("--patience", options->patience_s,
                   "seconds to wait for a unit that went away in mid-run")
      ->check(CLI::Range(0, 3600))
      ->capture_default_str();
  command->add_option("--limits", options->limits,
                      "a TOML file of limits (docs/limits.md); else the built-in ones");
  command->add_option("--certificate", options->certificate,
                      "the calibration certificate: a .pdf or .json to make");
  command->add_option("--label", options->label,
                      "a label for the unit, as ZPL; after a read-back only (--write)");
  command->add_option(
      "--state", options->state,
      "the folder that keeps the run while it is under way, so that the next program "
      "goes on with it; a person at a terminal has one by default");
  command->add_flag("--anew", options->anew, "begin anew where an earlier program left a run");
  command->add_option("--study", options->study,
                      "this run belongs to a gage study of that name (sixpoint gage-rr)");
  command->add_flag("--write", options->write,
                    "write the constants into the unit, read them back and measure again");
  add_store_option(*command, options->store);
  add_record_option(*command, options->record);
  command->add_flag("--json", options->json, "answer as JSON");
  command->callback([options, &context] {
    device::SessionRecorder recorder;
    const Result<Done> done = run(context, *options, recorder);
    finish_session(context, recorder, options->record);
    if (!done) {
      report_error(context, "jig", done.error(), options->json);
      return;
    }
    const std::optional<Error>& ended_by = done->report.ended_by;
    if (ended_by) {
      context.log().error("{}", ended_by->brief());
    }
    context.worsen(ended_by ? static_cast<int>(ended_by->code)
                            : station::exit_code_of(done->report.verdict));
    if (!done->kept) {
      // The report below is then the only copy.
      context.log().error("{}", done->kept.error().brief());
      context.worsen(static_cast<int>(done->kept.error().code));
    }
    if (options->json) {
      print_json(context, to_json(*options, *done));
    } else {
      print(context, *done);
    }
  });
}

}  // namespace sixpoint::cli

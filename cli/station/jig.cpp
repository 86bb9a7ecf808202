// sixpoint jig: the technician's six-orientation run, in the terminal.
#include <algorithm>
#include <array>
#include <functional>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/devices/known_devices.h"
#include "cli/devices/replay_rule.h"
#include "cli/people_text.h"
#include "cli/station/jig_options.h"
#include "cli/station/name_option.h"
#include "cli/station/operator.h"
#include "cli/station/record_option.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "device/unit.h"
#include "station/certificate/certificate.h"
#include "station/lanes/run_folder.h"
#include "station/records/jig_due.h"
#include "station/records/run_records.h"
#include "station/records/station_guard.h"
#include "station/records/station_records.h"
#include "station/run/jig_session.h"

namespace sixpoint::cli {

namespace {

struct JigCommandOptions : JigOptions {
  std::string jig_id;
  std::string jig_due;
  std::string jig_exception;
  std::string jig_exception_by;
  std::string retest_of;
  std::string operator_name;
  std::string pin_file;
  std::string station;
  std::string filter = "current";
  std::string protocol = "production";
  std::string limits;
  std::string study;
  std::string certificate;
  std::string label;
  std::string state;
  bool anew = false;
  double dwell_s = station::JigRunOptions{}.dwell_s;
  int patience_s = static_cast<int>(station::kReturnPatience.count());
  bool write = false;
};

struct JigDone {
  station::JigReport report;
  std::string run_id;
  std::optional<std::string> constants_id;
  bool certified = false;
  bool labelled = false;
  Result<db::Saved> kept = db::Saved{};
};

// The id of the jig run that `--retest-of` names: an id, or the unit's last.
Result<std::string> retested_run(const JigCommandOptions& options, const std::string& serial,
                                 Result<db::Store>& store) {
  if (!store) {
    return fail(store.error());
  }
  const bool last = options.retest_of == "last";
  SIXPOINT_ASSIGN(const auto history, store->unit_history(serial));
  const auto named = last ? Result<std::string>() : store->whole_key("runs", options.retest_of);
  if (!named && named.error().code != ErrorCode::no_input) {
    return fail(named.error());
  }
  const auto earlier =
      std::find_if(history.runs.rbegin(), history.runs.rend(), [&](const db::RunRecord& candidate) {
        return candidate.kind == "jig" && (last || (named && *named == candidate.id));
      });
  if (earlier == history.runs.rend()) {
    return fail(ErrorCode::no_input,
                fmt::format("the store has no such jig run of unit {}", printable(serial)),
                "--retest-of " + printable(options.retest_of, 60),
                "'sixpoint history SERIAL' lists its runs; or leave the option out");
  }
  return earlier->id;
}

Result<station::JigDue> due_of(const JigCommandOptions& options) {
  return station::parse_jig_due(options.jig_due, options.jig_exception, options.jig_exception_by);
}

// What is known before the unit is measured. What can be refused is refused here, before the work.
Result<db::RunRecord> record_before(const JigCommandOptions& options,
                                    const station::JigSessionOptions& session,
                                    const std::string& serial, const std::string& jig,
                                    Result<db::Store>& store) {
  db::RunRecord run =
      station::run_record_before(session, serial, options.jig_id.empty() ? jig : options.jig_id);
  if (!options.study.empty()) {
    run.kind = station::kStudyKind;
  } else if (is_replay(options.device)) {
    run.kind = kReplayKind;
  }
  run.operator_name = options.operator_name;
  run.station = options.station;
  SIXPOINT_ASSIGN(const station::JigDue jig_due, due_of(options));
  run.jig_due = jig_due.due;
  if (options.retest_of.empty()) {
    run.retest_of = session.retest.retest_of;
  } else {
    SIXPOINT_ASSIGN(run.retest_of, retested_run(options, serial, store));
  }
  SIXPOINT_CHECK(db::rows_of(run, {}));
  return run;
}

Status check_outputs(const JigCommandOptions& options, Outputs& outputs) {
  SIXPOINT_CHECK(outputs.input(options.limits));
  SIXPOINT_CHECK(outputs.input(options.pin_file));
  SIXPOINT_CHECK(read_for_device(options.device, outputs));
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.file("--certificate", options.certificate));
  SIXPOINT_CHECK(outputs.file("--label", options.label));
  if (!options.state.empty()) {
    SIXPOINT_CHECK(outputs.working_folder("--state", options.state));
  }
  if (!options.certificate.empty()) {
    SIXPOINT_CHECK(refuse_of_replay(options.device, "--certificate"));
    SIXPOINT_CHECK(station::check_certificate_name(options.certificate));
  }
  if (!options.label.empty()) {
    SIXPOINT_CHECK(refuse_of_replay(options.device, "--label"));
  }
  if (!options.study.empty()) {
    SIXPOINT_CHECK(refuse_of_replay(options.device, "--study"));
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
// An error is reported, and the run goes on.
void make_papers(Context& context, const JigCommandOptions& options, Outputs& outputs,
                 const db::RunRecord& run, JigDone& done) {
  auto report = [&, said = std::string()](const Status& made, bool& flag) mutable {
    flag = made.has_value();
    if (!made) {
      if (made.error().brief() != said) {  // of both papers the same is said once
        said = made.error().brief();
        context.log().error("{}", said);
      }
      if (made.error().code != ErrorCode::bad_data) {
        context.worsen(static_cast<int>(made.error().code));
      }
    }
  };
  if (!options.certificate.empty()) {
    report(station::write_certificate(outputs.files(), options.certificate, run), done.certified);
  }
  if (!options.label.empty()) {
    const auto label = station::label_zpl(run);
    report(label ? write_file(outputs.files(), options.label, *label) : Status(fail(label.error())),
           done.labelled);
  }
}

// Papers are made of what the store has (certificate.h, print_rule.h).
void say_papers_wait(Context& context, const JigCommandOptions& options, const JigDone& done) {
  std::string papers = options.certificate.empty() ? "" : " -o " + bash_word(options.certificate);
  papers += options.label.empty() ? "" : " --label " + bash_word(options.label);
  if (papers.empty()) {
    return;
  }
  context.log().error(
      "no certificate and no label: the store does not have this run yet; when it has it: "
      "sixpoint certificate {}{}{}",
      db::shown_id(done.run_id),
      options.store.empty() ? "" : " --store " + bash_word(options.store), papers);
  context.worsen(done.kept->refusal->code);
}

// The operator's line since the last call, without waiting: u undoes, s or q stops; with a virtual
// unit, words for the hands (mocks/in_process/virtual_hands.h).
std::optional<station::OperatorCommand> operator_at_terminal(Context& context,
                                                             mocks::VirtualHands* hands) {
  pollfd keyboard{STDIN_FILENO, POLLIN, 0};
  if (poll(&keyboard, 1, 0) <= 0 || (keyboard.revents & POLLIN) == 0) {
    return std::nullopt;
  }
  std::array<char, 80> line{};
  const ssize_t count = read(STDIN_FILENO, line.data(), line.size());
  std::string word(line.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  word.erase(std::min(word.find_first_of("\r\n"), word.size()));
  if (word == "u" || word == "undo") {
    return station::OperatorCommand::undo;
  }
  if (prompt_word(word) == PromptWord::stop) {
    return station::OperatorCommand::stop;
  }
  if (hands != nullptr && !word.empty()) {
    const auto done = hands->obey(word);
    context.people << (done ? "  " + *done : done.error().brief()) << '\n' << std::flush;
  }
  return std::nullopt;
}

// The folder of the run on disk; empty where the run is not saved: a jig that turns by itself
// begins again in two minutes, and a gage study measures each run whole.
std::string run_folder(const Context& context, const JigCommandOptions& options,
                       const device::Jig& jig, const std::string& serial) {
  const bool has_person = context.people_at_terminal && !jig.turns_by_itself();
  if (!options.study.empty() || (options.state.empty() && !has_person)) {
    return {};
  }
  return (options.state.empty() ? data_folder() + "/jig" : options.state) + "/" +
         run_folder_name(options.store, serial);
}

station::UnfinishedRun unfinished_run(const JigCommandOptions& options,
                                      const device::Identity& identity,
                                      const station::JigSessionOptions& session,
                                      bool is_authenticated) {
  return {.device = options.device,
          .serial = identity.serial,
          .firmware = identity.firmware,
          .operator_name = options.operator_name,
          .is_authenticated = is_authenticated,
          .station = options.station,
          .write = options.write,
          .filter = session.filter,
          .protocol = session.run.protocol,
          .jig_id = options.jig_id,
          .gravity_m_per_s2 = session.gravity.m_per_s2};
}

Result<station::JigSessionOptions> session_options(Context& context,
                                                   const JigCommandOptions& options) {
  station::JigSessionOptions session;
  SIXPOINT_ASSIGN(session.limits, station::read_limits(context.env.files, options.limits));
  SIXPOINT_ASSIGN(session.filter, calib::parse_filter_configuration(options.filter));
  SIXPOINT_ASSIGN(const auto gravity, local_gravity(options.gravity));
  session.gravity = gravity.value_or(session.gravity);
  session.run.write = options.write;
  session.run.dwell_s = options.dwell_s;
  SIXPOINT_ASSIGN(session.run.protocol, station::parse_jig_protocol(options.protocol));
  session.keep_interrupted = true;
  SIXPOINT_ASSIGN(const station::JigDue jig_due, due_of(options));
  SIXPOINT_CHECK(station::check_jig_due(jig_due, context.env.clock.now()));
  if (!jig_due.exception.empty()) {
    SIXPOINT_CHECK(sign_off(context, jig_due.signed_by));
  }
  if (std::string note = station::jig_due_note(jig_due, context.env.clock.now()); !note.empty()) {
    context.log().warn("{}", note);
    session.notes.push_back(std::move(note));
  }
  return session;
}

// What the unit's earlier runs demand of this one. Where the store does not answer, the station
// remembers what it said last.
Result<station::RetestState> retest_state(Context& context, const JigCommandOptions& options,
                                          const std::string& serial, station::StationGuard& guard,
                                          Result<db::Store>& store) {
  if (is_replay(options.device)) {
    return station::RetestState{};
  }
  if (!store) {
    context.log().warn(
        "the store does not answer: whether the station is locked and how often the unit failed "
        "is taken from this station's memory");
  }
  return guard.may_start(store, serial, options.station,
                         options.study.empty() ? station::StartOf::run : station::StartOf::study);
}

void show(Context& context, const station::JigAction& action) {
  switch (action.kind) {
    case station::JigAction::Kind::refused:
      context.people << fmt::format("  refused: {}\n", action.text);
      break;
    case station::JigAction::Kind::place:
      context.people << action.text << '\n';
      break;
    default:
      context.people << "  " << action.text << '\n';
      break;
  }
  context.people << std::flush;
}

station::JigHooks terminal_hooks(Context& context, const JigCommandOptions& options,
                                 const JiggedUnit& opened, std::optional<StopRequest>& stop) {
  station::JigHooks hooks;
  hooks.on_action = [&context](const station::JigAction& action) { show(context, action); };
  hooks.reopen = station::wait_for_unit(
      *opened.unit, *opened.jig,
      [&context](const std::string& text) { context.people << text << '\n'
                                                           << std::flush; },
      std::chrono::seconds(options.patience_s));
  if (context.people_at_terminal && isatty(STDIN_FILENO) == 1) {
    context.people << "u and Enter: undo the last pose; s and Enter: stop\n" << std::flush;
    if (opened.hands) {
      context.people << kWordsForHands << std::flush;
    }
  }
  hooks.next_command = [&context, &opened, &stop,
                        asked = false]() mutable -> std::optional<station::OperatorCommand> {
    if (!asked && stop && stop->requested()) {
      asked = true;
      return station::OperatorCommand::stop;
    }
    return context.people_at_terminal && isatty(STDIN_FILENO) == 1
               ? operator_at_terminal(context, opened.hands.get())
               : std::nullopt;
  };
  return hooks;
}

// Stores a run that has ended; `begun`: who measured it, where several did.
using StoreEndedRun =
    std::function<Status(const station::JigReport&, const station::UnfinishedRun& begun)>;

// The run itself. It is saved in a folder while it is under way, so that the next program can go on
// with it, until `store_run` has stored the report.
Result<station::JigReport> run_and_store(Context& context, const JigCommandOptions& options,
                                         const JiggedUnit& opened,
                                         const station::JigSessionOptions& session,
                                         bool is_authenticated, std::optional<StopRequest>& stop,
                                         const StoreEndedRun& store_run) {
  station::JigHooks hooks = terminal_hooks(context, options, opened, stop);
  const device::Identity& identity = opened.unit->identity();
  const std::string path = run_folder(context, options, *opened.jig, identity.serial);
  station::RunFolder folder(context.env, path);
  station::RunSaver saver(
      folder, unfinished_run(options, identity, session, is_authenticated),
      [&context](const std::string& warning) { context.log().warn("{}", warning); });
  std::optional<station::JigResume> left;
  if (!path.empty()) {
    SIXPOINT_ASSIGN(left, saver.take_left_over(options.anew));
    hooks.raw = [&saver](std::string_view rows) { saver.add_rows(rows); };
    hooks.progress = [&saver](const station::JigReport& report, const station::JigRun& run) {
      saver.save(report, run);
    };
    hooks.write_begins = [&saver](const station::JigReport& report, const station::JigRun& run) {
      return saver.save_now(report, run);
    };
  }
  if (left) {
    context.people << fmt::format(
                          "the run of {} goes on; it has {} placements (--anew begins anew)\n",
                          local_time(left->started), left->progress.placements())
                   << std::flush;
  }
  SIXPOINT_ASSIGN(auto report,
                  station::run_jig(opened.on_jig(), context.env, session, hooks, left));
  if (store_run(report, saver.state()) && !path.empty()) {
    saver.end();
  }
  return report;
}

Result<JigDone> measure(Context& context, const JigCommandOptions& options, Outputs& outputs,
                        device::SessionRecorder& recorder) {
  SIXPOINT_CHECK(check_name_option("--station", options.station));
  SIXPOINT_CHECK(check_name_option("--jig-id", options.jig_id));
  SIXPOINT_CHECK(check_name_option("--operator", options.operator_name));
  SIXPOINT_CHECK(check_outputs(options, outputs));
  SIXPOINT_ASSIGN(auto session, session_options(context, options));
  SIXPOINT_ASSIGN(const station::SignedName who,
                  who_measures(context, options.operator_name, options.pin_file));
  // Ctrl-C stops a motor and the run, which is stored. A run by hand goes on with the next program:
  // there Ctrl-C ends this one at once. Made before the threads of the device are.
  std::optional<StopRequest> stop(std::in_place);
  SIXPOINT_ASSIGN(const JiggedUnit opened, open_unit(context, options, outputs, recorder));
  if (!opened.jig->turns_by_itself()) {
    stop.reset();
  }
  SIXPOINT_CHECK(station::check_protocol(session.run.protocol, *opened.jig));
  const device::Unit& unit = *opened.unit;
  const device::Identity& identity = unit.identity();
  if (!unit.abilities().streams || !unit.abilities().holds_constants) {
    return fail(ErrorCode::usage, "this unit offers files and no live samples", unit.address(),
                "calibrate it by a file: 'sixpoint capture'");
  }
  context.people << fmt::format("unit {} with firmware {}; jig: {}\n", printable(identity.serial),
                                printable(identity.firmware), opened.jig->name());
  // Opened before the work, so that a wrong store is reported now. Without its store a unit is
  // measured all the same.
  auto store = open_store(context, options.store);
  if (!store && store.error().code == ErrorCode::usage) {
    return fail(store.error());
  }
  warn_without_store(context, store);
  station::StationGuard guard(context.env, guard_folder(options.store), session.limits);
  SIXPOINT_ASSIGN(session.retest, retest_state(context, options, identity.serial, guard, store));
  SIXPOINT_ASSIGN(auto record,
                  record_before(options, session, identity.serial, opened.jig->name(), store));
  JigDone done;
  const auto store_run = [&](const station::JigReport& report,
                             const station::UnfinishedRun& begun) -> Status {
    record.operator_name = begun.operator_name;
    station::complete_run_record(record, report, options.study, begun.is_authenticated);
    station::RunIds stored;
    done.kept =
        keep_records(context, options.store, store, [&](db::RecordWriter& writer) -> Status {
          SIXPOINT_ASSIGN(stored, station::add_run_records(writer, report, record));
          return {};
        });
    done.run_id = stored.run_id;
    done.constants_id = stored.constants_id;
    record.id = done.run_id;
    return done.kept ? Status{} : fail(done.kept.error());
  };
  SIXPOINT_ASSIGN(done.report, run_and_store(context, options, opened, session,
                                             who.is_authenticated, stop, store_run));
  if (const Status noted = guard.note_run(record, done.kept && done.kept->in_store()); !noted) {
    context.log().warn("{}", noted.error().brief());
  }
  if (done.kept && done.kept->in_store()) {
    if (store) {
      const auto head = store->head_of_run(record.id);
      if (!head) {  // the run is stored: its report is printed, without papers
        report_error(context, head.error());
        return done;
      }
      record.head = *head;
      if (done.constants_id) {
        const auto said = warn_of_stored(context, *store, done.report.serial, done.report.filter,
                                         *done.constants_id);
        if (!said) {
          report_error(context, said.error());
        }
      }
    }
    make_papers(context, options, outputs, record, done);
  } else if (done.kept) {
    say_papers_wait(context, options, done);
  }
  return done;
}

Json to_json(const JigCommandOptions& options, const JigDone& done) {
  Json json = document("jig");
  json["run"] = done.run_id;
  json.update(done.report.to_json());
  if (done.report.ended_by) {
    json["error"] = error_to_json(*done.report.ended_by);
  }
  json["stored_id"] = value_or_null(done.constants_id);
  json["certificate"] = done.certified ? Json(options.certificate) : Json(nullptr);
  json["label"] = done.labelled ? Json(options.label) : Json(nullptr);
  json["kept"] = done.kept ? kept_to_json(*done.kept) : Json(nullptr);
  if (!done.kept) {
    json["error"] = error_to_json(done.kept.error());
  }
  return json;
}

// What the unit holds now, in the page's words (station/web/src/english.ts):
//
// | verdict                 | written | text                               |
// |-------------------------|---------|------------------------------------|
// | pass, conditional pass  | yes     | PASS - WRITTEN                     |
// | pass, conditional pass  | no      | PASS - NOT WRITTEN                 |
// | inconclusive, stopped   | yes     | THE UNIT NOW HOLDS ... NOT CHECKED |
// | any other; a replay (*) | any     | nothing                            |
//
// (*) nothing was done to a unit. A write that was broken off stands in the reasons
// (JigReport::settle_as_left).
std::string what_it_holds(const station::JigReport& report, bool is_replay) {
  if (is_replay) {
    return {};
  }
  if (report.usable()) {
    const char* verdict = report.verdict == station::JigVerdict::pass ? "PASS" : "CONDITIONAL PASS";
    return report.written
               ? fmt::format("{} - WRITTEN: the unit holds the new constants, as read back",
                             verdict)
               : fmt::format(
                     "{} - NOT WRITTEN: the unit holds its old constants; to change that, measure "
                     "it "
                     "again with --write",
                     verdict);
  }
  const bool is_unjudged = report.verdict == station::JigVerdict::inconclusive ||
                           report.verdict == station::JigVerdict::stopped;
  return is_unjudged && report.written
             ? "THE UNIT NOW HOLDS THE NEW CONSTANTS, and they were not checked: measure it again "
               "with --write"
             : std::string();
}

void print_jig(Context& context, const JigCommandOptions& options, const JigDone& done) {
  const station::JigReport& report = done.report;
  context.text() << report.brief() << '\n';
  if (const std::string holds = what_it_holds(report, is_replay(options.device)); !holds.empty()) {
    context.text() << "  " << holds << '\n';
  }
  if (!report.usable()) {
    for (const std::string& action : station::next_actions(report.codes, report.is_last_failure)) {
      context.text() << "  what to do: " << action << '\n';
    }
  }
  if (report.six) {
    const calib::SixPoseSolution& best = report.six->best();
    context.text() << "     sensitivity         zero        +1 g   -1 g    0 g\n";
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      context.text() << fmt::format("  {}  {:8.3f} LSB/g {:8.3f} LSB {:6} {:6} {:6}\n",
                                    kAxisNames[axis],
                                    1 / best.calibration.sensitivity_g_per_lsb[axis],
                                    best.calibration.zero_lsb[axis], best.stored.positive_lsb[axis],
                                    best.stored.negative_lsb[axis], best.stored.zero_lsb[axis]);
    }
  }
  if (!done.kept) {
    return;
  }
  context.text() << fmt::format("run {}\n", db::shown_id(done.run_id));
  if (is_replay(options.device)) {
    context.text() << "a replayed session is no measurement: no constants are stored\n";
  }
  if (done.constants_id) {
    context.text() << "constants " << kept_as(*done.kept, *done.constants_id) << '\n';
  }
  if (done.certified) {
    context.text() << "certificate " << printable(options.certificate) << '\n';
  }
  if (done.labelled) {
    context.text() << "label " << printable(options.label) << '\n';
  }
  if (report.usable() && options.study.empty() && !is_replay(options.device) && !done.certified &&
      done.kept->in_store()) {
    next_step(context, options.json,
              with_store({"certificate", db::shown_id(done.run_id), "-o", report.serial + ".pdf"},
                         options.store));
  }
}

int exit_code_of(const JigDone& done) {
  const std::optional<Error>& ended_by = done.report.ended_by;
  return ended_by ? static_cast<int>(ended_by->code) : station::exit_code_of(done.report.verdict);
}

Status run_jig(const JigCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  device::SessionRecorder recorder;
  const Result<JigDone> done = measure(context, options, outputs, recorder);
  finish_session(context, recorder, options.record);
  if (!done) {
    return fail(done.error());
  }
  if (done->report.ended_by) {
    context.log().error("{}", done->report.ended_by->brief());
  }
  context.worsen(exit_code_of(*done));
  if (!done->kept) {
    report_error(context, done->kept.error());  // the report below is then the only copy
  }
  if (options.json) {
    print_json(context, to_json(options, *done));
  } else {
    print_jig(context, options, *done);
  }
  return {};
}

// The options that are texts.
struct TextOption {
  const char* name;
  std::string JigCommandOptions::*text;
  const char* about;
};
constexpr std::array<TextOption, 13> kTextOptions = {{
    {"--jig-id", &JigCommandOptions::jig_id, "the jig's own number, for the record"},
    {"--jig-due", &JigCommandOptions::jig_due,
     "when the jig itself is due for calibration (2027-03-31); after that day nothing is measured"},
    {"--jig-exception", &JigCommandOptions::jig_exception,
     "why it is measured all the same, for the record"},
    {"--jig-exception-by", &JigCommandOptions::jig_exception_by, "the engineer who signs for that"},
    {"--retest-of", &JigCommandOptions::retest_of,
     "the run that this one repeats: its id, or 'last' for the unit's last one"},
    {"--operator", &JigCommandOptions::operator_name, "who runs it, for the record"},
    {"--pin-file", &JigCommandOptions::pin_file,
     "file with the PIN of --operator, where the machine has operators (default: it is asked for)"},
    {"--station", &JigCommandOptions::station, "where it is run, for the record"},
    {"--limits", &JigCommandOptions::limits,
     "a TOML file of limits (docs/limits.md); else the built-in ones"},
    {"--certificate", &JigCommandOptions::certificate,
     "the calibration certificate: a .pdf, .json or .dcc.xml to make"},
    {"--label", &JigCommandOptions::label,
     "a label for the unit, as ZPL; after a read-back only (--write)"},
    {"--state", &JigCommandOptions::state,
     "the folder that keeps the run while it is under way, so that the next program goes on with "
     "it; a person at a terminal has one by default"},
    {"--study", &JigCommandOptions::study,
     "this run belongs to a gage study of that name (sixpoint gage-rr)"},
}};

}  // namespace

void add_jig(CLI::App& app, Context& context) {
  auto [command, options] = add_command<JigCommandOptions>(
      app, context, "jig", "measure a unit in its six poses and store its constants", run_jig);
  add_jig_options(command, options);
  for (const TextOption& option : kTextOptions) {
    command.add_option(option.name, options.*option.text, option.about);
  }
  command.add_option("--filter", options.filter, "filter configuration: current or legacy")
      ->capture_default_str();
  command
      .add_option("--protocol", options.protocol,
                  "production, or production+: then three sides once more, turned by half a turn "
                  "about the vertical, so that 'gap diagnose' tells the jig's tilt from the unit's "
                  "(docs/gap.md); by hand")
      ->capture_default_str();
  command.add_option("--dwell", options.dwell_s, "seconds that each pose is measured for")
      ->check(CLI::Range(0.5, 600.0))
      ->capture_default_str();
  command
      .add_option("--patience", options.patience_s,
                  "seconds to wait for a unit that went away in mid-run")
      ->check(CLI::Range(0, 3600))
      ->capture_default_str();
  command.add_flag("--anew", options.anew, "begin anew where an earlier program left a run");
  command.add_flag("--write", options.write,
                   "write the constants into the unit, read them back and measure again");
}

}  // namespace sixpoint::cli

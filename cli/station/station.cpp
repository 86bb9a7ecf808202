// sixpoint station: serves the technician's page.
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <set>
#include <thread>

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "base/text/json_text.h"
#include "cli/command.h"
#include "cli/devices/known_devices.h"
#include "cli/devices/replay_rule.h"
#include "cli/gravity_option.h"
#include "cli/output.h"
#include "cli/station/name_option.h"
#include "cli/station/operator.h"
#include "cli/station/practice_bench.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "db/journal.h"
#include "station/access/operators.h"
#include "station/access/sign_in.h"
#include "station/certificate/certificate.h"
#include "station/certificate/dcc.h"
#include "station/lanes/lanes.h"
#include "station/page/api.h"
#include "station/page/quality_control.h"
#include "station/page/server.h"
#include "station/printing/label_printer.h"
#include "station/printing/print_rule.h"
#include "station/records/jig_due.h"
#include "station/records/run_records.h"
#include "station/records/software.h"
#include "station/records/station_guard.h"
#include "station/records/station_records.h"

namespace sixpoint::cli {

namespace {

struct StationCommandOptions {
  int port = 6020;
  std::string bind = "127.0.0.1";
  std::string token_file;
  std::string tls_certificate;
  std::string tls_key;
  std::vector<std::string> devices;
  std::string store;
  std::string station;
  std::string state;
  std::string files = ".";
  std::string limits;
  std::string printer;
  std::string socket;
  GravityOptions gravity;
  std::string jig_id;
  std::string jig_due;
  std::string jig_exception;
  std::string jig_exception_by;
  bool write = false;
  double side_s = station::CaptureOptions{}.side_s;
};

// The folder of runs under way. Another store or another station's name is another station.
std::string state_folder(const StationCommandOptions& options) {
  return options.state.empty()
             ? data_folder() + "/station/" + run_folder_name(options.store, options.station)
             : options.state;
}

// What the threads of the station ask of the command: the store, one thread at a time, because the
// command's streams belong to one thread. The context is a copy, so that the command's exit code is
// not touched: the page told of a run that went to the journal, and the station ends as it was told
// to.
class StationStore {
 public:
  StationStore(Context& context, const StationCommandOptions& options,
               const station::JigSessionOptions& session, station::JigDue jig_due)
      : context_(context),
        options_(options),
        session_(session),
        jig_due_(std::move(jig_due)),
        guard_(context.env, guard_folder(options.store), session.limits) {}

  Result<db::Store> open() {
    const std::lock_guard lock(mutex_);
    return opened();
  }
  Result<station::RetestState> may_start(const std::string& serial) {
    SIXPOINT_CHECK(station::check_jig_due(jig_due_, context_.env.clock.now()));
    const std::lock_guard lock(mutex_);
    // A store that does not answer is no reason not to measure: keep_records() has a journal, and
    // the station remembers its lock.
    auto store = opened();
    return guard_.may_start(store, serial, options_.station);
  }
  Result<std::optional<Error>> may_write(const station::WaitingConstants& waiting) {
    const std::lock_guard lock(mutex_);
    SIXPOINT_ASSIGN(
        const bool is_kept_beside,
        db::Journal::holds(context_.env.files, journal_folder(options_.store), waiting.id));
    auto store = asked(open_existing_store);
    return station::may_write(store, waiting.serial, waiting.id, is_kept_beside);
  }
  Result<station::RunInStore> add_run(const station::JigReport& measured,
                                      const station::RunLabels& labels);
  // Constants of a calibration file: beside it as FILE.constants.json, and in the store.
  Result<station::KeptConstants> add_constants(const station::CaptureReport& report) {
    const std::lock_guard lock(mutex_);
    auto store = opened();
    SIXPOINT_ASSIGN(auto saved, save_capture(context_, context_.env, options_.store, store, report,
                                             report.file + ".constants.json", LastResort::none));
    return station::KeptConstants{std::move(saved.id), std::move(saved.file_problem),
                                  std::move(saved.said)};
  }
  Result<station::RunDocument> document(const std::string& run_id, const std::string& kind);
  // Labels of runs go there by themselves from now on (print_rule.h).
  void print_to(station::LabelPrinter* printer) { printer_ = printer; }
  Status print_again(const std::string& run_id);

 private:
  // A store that was there and is not is on a disk that is away: no new one takes its place, and the
  // journal keeps what is measured.
  Result<db::Store> opened() {
    auto store = asked(was_there_ ? open_existing_store : open_store);
    was_there_ = was_there_ || store.has_value();
    return store;
  }
  Result<db::Store> asked(Result<db::Store> (*ask)(Context&, const std::string&));
  void print_label(const db::RunRecord& run);

  Context context_;
  const StationCommandOptions& options_;
  const station::JigSessionOptions session_;
  const station::JigDue jig_due_;
  station::StationGuard guard_;
  station::LabelPrinter* printer_ = nullptr;
  std::mutex mutex_;
  bool was_there_ = false;  // the store
  std::chrono::nanoseconds silent_until_{0};
  Error silence_;
};

// A server that gives no answer costs each question ten seconds, and lanes and page would wait for
// one another: it is not asked again for half a minute. The journal keeps what is measured.
Result<db::Store> StationStore::asked(Result<db::Store> (*ask)(Context&, const std::string&)) {
  constexpr std::chrono::seconds kSlow{1};  // what is refused, or is not there, says so at once
  constexpr std::chrono::seconds kNotAsked{30};
  const auto begun = context_.env.clock.elapsed();
  if (begun < silent_until_) {
    return fail(silence_);
  }
  auto store = ask(context_, options_.store);
  if (const auto ended = context_.env.clock.elapsed(); !store && ended - begun > kSlow) {
    silent_until_ = ended + kNotAsked;
    silence_ = store.error();
  }
  return store;
}

// A label that cannot be kept for the printer is no reason to lose the run: it can be printed
// again.
void StationStore::print_label(const db::RunRecord& run) {
  if (printer_ == nullptr || !station::why_no_label(run, /*in_store=*/true).empty()) {
    return;
  }
  const auto added = station::label_zpl(run).and_then([&](const std::string& zpl) {
    return printer_->add({run.id, run.serial, zpl});
  });
  if (!added) {
    context_.log().warn("the label is not printed: {}", added.error().brief());
  }
}

Status StationStore::print_again(const std::string& run_id) {
  const std::lock_guard lock(mutex_);
  SIXPOINT_ASSIGN(db::Store store, asked(open_existing_store));
  SIXPOINT_ASSIGN(const db::RunRecord run, store.run(run_id));
  SIXPOINT_ASSIGN(const std::string zpl, station::label_zpl(run));
  return printer_->add_again({run.id, run.serial, zpl});
}

Result<station::RunInStore> StationStore::add_run(const station::JigReport& measured,
                                                  const station::RunLabels& labels) {
  const std::lock_guard lock(mutex_);
  db::RunRecord run = station::run_record_before(
      session_, measured.serial, labels.jig_id.empty() ? measured.jig : labels.jig_id);
  run.jig_due = jig_due_.due;
  station::JigReport report = measured;
  if (std::string note = station::jig_due_note(jig_due_, measured.ended); !note.empty()) {
    report.reasons.push_back(std::move(note));
  }
  run.kind = labels.kind;
  run.operator_name = labels.operator_name;
  run.station = labels.station;
  run.retest_of = labels.retest_of;
  station::complete_run_record(run, report, {}, labels.is_authenticated);
  station::RunInStore stored;
  auto store = opened();
  const auto work = [&](db::RecordWriter& writer) -> Status {
    SIXPOINT_ASSIGN(stored.ids, station::add_run_records(writer, report, run));
    return {};
  };
  SIXPOINT_ASSIGN(const db::Saved saved,
                  keep_records(context_, options_.store, store, work, LastResort::none));
  stored.is_kept_here = !saved.in_store();
  run.id = stored.ids.run_id;
  if (saved.in_store()) {
    stored.documents = station::documents_of(run);  // made from the store alone
    print_label(run);
    if (stored.ids.constants_id) {
      stored.said =
          warn_of_stored(context_, *store, report.serial, report.filter, *stored.ids.constants_id)
              .value_or("");
    }
  }
  if (const Status noted = guard_.note_run(run, saved.in_store()); !noted) {
    context_.log().warn("{}", noted.error().brief());
  }
  return stored;
}

Result<station::RunDocument> StationStore::document(const std::string& run_id,
                                                    const std::string& kind) {
  const std::lock_guard lock(mutex_);
  SIXPOINT_ASSIGN(db::Store store, asked(open_existing_store));
  SIXPOINT_ASSIGN(const db::RunRecord run, store.run(run_id));
  if (kind == "report.json") {
    Json json = cli::document("jig");
    json["run"] = run.id;
    const Json report = parse_json(run.document);
    if (!report.is_object()) {
      return fail(ErrorCode::bad_data, "the stored report cannot be read", printable(run.id, 80),
                  "see whether the store is damaged: 'sixpoint audit verify'");
    }
    json.update(report);
    return station::RunDocument{"application/json", json.dump(2) + "\n"};
  }
  if (kind == "label.zpl") {
    SIXPOINT_ASSIGN(auto label, station::label_zpl(run));
    return station::RunDocument{"text/plain; charset=utf-8", std::move(label)};
  }
  if (kind.starts_with("certificate.")) {
    SIXPOINT_ASSIGN(const auto certificate, station::certificate_of(run));
    if (kind == "certificate.dcc.xml") {
      return station::RunDocument{"application/xml", station::certificate_dcc(certificate)};
    }
    if (kind == "certificate.json") {
      return station::RunDocument{"application/json", certificate.to_json().dump(2) + "\n"};
    }
    if (kind == "certificate.pdf") {
      SIXPOINT_ASSIGN(const Bytes pdf, station::certificate_pdf(certificate));
      return station::RunDocument{"application/pdf", std::string(pdf.begin(), pdf.end())};
    }
  }
  return fail(ErrorCode::no_input, "a run has no such document", printable(kind, 40),
              "ask for report.json, certificate.pdf, .json or .dcc.xml, or label.zpl");
}

Result<station::LanesOptions> lanes_options(Context& context,
                                            const StationCommandOptions& options) {
  SIXPOINT_CHECK(check_name_option("--station", options.station));
  SIXPOINT_CHECK(check_name_option("--jig-id", options.jig_id));
  station::LanesOptions lanes;
  lanes.devices = options.devices;
  lanes.state_folder = state_folder(options);
  lanes.station = options.station;
  lanes.jig_id = options.jig_id;
  lanes.capture_folder = options.files;
  lanes.capture.side_s = options.side_s;
  SIXPOINT_ASSIGN(const auto gravity, local_gravity(options.gravity));
  lanes.session.gravity = gravity.value_or(lanes.session.gravity);
  SIXPOINT_ASSIGN(lanes.session.limits, station::read_limits(context.env.files, options.limits));
  return lanes;
}

// A burst of pages must not take the descriptors that samples and store need.
void raise_descriptor_limit() {
  constexpr rlim_t kDescriptors = 8192;
  rlimit descriptors{};
  if (getrlimit(RLIMIT_NOFILE, &descriptors) == 0) {
    descriptors.rlim_cur = std::min(descriptors.rlim_max, kDescriptors);
    setrlimit(RLIMIT_NOFILE, &descriptors);
  }
}

// Ends the program where its orderly end takes longer than two seconds: a lane may wait for its
// unit, for the store or for a solution. All that was measured is on the disk at every moment, and
// the next program goes on with it.
class EndInTime {
 public:
  ~EndInTime() { end_ = std::jthread(); }
  // Once, when the end begins.
  void begin(int exit_code) {
    end_ = std::jthread([exit_code](const std::stop_token& stop) {
      std::mutex mutex;
      std::unique_lock lock(mutex);
      std::condition_variable_any ended;
      if (!ended.wait_for(lock, stop, kLongestEnd, [&] { return stop.stop_requested(); })) {
        constexpr std::string_view kText = "sixpoint: ended while a lane was at work; it goes on\n";
        static_cast<void>(!::write(STDERR_FILENO, kText.data(), kText.size()));
        std::_Exit(exit_code);
      }
    });
  }

 private:
  static constexpr std::chrono::milliseconds kLongestEnd{1800};
  std::jthread end_;
};

// Answers with the signal; -1 where the server ended by itself.
int serve_until_signal(station::Server& server, const sigset_t& signals, EndInTime& end) {
  int signal = -1;
  std::jthread waiter([&](const std::stop_token& stop) {
    const timespec between_checks{0, 100'000'000};
    while (!stop.stop_requested() &&
           (signal = sigtimedwait(&signals, nullptr, &between_checks)) < 0) {
    }
    end.begin(exit_of_stop(signal));
    server.stop();
  });
  server.serve();
  waiter.request_stop();
  waiter.join();
  return signal;
}

// What --printer names; nothing without.
Result<std::optional<station::PrinterAddress>> printer_address(
    Context& context, const StationCommandOptions& options) {
  if (options.printer.empty()) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const auto printer, station::parse_printer(options.printer));
  SIXPOINT_CHECK(station::check_printer(context.env.files, printer));
  return printer;
}

// Null without a printer.
Result<std::unique_ptr<station::LabelPrinter>> open_printer(
    Env& env, const std::optional<station::PrinterAddress>& address, const std::string& folder) {
  if (!address) {
    return nullptr;
  }
  return station::LabelPrinter::open(
      env, address->text(), folder,
      [printer = *address](std::string_view zpl, const std::stop_token& stop) {
        constexpr double kLongestLabel_s = 15;
        return station::send_label(printer, zpl, stop, kLongestLabel_s);
      });
}

// Where the page listens, and its certificate.
Result<station::ServerOptions> server_options(Context& context,
                                              const StationCommandOptions& options) {
  SIXPOINT_CHECK(station::may_listen(options.bind, !options.tls_certificate.empty(),
                                     !options.tls_key.empty()));
  station::ServerOptions server;
  server.bind = options.bind;
  server.port = options.port;
  server.unix_socket = options.socket;
  if (!options.tls_certificate.empty()) {
    constexpr std::uint64_t kMostPem_bytes = 1U << 20U;
    SIXPOINT_ASSIGN(const Bytes certificate,
                    read_file(context.env.files, options.tls_certificate, kMostPem_bytes));
    SIXPOINT_ASSIGN(const Bytes key, read_file(context.env.files, options.tls_key, kMostPem_bytes));
    server.tls_certificate.assign(certificate.begin(), certificate.end());
    server.tls_key.assign(key.begin(), key.end());
  }
  return server;
}

// One station at a time in a state folder: two would go on with the same runs and print the same
// labels. Nothing where its file system has no locks.
Result<std::unique_ptr<FileLock>> lock_of_station(const std::string& folder, Context& context) {
  SIXPOINT_CHECK(make_private_folders(context.env.files, folder));
  auto lock = context.env.files.lock(folder + "/station.lock");
  if (!lock) {
    context.log().warn("{}: no lock: {}; let no other station use this folder", printable(folder),
                       lock.error().what);
    return nullptr;
  }
  if (*lock == nullptr) {
    return fail(ErrorCode::cannot_create, "another station is running in this folder of --state",
                folder,
                "end that one, or give this one a --station NAME or --state FOLDER of its own");
  }
  return lock;
}

Status serve(const StationCommandOptions& options, Context& context) {
  std::set<std::string> named;
  for (const std::string& device : options.devices) {
    if (!named.insert(device).second) {
      return fail(ErrorCode::usage, "two lanes cannot have one unit",
                  "--device " + printable(device), "name each device once");
    }
    SIXPOINT_CHECK(refuse_of_replay(device, "--device " + printable(device)));
    SIXPOINT_CHECK(station::check_address(device, context.env));
  }
  SIXPOINT_ASSIGN(const auto listening, server_options(context, options));
  SIXPOINT_ASSIGN(const auto printer_at, printer_address(context, options));
  Outputs outputs(context, {}, /*json=*/false);
  SIXPOINT_CHECK(outputs.working_folder("--state", state_folder(options)));
  SIXPOINT_ASSIGN(auto lanes_asked, lanes_options(context, options));
  SIXPOINT_ASSIGN(
      const station::JigDue jig_due,
      station::parse_jig_due(options.jig_due, options.jig_exception, options.jig_exception_by));
  if (!jig_due.exception.empty()) {
    SIXPOINT_CHECK(sign_off(context, jig_due.signed_by));
  }
  SIXPOINT_ASSIGN(const auto lock, lock_of_station(state_folder(options), context));
  SIXPOINT_ASSIGN(auto token, station::read_or_make_token(context.env.files,
                                                          options.token_file.empty()
                                                              ? state_folder(options) + "/token"
                                                              : options.token_file));
  station::SignIn sign_in(context.env.clock, std::move(token));
  const sigset_t signals = block_stop_signals();
  EndInTime end;  // after all that ends
  raise_descriptor_limit();

  mocks::VirtualBench bench;
  device::TransportRegistry devices = station::known_devices();
  bench.register_in(devices);
  VirtualPracticeBench practice_bench(bench);
  SIXPOINT_ASSIGN(const auto printer,
                  open_printer(context.env, printer_at, state_folder(options) + "/labels"));
  StationStore store(context, options, lanes_asked.session, jig_due);
  // A store that cannot be used is refused before anything is measured.
  if (const auto opened = store.open(); !opened && opened.error().code == ErrorCode::usage) {
    return fail(opened.error());
  }
  store.print_to(printer.get());
  const auto open = [&] { return store.open(); };
  station::QualityControl quality(open, options.station, lanes_asked.session.limits,
                                  context.env.clock);
  lanes_asked.may_start = [&](const std::string& serial) { return store.may_start(serial); };
  lanes_asked.may_write = [&](const station::WaitingConstants& waiting) {
    return store.may_write(waiting);
  };
  const station::StoreConstants store_constants = [&](const station::CaptureReport& report) {
    return store.add_constants(report);
  };
  const station::StoreRun store_run = [&](const station::JigReport& report,
                                          const station::RunLabels& labels) {
    auto stored = store.add_run(report, labels);
    quality.refresh_soon();  // it may have been a check unit
    return stored;
  };
  SIXPOINT_ASSIGN(const auto lanes,
                  station::Lanes::open(context.env, devices, std::move(lanes_asked), store_run,
                                       store_constants));
  station::RepairJob repairs(context.env, open);
  station::Operators operators(context.env, operators_file());
  station::ApiOptions api_options;
  api_options.station = options.station;
  api_options.version = station::software_name();
  api_options.bind = options.bind;
  api_options.tls = !listening.tls_certificate.empty();
  api_options.files_folder = options.files;
  api_options.write_default = options.write;
  api_options.jig = jig_due;
  station::Api api(
      api_options,
      {context.env, *lanes, repairs, sign_in, &practice_bench, store_constants,
       [&](const std::string& run, const std::string& kind) { return store.document(run, kind); },
       &quality, &operators, printer.get(),
       [&](const std::string& run) { return store.print_again(run); }});
  SIXPOINT_ASSIGN(const auto server, station::Server::open(context.env, api, listening));
  // A browser keeps what stands behind # for itself; the page takes it out of the address at once.
  context.out << fmt::format("{}://{}:{}/#code={}\n", api_options.tls ? "https" : "http",
                             server->host(), server->port(), sign_in.first_code())
              << std::flush;
  context.people << fmt::format("{}; Ctrl-C ends the station, runs go on at the next start\n",
                                counted(lanes->size(), "lane"))
                 << std::flush;
  take_stop(context, serve_until_signal(*server, signals, end));
  return {};
}

}  // namespace

void add_station(CLI::App& app, Context& context) {
  auto [command, options] = add_command<StationCommandOptions>(
      app, context, "station", "serve the technician's page", serve);
  command.add_option("--port", options.port, "0: any that is free; the address is printed")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command
      .add_option("--device", options.devices, "a lane's unit (docs/virtual.md); repeatable, to 16")
      ->required();
  add_store_option(command, options.store);
  command
      .add_option("--bind", options.bind,
                  "address to listen on; another one needs TLS, and is opened by an address "
                  "or by a name that the certificate has (subjectAltName)")
      ->capture_default_str();
  command.add_option("--tls-cert", options.tls_certificate, "PEM file: serves https");
  command.add_option("--tls-key", options.tls_key, "PEM file with the key of --tls-cert");
  command.add_option("--token-file", options.token_file,
                     "file with the token of programs; made where it is not there (default: token "
                     "in --state)");
  // In the list of processes every user of the machine reads it.
  command
      .add_option_function<std::string>("--token",
                                        [](const std::string&) {
                                          throw CLI::ValidationError(
                                              "--token", "others can read it: use --token-file");
                                        })
      ->group("");
  command.add_option("--station", options.station, "the station's name, for the record");
  command.add_option("--state", options.state,
                     "folder for runs under way (default: in the user's data folder)");
  command
      .add_option("--files", options.files,
                  "folder below which the page may check and repair files")
      ->capture_default_str();
  command.add_option("--jig-id", options.jig_id, "the jig's own number, for the record");
  command.add_option("--jig-due", options.jig_due,
                     "when the jig itself is due for calibration (2027-03-31); after that day "
                     "nothing is measured");
  command.add_option("--jig-exception", options.jig_exception,
                     "why it is measured all the same, for the record");
  command.add_option("--jig-exception-by", options.jig_exception_by,
                     "the engineer who signs for that");
  command.add_flag("--write", options.write,
                   "the page's runs write the constants into the unit, unless a person says no");
  command.add_option("--limits", options.limits,
                     "a TOML file of limits (docs/limits.md); else the built-in ones");
  command.add_option("--socket", options.socket,
                     "a unix socket for programs of this user: the same interface, without a code");
  command.add_option("--printer", options.printer,
                     "label printer that takes ZPL: /dev/usb/lp0 or tcp://HOST:9100");
  command
      .add_option("--side-seconds", options.side_s,
                  "how long a unit rests on each side of a calibration file")
      ->check(CLI::Range(10.0, 3600.0))
      ->capture_default_str();
  add_gravity_options(command, options.gravity);
}

}  // namespace sixpoint::cli

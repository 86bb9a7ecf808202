// sixpoint station: serves the technician's page.
#include <algorithm>
#include <csignal>
#include <memory>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <sys/resource.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "calib/gravity.h"
#include "gt3x/model.h"
#include "mocks/virtual_bench.h"
#include "station/api.h"
#include "station/certificate.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"
#include "station/devices.h"
#include "station/lanes.h"
#include "station/run_records.h"
#include "station/server.h"
#include "station/software.h"
#include "station/station_desk.h"
#include "station/station_records.h"

namespace sixpoint::cli {

namespace {

struct Options {
  int port = 6020;
  std::string bind = "127.0.0.1";
  std::string token;
  std::vector<std::string> devices;
  std::string store;
  std::string station;
  std::string state;
  std::string files = ".";
  std::string limits;
  std::optional<double> gravity_m_per_s2;
  std::optional<double> latitude_deg;
  double altitude_m = 0;
  double side_s = station::CaptureOptions{}.side_s;
};

bool is_loopback(const std::string& bind) {
  return bind == "127.0.0.1" || bind == "localhost" || bind == "::1";
}

// Where the runs of this station wait while they are under way. Another store, other devices or
// another station's name is another station.
std::string state_folder(const Options& options) {
  if (!options.state.empty()) {
    return options.state;
  }
  const std::string who =
      (options.store.empty() ? default_store() : options.store) + "\n" + options.station;
  const auto digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(who.data()), who.size()));
  return folder_of(journal_folder("")) + "/../station/" + to_hex(std::span(digest).first(6));
}

Result<station::KeptRun> keep_run(Context& context, const Options& options,
                                  const station::JigSessionOptions& session,
                                  const station::JigReport& report,
                                  const station::RunLabels& labels) {
  db::RunRecord run = station::run_record_before(session, report.serial, report.jig);
  run.operator_name = labels.operator_name;
  run.station = labels.station;
  run.retest_of = labels.retest_of;
  station::complete_run_record(run, report);
  auto store = open_store(context, options.store);
  station::RunIds stored;
  SIXPOINT_CHECK(keep_records(context, options.store, store, [&](db::Keeper& keeper) -> Status {
    SIXPOINT_ASSIGN(stored, station::add_run_records(keeper, report, run));
    return {};
  }));
  return station::KeptRun{stored.run_id, stored.constants_id, run.verdict};
}

// Constants of a calibration file: beside it as FILE.constants.json, and in the store.
Result<std::string> keep_capture(Context& context, const Options& options,
                                 const station::CaptureReport& report) {
  calib::ConstantsOrigin origin;
  origin.sha256 = report.file_sha256;
  origin.file = file_name_of(report.file);
  SIXPOINT_ASSIGN(const calib::ConstantsRecord record,
                  calib::record_of(*report.solved, context.env.clock.now(), origin));
  SIXPOINT_CHECK(write_file(context.env.files, report.file + ".constants.json",
                            calib::to_json(record).dump(2) + "\n"));
  db::ConstantsRecord row;
  row.made_at = record.made_at;
  row.serial = record.serial;
  row.filter = calib::to_string(record.filter);
  row.method = record.method;
  row.document = calib::to_json(record).dump();
  auto store = open_store(context, options.store);
  std::string id;
  SIXPOINT_CHECK(keep_records(context, options.store, store, [&](db::Keeper& keeper) -> Status {
    SIXPOINT_ASSIGN(id, keeper.add_constants(row, std::string(gt3x::model_of(record.serial))));
    return {};
  }));
  return id;
}

Result<station::RunDocument> document_of(Context& context, const Options& options,
                                         const std::string& run_id, const std::string& kind) {
  SIXPOINT_ASSIGN(db::Store store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const db::RunRecord run, store.run(run_id));
  const auto as_text = [](const Bytes& bytes) { return std::string(bytes.begin(), bytes.end()); };
  if (kind == "report.json") {
    return station::RunDocument{"application/json", run.document};
  }
  if (kind == "label.zpl") {
    SIXPOINT_ASSIGN(auto label, station::label_zpl(run));
    return station::RunDocument{"text/plain; charset=utf-8", std::move(label)};
  }
  if (kind == "certificate.pdf" || kind == "certificate.json") {
    SIXPOINT_ASSIGN(const auto certificate, station::certificate_of(run));
    if (kind == "certificate.json") {
      return station::RunDocument{"application/json", certificate.to_json().dump(2) + "\n"};
    }
    SIXPOINT_ASSIGN(const Bytes pdf, station::certificate_pdf(certificate));
    return station::RunDocument{"application/pdf", as_text(pdf)};
  }
  return fail(ErrorCode::no_input, "a run has no such document", printable(kind, 40),
              "ask for report.json, certificate.pdf, certificate.json or label.zpl");
}

Result<station::LanesOptions> lanes_options(Context& context, const Options& options) {
  station::LanesOptions lanes;
  lanes.devices = options.devices;
  lanes.state_folder = state_folder(options);
  lanes.station = options.station;
  lanes.capture_folder = options.files;
  lanes.capture.side_s = options.side_s;
  if (options.gravity_m_per_s2) {
    SIXPOINT_ASSIGN(lanes.session.gravity, calib::gravity_entered(*options.gravity_m_per_s2));
  } else if (options.latitude_deg) {
    SIXPOINT_ASSIGN(lanes.session.gravity,
                    calib::gravity_at(*options.latitude_deg, options.altitude_m));
  }
  if (!options.limits.empty()) {
    SIXPOINT_ASSIGN(lanes.session.limits, station::read_limits(context.env.files, options.limits));
  }
  if (!is_loopback(options.bind) && options.token.size() < 8) {
    return fail(ErrorCode::usage,
                fmt::format("on {} others can reach this station: it needs a --token of at least "
                            "8 characters",
                            printable(options.bind, 60)),
                {}, "choose one, or leave --bind out");
  }
  if (options.token.find_first_not_of(
          "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
          "-_.~") != std::string::npos) {
    return fail(ErrorCode::usage, "a token is letters, digits and -_.~", "--token",
                "for example the output of 'openssl rand -hex 16'");
  }
  return lanes;
}

Status serve(Context& context, const Options& options) {
  SIXPOINT_ASSIGN(auto lanes_asked, lanes_options(context, options));
  // What nobody can store is said before anything is measured.
  if (const auto store = open_store(context, options.store);
      !store && store.error().code == ErrorCode::usage) {
    return fail(store.error());
  }
  // Signals are taken by this thread alone; every thread that is made from here on inherits that.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  // A burst of pages must not take the descriptors that samples and store need.
  rlimit descriptors{};
  if (getrlimit(RLIMIT_NOFILE, &descriptors) == 0) {
    descriptors.rlim_cur = std::min<rlim_t>(descriptors.rlim_max, 8192);
    setrlimit(RLIMIT_NOFILE, &descriptors);
  }

  mocks::VirtualBench bench;
  device::TransportRegistry devices = station::known_devices();
  bench.register_in(devices);
  // The command's own streams and exit code belong to one thread at a time.
  std::mutex context_mutex;
  const station::JigSessionOptions session = lanes_asked.session;
  const station::StoreOpener store_opener = [&] {
    const std::lock_guard lock(context_mutex);
    return open_store(context, options.store);
  };
  station::StationDesk desk(context.env, store_opener, options.station, session.limits);
  lanes_asked.may_start = [&](const std::string& serial) -> Result<station::RetestState> {
    const std::lock_guard lock(context_mutex);
    auto store = open_store(context, options.store);
    // A store that is away is no reason not to measure (keep_records() has a journal).
    return store ? station::may_start(*store, serial, options.station, session.limits)
                 : Result<station::RetestState>(station::RetestState{});
  };
  const station::CaptureKeeper capture_keeper = [&](const station::CaptureReport& report) {
    const std::lock_guard lock(context_mutex);
    return keep_capture(context, options, report);
  };
  SIXPOINT_ASSIGN(const auto lanes,
                  station::Lanes::open(
                      context.env, devices, std::move(lanes_asked),
                      [&](const station::JigReport& report, const station::RunLabels& labels) {
                        auto kept = [&] {
                          const std::lock_guard lock(context_mutex);
                          return keep_run(context, options, session, report, labels);
                        }();
                        desk.look_soon();  // it may have been a check unit
                        return kept;
                      },
                      capture_keeper));
  station::RepairJob repairs(context.env, store_opener);
  station::ApiOptions api_options;
  api_options.station = options.station;
  api_options.version = station::software_name();
  api_options.bind = options.bind;
  api_options.token = options.token;
  api_options.files_folder = options.files;
  station::Api api(api_options, {context.env, *lanes, repairs, &bench, capture_keeper,
                                 [&](const std::string& run, const std::string& kind) {
                                   const std::lock_guard lock(context_mutex);
                                   return document_of(context, options, run, kind);
                                 },
                                 &desk});
  station::ServerOptions server_options;
  server_options.bind = options.bind;
  server_options.port = options.port;
  SIXPOINT_ASSIGN(const auto server, station::Server::open(context.env, api, server_options));
  context.out << fmt::format("http://{}:{}/{}\n", options.bind, server->port(),
                             options.token.empty() ? "" : "?token=" + options.token)
              << std::flush;
  context.people << fmt::format(
                        "{} lane{}; Ctrl-C ends the station, runs go on at the next start\n",
                        lanes->size(), lanes->size() == 1 ? "" : "s")
                 << std::flush;
  std::jthread waiter([&](const std::stop_token& stop) {
    const timespec patience{0, 200'000'000};
    while (!stop.stop_requested() && sigtimedwait(&signals, nullptr, &patience) < 0) {
    }
    server->stop();
  });
  server->serve();
  return {};
}

}  // namespace

void add_station(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("station", "serve the technician's page");
  command->add_option("--port", options->port, "0: any that is free; the address is printed")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command
      ->add_option("--device", options->devices,
                   "a lane's unit (docs/virtual.md); repeatable, to 16")
      ->required();
  add_store_option(*command, options->store);
  command->add_option("--bind", options->bind, "address to listen on; another one needs --token")
      ->capture_default_str();
  command->add_option("--token", options->token, "what a page must know to be let in");
  command->add_option("--station", options->station, "the station's name, for the record");
  command->add_option("--state", options->state,
                      "folder for runs under way (default: in the user's data folder)");
  command
      ->add_option("--files", options->files,
                   "folder below which the page may check and mend files")
      ->capture_default_str();
  command->add_option("--limits", options->limits, "limits of the verdict (TOML)");
  command
      ->add_option("--side-seconds", options->side_s,
                   "how long a unit rests on each side of a calibration file")
      ->check(CLI::Range(10.0, 3600.0))
      ->capture_default_str();
  command->add_option("--gravity", options->gravity_m_per_s2, "local gravity in m/s2");
  command->add_option("--latitude", options->latitude_deg,
                      "... or computed from the latitude in degrees");
  command->add_option("--altitude", options->altitude_m, "... and metres above sea level");
  command->callback([options, &context] {
    if (const Status served = serve(context, *options); !served) {
      report_error(context, "station", served.error(), false);
    }
  });
}

}  // namespace sixpoint::cli

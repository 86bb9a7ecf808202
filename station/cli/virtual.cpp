// sixpoint virtual: virtual units for a desktop, over USB/IP.
#include <csignal>
#include <memory>
#include <set>
#include <thread>

#include <fmt/format.h>
#include <pthread.h>
#include <unistd.h>

#include "base/memory_env.h"
#include "mocks/scaled_clock.h"
#include "mocks/usb_drive.h"
#include "mocks/usb_jig.h"
#include "mocks/usb_unit.h"
#include "mocks/usbip_server.h"
#include "mocks/virtual_drive.h"
#include "mocks/virtual_settings.h"
#include "sim/bundle_writer.h"
#include "sim/recording.h"
#include "station/cli/command.h"

namespace sixpoint::cli {

namespace {

constexpr int kMostUnits = 64;

struct Options {
  int port = 3240;
  int count = 1;
  std::string scenario;
  std::uint64_t seed = 0;
  bool has_seed = false;
  std::string device;
  bool jig = false;
  std::string faults;
  bool json = false;
};

struct Bench {
  struct Entry {
    std::string kind;
    std::string serial;
    std::string firmware;  // of units
  };
  std::vector<std::shared_ptr<mocks::UsbDevice>> devices;
  std::vector<Entry> entries;  // as devices
};

// The unit of a scenario, with what it recorded in its memory.
Status apply_scenario(Context& context, const std::string& path, mocks::VirtualSettings& settings,
                      Bytes& recording, UtcTime& start) {
  SIXPOINT_ASSIGN(const Bytes text, read_file(context.env.files, path));
  SIXPOINT_ASSIGN(const sim::Scenario scenario,
                  sim::parse_scenario({reinterpret_cast<const char*>(text.data()), text.size()}));
  settings.unit.truth = scenario.unit;
  settings.unit.seed = scenario.seed;
  settings.unit.temperature_c = scenario.temperature_c;
  settings.unit.gravity_g = scenario.gravity_g;
  double bytes = 0;
  if (scenario.protocol) {
    constexpr double kBytesPerSample = 6;
    for (const sim::ProtocolSegment& segment : scenario.protocol->segments) {
      bytes += kBytesPerSample * static_cast<double>(segment.samples);
    }
  }
  for (const sim::MotionSpec& motion : scenario.motions) {
    constexpr double kBytesPerSample = 4.5;  // a sample has 36 bits at least
    bytes += kBytesPerSample * motion.duration_s * scenario.rate_hz;
  }
  if (bytes > static_cast<double>(settings.unit.flash_bytes)) {
    return fail(ErrorCode::configuration, "the recording does not fit into the unit's flash", path,
                "make the scenario shorter");
  }
  MemoryFiles disk;
  std::string made = "recording.gt3x";
  if (scenario.protocol) {
    // What the unit stored on its way through the protocol, effects and all.
    SIXPOINT_CHECK(sim::write_bundle(disk, "unit", scenario));
    made = "unit/" + made;
  } else {
    SIXPOINT_CHECK(sim::write_recording(disk, made, scenario));
  }
  SIXPOINT_ASSIGN(recording, read_file(disk, made, settings.unit.flash_bytes));
  start = scenario.start;
  return {};
}

// A unit with mass storage alone: the scenario's recording on its volume, or one in which it lay on
// its six sides.
Result<std::shared_ptr<mocks::UsbDevice>> make_drive(const mocks::VirtualUnitOptions& unit,
                                                     Bytes recording, UtcTime start,
                                                     std::shared_ptr<Clock> clock) {
  if (recording.empty()) {
    mocks::VirtualDriveOptions drive;
    drive.unit = unit;
    SIXPOINT_ASSIGN(recording, mocks::virtual_drive_recording(drive));
  }
  mocks::VirtualUnit holder(unit);
  SIXPOINT_CHECK(holder.keep_recording(std::move(recording), start));
  SIXPOINT_ASSIGN(auto volume, mocks::unit_volume(holder));
  return std::shared_ptr<mocks::UsbDevice>(std::make_shared<mocks::UsbDrive>(
      unit.truth, std::make_shared<const mocks::FatImage>(std::move(volume)), std::move(clock)));
}

Result<Bench> make_bench(Context& context, const Options& options) {
  constexpr std::string_view kScheme = "virtual:";
  std::string_view text = options.device;
  if (text.starts_with(kScheme)) {
    text.remove_prefix(kScheme.size());
  }
  const std::uint64_t seed = options.has_seed ? options.seed : context.env.seed;
  SIXPOINT_ASSIGN(mocks::VirtualSettings first, mocks::parse_virtual_settings(text, seed));
  Bytes recording;
  UtcTime start{};
  if (!options.scenario.empty()) {
    SIXPOINT_CHECK(apply_scenario(context, options.scenario, first, recording, start));
  }

  mocks::FaultPlan plan;
  const std::string& plan_file = options.faults.empty() ? first.faults_file : options.faults;
  if (!plan_file.empty()) {
    SIXPOINT_ASSIGN(plan, mocks::read_fault_plan(context.env.files, plan_file));
  }

  if (first.storage_only && (options.jig || !plan_file.empty())) {
    return fail(ErrorCode::usage, "a unit with mass storage alone has no jig and no fault plan",
                "interfaces=storage", "leave out --jig and --faults");
  }

  Bench bench;
  first.real_time = true;  // for whoever attaches them; only a number makes it pass faster
  const std::shared_ptr<Clock> clock = mocks::clock_of(first, context.env.clock);
  std::shared_ptr<mocks::PluggedUnit> turned;
  std::set<std::string> serials;
  std::uint64_t next_seed = first.unit.seed;
  for (int i = 0; i < options.count; ++i) {
    mocks::VirtualUnitOptions unit = first.unit;
    if (i > 0) {
      // The others are units of their own, by the seeds that follow; no two of one serial number.
      sim::UnitWishes wishes;
      wishes.firmware = first.unit.truth.firmware;
      do {
        unit.seed = ++next_seed;
        unit.truth = sim::draw_unit(unit.seed, wishes);
      } while (!serials.insert(unit.truth.serial).second);
    } else {
      serials.insert(unit.truth.serial);
    }
    if (i == 0 && first.storage_only) {
      bench.entries.push_back({"drive", unit.truth.serial, unit.truth.firmware});
      SIXPOINT_ASSIGN(auto drive, make_drive(unit, std::exchange(recording, {}), start, clock));
      bench.devices.push_back(std::move(drive));
      continue;
    }
    bench.entries.push_back({"unit", unit.truth.serial, unit.truth.firmware});
    auto plugged = std::make_shared<mocks::PluggedUnit>(std::move(unit),
                                                        i == 0 ? plan : mocks::FaultPlan{}, clock);
    if (i == 0 && !recording.empty()) {
      SIXPOINT_CHECK(plugged->unit.keep_recording(std::exchange(recording, {}), start));
    }
    if (i == 0) {
      turned = plugged;
    }
    bench.devices.push_back(std::make_shared<mocks::UsbUnit>(std::move(plugged)));
  }
  if (options.jig) {
    const mocks::VirtualHidJigOptions jig;
    bench.devices.push_back(std::make_shared<mocks::UsbJig>(jig, std::move(turned), clock));
    bench.entries.push_back({"jig", jig.serial, {}});
  }
  return bench;
}

void tell(Context& context, const Options& options, const Bench& bench, std::uint16_t port) {
  if (options.json) {
    Json json = document("virtual");
    json["usbip"] = {{"host", "127.0.0.1"}, {"port", port}};
    json["devices"] = Json::array();
    for (std::size_t i = 0; i < bench.entries.size(); ++i) {
      const Bench::Entry& entry = bench.entries[i];
      const mocks::UsbDescriptors& usb = bench.devices[i]->descriptors();
      Json device = {
          {"busid", fmt::format("1-{}", i + 1)}, {"kind", entry.kind}, {"serial", entry.serial}};
      if (!entry.firmware.empty()) {
        device["firmware"] = entry.firmware;
      }
      device["vendor_id"] = fmt::format("{:04x}", usb.vendor_id());
      device["product_id"] = fmt::format("{:04x}", usb.product_id());
      json["devices"].push_back(std::move(device));
    }
    print_json(context, json);
  } else {
    for (std::size_t i = 0; i < bench.entries.size(); ++i) {
      const Bench::Entry& entry = bench.entries[i];
      context.out << fmt::format("1-{}  {} {}{}{}\n", i + 1, entry.kind, entry.serial,
                                 entry.firmware.empty() ? "" : "  firmware ", entry.firmware);
    }
    context.out << fmt::format("listening on 127.0.0.1:{}\n", port);
  }
  context.out << std::flush;
  const std::string tcp_port = port == 3240 ? "" : fmt::format("--tcp-port {} ", port);
  context.people << fmt::format(
      "Attach as root:  modprobe vhci-hcd && usbip {}attach -r 127.0.0.1 -b 1-1\n"
      "Stop with Ctrl-C.\n",
      tcp_port);
  context.people << std::flush;
}

Status serve(Context& context, const Options& options) {
  SIXPOINT_ASSIGN(const Bench bench, make_bench(context, options));
  mocks::UsbipServerOptions how;
  how.port = static_cast<std::uint16_t>(options.port);
  SIXPOINT_ASSIGN(const auto server, mocks::UsbipServer::listen(bench.devices, how));

  // The signals wait for sigwait() below, in every thread that is started from here.
  // They stay blocked: a Ctrl-C that comes twice (timeout(1) sends it to the process and to its
  // group) must not end the orderly end.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  Status status;
  std::thread serving([&] {
    status = server->run();
    if (!status) {
      ::kill(::getpid(), SIGTERM);
    }
  });
  tell(context, options, bench, server->port());
  int signal = 0;
  sigwait(&signals, &signal);
  server->stop();
  serving.join();
  return status;
}

}  // namespace

void add_virtual(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("virtual", "offer virtual units, and a jig, over USB/IP until Ctrl-C");
  command
      ->add_option("--usbip", options->port,
                   "TCP port on 127.0.0.1; 0 = any that is free (it is printed)")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_option("--count", options->count, "how many units: bus ids 1-1, 1-2 ...")
      ->check(CLI::Range(1, kMostUnits))
      ->capture_default_str();
  command->add_option("--scenario", options->scenario,
                      "the first unit is this scenario's, with its recording (docs/scenario.md)");
  auto* seed = command->add_option("--seed", options->seed, "what is not given is drawn from it");
  command->add_option("--device", options->device,
                      "settings of the first unit: virtual:... (docs/virtual.md)");
  command->add_flag("--jig", options->jig, "offer a virtual jig that turns the first unit, too");
  command->add_option("--faults", options->faults,
                      "what goes wrong with the first unit, and when (docs/faults.md)");
  command->add_flag("--json", options->json, "what is offered, as JSON");
  command->callback([options, seed, &context] {
    options->has_seed = seed->count() > 0;
    if (const Status status = serve(context, *options); !status) {
      report_error(context, "virtual", status.error(), options->json);
    }
  });
}

}  // namespace sixpoint::cli

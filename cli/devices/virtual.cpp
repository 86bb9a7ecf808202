// sixpoint virtual: virtual units for a desktop, over USB/IP.
#include <memory>
#include <set>
#include <thread>

#include <fmt/format.h>
#include <unistd.h>

#include "base/memory_env.h"
#include "cli/command.h"
#include "cli/stop_request.h"
#include "mocks/firmware/virtual_drive.h"
#include "mocks/firmware/virtual_settings.h"
#include "mocks/in_process/scaled_clock.h"
#include "mocks/usb/usb_drive.h"
#include "mocks/usb/usb_jig.h"
#include "mocks/usb/usb_unit.h"
#include "mocks/usb/usbip_server.h"
#include "sim/bundle_writer.h"
#include "sim/recording.h"

namespace sixpoint::cli {

namespace {

constexpr int kMostUnits = 64;

struct VirtualCommandOptions {
  int port = 3240;
  int count = 1;
  std::string scenario;
  std::optional<std::uint64_t> seed;
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

// What the first unit's memory holds.
struct Memory {
  Bytes recording;  // a .gt3x file, or empty
  UtcTime start{};
};

// The size that the recording will have, roughly.
double recording_bytes(const sim::Scenario& scenario) {
  constexpr double kBytesPerWideSample = 6;
  constexpr double kBytesPerSample = 4.5;  // a sample has 36 bits at least
  double bytes = 0;
  if (scenario.protocol) {
    for (const sim::ProtocolSegment& segment : scenario.protocol->segments) {
      bytes += kBytesPerWideSample * static_cast<double>(segment.samples);
    }
  }
  for (const sim::MotionSpec& motion : scenario.motions) {
    bytes += kBytesPerSample * motion.duration_s * scenario.rate_hz;
  }
  return bytes;
}

// Sets the unit of a scenario up, and makes the recording that it would hold.
Result<Memory> apply_scenario(Context& context, const std::string& path,
                              mocks::VirtualSettings& settings) {
  SIXPOINT_ASSIGN(const Bytes text, read_file(context.env.files, path));
  SIXPOINT_ASSIGN(const sim::Scenario scenario, sim::parse_scenario(as_text(text)));
  settings.unit.truth = scenario.unit;
  settings.unit.seed = scenario.seed;
  settings.unit.temperature_c = scenario.temperature_c;
  settings.unit.gravity_g = scenario.gravity_g;
  if (recording_bytes(scenario) > static_cast<double>(settings.unit.flash_bytes)) {
    return fail(ErrorCode::configuration, "the recording does not fit into the unit's flash", path,
                "make the scenario shorter");
  }
  MemoryFiles disk;
  std::string made = "recording.gt3x";
  if (scenario.protocol) {
    SIXPOINT_CHECK(sim::write_bundle(disk, "unit", scenario));
    made = "unit/" + made;
  } else {
    SIXPOINT_CHECK(sim::write_recording(disk, made, scenario));
  }
  SIXPOINT_ASSIGN(Bytes recording, read_file(disk, made, settings.unit.flash_bytes));
  return Memory{std::move(recording), scenario.start};
}

// A unit with mass storage alone. Without a recording its volume holds one of its six sides.
Result<std::shared_ptr<mocks::UsbDevice>> make_drive(const mocks::VirtualUnitOptions& unit,
                                                     Memory memory, std::shared_ptr<Clock> clock) {
  if (memory.recording.empty()) {
    mocks::VirtualDriveOptions drive;
    drive.unit = unit;
    SIXPOINT_ASSIGN(memory.recording, mocks::virtual_drive_recording(drive));
  }
  mocks::VirtualUnit holder(unit);
  SIXPOINT_CHECK(holder.keep_recording(std::move(memory.recording), memory.start));
  SIXPOINT_ASSIGN(auto volume, mocks::unit_volume(holder));
  return std::shared_ptr<mocks::UsbDevice>(std::make_shared<mocks::UsbDrive>(
      unit.truth, std::make_shared<const mocks::FatImage>(std::move(volume)), std::move(clock)));
}

// The first unit's settings, its memory and what goes wrong with it.
struct FirstUnit {
  mocks::VirtualSettings settings;
  Memory memory;
  mocks::FaultPlan plan;
};

Result<FirstUnit> first_unit(Context& context, const VirtualCommandOptions& options) {
  constexpr std::string_view kScheme = "virtual:";
  std::string_view text = options.device;
  if (text.starts_with(kScheme)) {
    text.remove_prefix(kScheme.size());
  } else if (const std::size_t equals = text.find('=');
             !text.empty() && (equals == text.npos || text.find(':') < equals)) {
    return fail(ErrorCode::usage, "only a virtual unit can be served",
                "--device " + printable(options.device, 80),
                "give virtual:KEY=VALUE,... or nothing; docs/virtual.md lists the settings");
  }
  SIXPOINT_ASSIGN(auto settings,
                  mocks::parse_virtual_settings(text, options.seed.value_or(context.env.seed)));
  FirstUnit first{std::move(settings), {}, {}};
  if (!options.scenario.empty()) {
    SIXPOINT_ASSIGN(first.memory, apply_scenario(context, options.scenario, first.settings));
  }
  const std::string& plan = options.faults.empty() ? first.settings.faults_file : options.faults;
  if (first.settings.storage_only && (options.jig || !plan.empty())) {
    return fail(ErrorCode::usage, "a unit with mass storage alone has no jig and no fault plan",
                "interfaces=storage", "leave out --jig and --faults");
  }
  if (!plan.empty()) {
    SIXPOINT_ASSIGN(first.plan, mocks::read_fault_plan(context.env.files, plan));
  }
  first.settings.real_time = true;  // only a factor in the settings makes time pass faster
  return first;
}

// The units after the first are drawn from the seeds that follow; no two have one serial number.
mocks::VirtualUnitOptions draw_next(const mocks::VirtualUnitOptions& first, std::uint64_t& seed,
                                    std::set<std::string>& serials) {
  mocks::VirtualUnitOptions unit = first;
  sim::GivenProperties given;
  given.firmware = first.truth.firmware;
  do {
    unit.seed = ++seed;
    unit.truth = sim::draw_unit(unit.seed, given);
  } while (!serials.insert(unit.truth.serial).second);
  return unit;
}

Result<Bench> make_bench(Context& context, const VirtualCommandOptions& options) {
  SIXPOINT_ASSIGN(FirstUnit first, first_unit(context, options));
  const mocks::VirtualUnitOptions& unit = first.settings.unit;
  const std::shared_ptr<Clock> clock = mocks::clock_of(first.settings, context.env.clock);
  Bench bench;
  std::shared_ptr<mocks::PluggedUnit> turned;
  if (first.settings.storage_only) {
    bench.entries.push_back({"drive", unit.truth.serial, unit.truth.firmware});
    SIXPOINT_ASSIGN(auto drive, make_drive(unit, std::move(first.memory), clock));
    bench.devices.push_back(std::move(drive));
  } else {
    bench.entries.push_back({"unit", unit.truth.serial, unit.truth.firmware});
    turned = std::make_shared<mocks::PluggedUnit>(unit, first.plan, clock);
    if (!first.memory.recording.empty()) {
      SIXPOINT_CHECK(
          turned->unit.keep_recording(std::move(first.memory.recording), first.memory.start));
    }
    bench.devices.push_back(std::make_shared<mocks::UsbUnit>(turned));
  }
  std::set<std::string> serials = {unit.truth.serial};
  std::uint64_t seed = unit.seed;
  for (int i = 1; i < options.count; ++i) {
    auto next = draw_next(unit, seed, serials);
    bench.entries.push_back({"unit", next.truth.serial, next.truth.firmware});
    bench.devices.push_back(std::make_shared<mocks::UsbUnit>(
        std::make_shared<mocks::PluggedUnit>(std::move(next), mocks::FaultPlan{}, clock)));
  }
  if (options.jig) {
    const mocks::VirtualHidJigOptions jig;
    bench.devices.push_back(std::make_shared<mocks::UsbJig>(jig, std::move(turned), clock));
    bench.entries.push_back({"jig", jig.serial, {}});
  }
  return bench;
}

void print_virtual(Context& context, bool as_json, const Bench& bench, std::uint16_t port) {
  Json json = document("virtual");
  json["usbip"] = {{"host", "127.0.0.1"}, {"port", port}};
  Json& devices = json["devices"] = Json::array();
  std::string text;
  for (std::size_t i = 0; i < bench.entries.size(); ++i) {
    const auto& [kind, serial, firmware] = bench.entries[i];
    const mocks::UsbDescriptors& usb = bench.devices[i]->descriptors();
    Json device = {{"busid", fmt::format("1-{}", i + 1)}, {"kind", kind}, {"serial", serial}};
    if (!firmware.empty()) {
      device["firmware"] = firmware;
    }
    device["vendor_id"] = fmt::format("{:04x}", usb.vendor_id());
    device["product_id"] = fmt::format("{:04x}", usb.product_id());
    devices.push_back(std::move(device));
    text += fmt::format("1-{}  {} {}{}{}\n", i + 1, kind, serial,
                        firmware.empty() ? "" : "  firmware ", firmware);
  }
  text += fmt::format("listening on 127.0.0.1:{}\n", port);
  print_answer(context, as_json, json, text);
  context.out << std::flush;
  context.people << fmt::format(
                        "Attach as root:  modprobe vhci-hcd && usbip {}attach -r 127.0.0.1 -b 1-1\n"
                        "Stop with Ctrl-C.\n",
                        port == 3240 ? "" : fmt::format("--tcp-port {} ", port))
                 << std::flush;
}

Status serve(const VirtualCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const Bench bench, make_bench(context, options));
  mocks::UsbipServerOptions how;
  how.port = static_cast<std::uint16_t>(options.port);
  SIXPOINT_ASSIGN(const auto server, mocks::UsbipServer::listen(bench.devices, how));

  // Every thread from here on inherits the mask, so that sigwait() below gets the signals. They
  // stay blocked: timeout(1) sends a signal twice, and the second one must not cut the shutdown
  // short.
  const sigset_t signals = block_stop_signals();
  Status status;
  std::thread serving([&] {
    status = server->run();
    if (!status) {
      ::kill(::getpid(), SIGTERM);
    }
  });
  print_virtual(context, options.json, bench, server->port());
  int signal = 0;
  sigwait(&signals, &signal);
  server->stop();
  serving.join();
  take_stop(context, signal);
  return status;
}

}  // namespace

void add_virtual(CLI::App& app, Context& context) {
  auto [command, options] = add_command<VirtualCommandOptions>(
      app, context, "virtual", "offer virtual units, and a jig, over USB/IP until Ctrl-C", serve);
  command
      .add_option("--usbip", options.port,
                  "TCP port on 127.0.0.1; 0 = any that is free (it is printed)")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command.add_option("--count", options.count, "how many units: bus ids 1-1, 1-2 ...")
      ->check(CLI::Range(1, kMostUnits))
      ->capture_default_str();
  command.add_option("--scenario", options.scenario,
                     "the first unit is this scenario's, with its recording (docs/scenario.md)");
  command.add_option("--seed", options.seed, "what is not given is drawn from it");
  command.add_option("--device", options.device,
                     "settings of the first unit: virtual:... (docs/virtual.md)");
  command.add_flag("--jig", options.jig, "also offer a virtual jig that turns the first unit");
  command.add_option("--faults", options.faults,
                     "what goes wrong with the first unit, and when (docs/faults.md)");
}

}  // namespace sixpoint::cli

// Units on USB, in numbers:
//   1. sixteen units at 100 Hz, ten minutes of device time, in process on a simulated clock
//   2. sixteen units at 100 Hz over umockdev, in real time, through hidapi
//   3. a download through device::Unit against plain libusb_bulk_transfer of the same bytes
//   4. from plugging in to identified
//   5. closing a unit in mid-stream, threads and all
//   usb_bench [SECONDS]      of part 2; 20 when left out
// 2 to 5 need umockdev, and count the mock's own work, too.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <libusb.h>
#include <sys/resource.h>

#include "base/memory_env.h"
#include "device/unit.h"
#include "device/usb/discovery.h"
#include "device/usb/hotplug.h"
#include "device/wire/payload.h"
#include "device/wire/wire_unit.h"
#include "mocks/umockdev/umockdev_bus.h"
#include "mocks/usb/usb_unit.h"

namespace {

using namespace sixpoint;  // a program, not a header
using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

constexpr int kUnits = 16;
constexpr int kRate_hz = 100;

double cpu_s() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto of = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return of(usage.ru_utime) + of(usage.ru_stime);
}

double since_s(steady_clock::time_point start) {
  return std::chrono::duration<double>(steady_clock::now() - start).count();
}

template <class T>
T need(Result<T> result) {
  if (!result) {
    fmt::print(stderr, "usb_bench: {}\n", result.error().brief());
    std::exit(result.error().code == ErrorCode::configuration ? 77 : 70);
  }
  if constexpr (!std::is_void_v<T>) {
    return std::move(*result);
  }
}

std::shared_ptr<mocks::PluggedUnit> make_unit(std::uint64_t seed, std::shared_ptr<Clock> clock) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(seed);
  options.seed = seed;
  return std::make_shared<mocks::PluggedUnit>(std::move(options), std::move(clock));
}

struct Streamed {
  std::uint64_t samples = 0;
  std::uint64_t lost = 0;
  std::uint64_t damaged = 0;
};

Streamed stream(device::Unit& unit, std::uint64_t samples) {
  need(unit.start_stream(kRate_hz));
  Streamed total;
  while (total.samples < samples) {
    const auto block = need(unit.next_samples(seconds(2)));
    if (!block) {
      break;
    }
    total.samples += block->counts.size();
  }
  total.lost = unit.stream_statistics().lost_samples;
  total.damaged = unit.stream_statistics().damaged_reports;
  need(unit.stop_stream());
  return total;
}

// Every unit its thread, as the station runs them.
template <class Open>
Streamed stream_all(std::uint64_t samples, const Open& open) {
  std::vector<Streamed> results(kUnits);
  std::vector<std::thread> threads;
  for (int i = 0; i < kUnits; ++i) {
    threads.emplace_back([&, i] {
      const auto unit = need(device::WireUnit::open(open(i)));
      results[static_cast<std::size_t>(i)] = stream(*unit, samples);
    });
  }
  Streamed total;
  for (int i = 0; i < kUnits; ++i) {
    threads[static_cast<std::size_t>(i)].join();
    const Streamed& one = results[static_cast<std::size_t>(i)];
    total.samples += one.samples;
    total.lost += one.lost;
    total.damaged += one.damaged;
  }
  return total;
}

void report_stream(const char* name, const Streamed& total, double device_s, double cpu) {
  fmt::print("{}: {} samples of {}, {} lost, {} reports damaged; {:.3f} cores (bound 1)\n", name,
             total.samples, static_cast<std::uint64_t>(kUnits * kRate_hz * device_s), total.lost,
             total.damaged, cpu / device_s);
}

void in_process() {
  constexpr double kDevice_s = 600;
  const double before = cpu_s();
  const Streamed total = stream_all(static_cast<std::uint64_t>(kDevice_s * kRate_hz), [](int i) {
    const auto clock = std::make_shared<ManualClock>();
    return mocks::link_to(make_unit(static_cast<std::uint64_t>(i) + 1, clock), false);
  });
  report_stream("in process, 16 units, 10 min of device time", total, kDevice_s, cpu_s() - before);
}

void over_umockdev(mocks::UmockdevBus& bus, double real_s) {
  const auto clock = device::borrow_clock(posix_env().clock);
  std::vector<device::AttachedDevice> attached;
  for (int i = 0; i < kUnits; ++i) {
    need(bus.plug_in(
        std::make_shared<mocks::UsbUnit>(make_unit(static_cast<std::uint64_t>(i) + 1, clock))));
  }
  attached = need(device::attached_devices());
  const double before = cpu_s();
  const Streamed total = stream_all(static_cast<std::uint64_t>(real_s * kRate_hz), [&](int i) {
    return need(device::open_monitor(attached[static_cast<std::size_t>(i)], posix_env()));
  });
  report_stream(fmt::format("umockdev, 16 units, {} s of real time, mock included", real_s).c_str(),
                total, real_s, cpu_s() - before);
  for (const auto& one : attached) {
    bus.unplug(one.port);
  }
}

// Fast-forwards while a recording is made.
class Leaping final : public Clock {
 public:
  UtcTime now() override { return posix_env().clock.now(); }
  std::chrono::nanoseconds elapsed() override { return posix_env().clock.elapsed() + leap; }
  void sleep(std::chrono::nanoseconds duration) override { posix_env().clock.sleep(duration); }
  std::chrono::nanoseconds leap{0};
};

// What libusb's own synchronous call reaches: DOWNLOAD is asked for, the blocks are read, no more.
double plain_mb_per_s(const device::AttachedDevice& attached, const device::RecordingInfo& info) {
  device::Link link = need(device::open_monitor(attached, posix_env()));
  link.bulk.reset();
  libusb_context* context = nullptr;
  libusb_init(&context);
  libusb_device** list = nullptr;
  const auto count = libusb_get_device_list(context, &list);
  libusb_device_handle* handle = nullptr;
  for (ssize_t i = 0; i < count; ++i) {
    if (libusb_get_device_address(list[i]) == attached.address) {
      libusb_open(list[i], &handle);
    }
  }
  libusb_free_device_list(list, 1);
  libusb_claim_interface(handle, device::kBulkInterface);
  need(link.reports->write(device::encode({device::ReportKind::request, 0,
                                           device::Command::download, device::ReplyCode::ok,
                                           device::PayloadWriter()
                                               .put(info.id)
                                               .put(std::uint64_t{0})
                                               .put(static_cast<std::uint32_t>(info.bytes))
                                               .take()}),
                           seconds(2)));
  Bytes buffer((device::kBulkBlockBytes + 511) / 512 * 512);
  std::uint64_t bytes = 0;
  const auto start = steady_clock::now();
  while (bytes < info.bytes) {
    int came = 0;
    if (libusb_bulk_transfer(handle, device::kBulkInEndpoint, buffer.data(),
                             static_cast<int>(buffer.size()), &came, 2000) != 0 ||
        came <= static_cast<int>(device::kBulkHeaderBytes)) {
      fmt::print(stderr, "usb_bench: the plain transfer failed at byte {}\n", bytes);
      std::exit(70);
    }
    bytes += static_cast<std::uint64_t>(came) - device::kBulkHeaderBytes - 4;
  }
  const double took_s = since_s(start);
  libusb_release_interface(handle, device::kBulkInterface);
  libusb_close(handle);
  libusb_exit(context);
  return static_cast<double>(bytes) * 1e-6 / took_s;
}

double unit_mb_per_s(const device::AttachedDevice& attached, const device::RecordingInfo& info) {
  const auto unit = need(device::WireUnit::open(need(device::open_monitor(attached, posix_env()))));
  MemoryEnv env;
  const auto start = steady_clock::now();
  need(unit->download(info, env.files, "x.gt3x"));
  return static_cast<double>(info.bytes) * 1e-6 / since_s(start);
}

void download(mocks::UmockdevBus& bus) {
  const auto clock = std::make_shared<Leaping>();
  const auto nodes = need(bus.plug_in(std::make_shared<mocks::UsbUnit>(make_unit(99, clock))));
  const auto attached = need(device::attached_devices()).front();
  device::RecordingInfo info;
  {
    device::WireOptions options;
    options.reply_time_out = seconds(60);  // packing takes the virtual unit a while
    const auto unit =
        need(device::WireUnit::open(need(device::open_monitor(attached, posix_env())), options));
    need(unit->start_recording(kRate_hz, from_unix_seconds(1'500'000'000)));
    clock->leap += std::chrono::hours(8);
    need(unit->stop_recording());
    info = need(unit->recordings()).front();
  }
  std::vector<double> ratios;
  for (int i = 0; i < 7; ++i) {
    const double plain = plain_mb_per_s(attached, info);
    const double ours = unit_mb_per_s(attached, info);
    ratios.push_back(ours / plain);
    fmt::print("  {:.1f} MB: libusb_bulk_transfer {:.1f} MB/s, Unit::download {:.1f} MB/s\n",
               static_cast<double>(info.bytes) * 1e-6, plain, ours);
  }
  std::sort(ratios.begin(), ratios.end());
  fmt::print("download against plain libusb_bulk_transfer: median ratio {:.2f} (bound 0.9)\n",
             ratios[ratios.size() / 2]);
  bus.unplug(nodes.port);
}

void plug_to_identified(mocks::UmockdevBus& bus) {
  const auto clock = device::borrow_clock(posix_env().clock);
  const auto watch = need(device::HotplugWatch::start());
  std::vector<double> times_s;
  for (int i = 0; i < 20; ++i) {
    const auto device =
        std::make_shared<mocks::UsbUnit>(make_unit(static_cast<std::uint64_t>(200 + i), clock));
    const auto start = steady_clock::now();
    const auto nodes = need(bus.plug_in(device));
    for (bool identified = false; !identified;) {
      const auto event = need(watch->next(seconds(10)));
      if (event && event->kind == device::HotplugEvent::Kind::arrived) {
        need(device::WireUnit::open(need(device::open_monitor(event->device, posix_env()))));
        identified = true;
      }
    }
    times_s.push_back(since_s(start));
    bus.unplug(nodes.port);
  }
  std::sort(times_s.begin(), times_s.end());
  fmt::print("plug to identified, 20 times: median {:.3f} s, worst {:.3f} s (bound 1)\n",
             times_s[times_s.size() / 2], times_s.back());
}

void closing(mocks::UmockdevBus& bus) {
  const auto clock = device::borrow_clock(posix_env().clock);
  const auto nodes = need(bus.plug_in(std::make_shared<mocks::UsbUnit>(make_unit(98, clock))));
  const auto attached = need(device::attached_devices()).front();
  std::vector<double> times_s;
  for (int i = 0; i < 20; ++i) {
    device::Link link = need(device::open_monitor(attached, posix_env()));
    Bytes buffer(device::kBulkBlockBytes);
    need(link.bulk->read(buffer, milliseconds(1)));  // its thread runs, its transfers wait
    auto unit = need(device::WireUnit::open(std::move(link)));
    need(unit->start_stream(kRate_hz));
    need(unit->next_samples(seconds(2)));
    const auto start = steady_clock::now();
    unit.reset();
    times_s.push_back(since_s(start));
  }
  std::sort(times_s.begin(), times_s.end());
  fmt::print("closing in mid-stream, 20 times: median {:.0f} ms, worst {:.0f} ms (bound 100)\n",
             times_s[times_s.size() / 2] * 1e3, times_s.back() * 1e3);
  bus.unplug(nodes.port);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string missing = mocks::UmockdevBus::enter(argv);
  in_process();
  if (!missing.empty()) {
    fmt::print(stderr, "SKIPPED: {}\n", missing);
    return 77;
  }
  const auto bus = need(mocks::UmockdevBus::make());
  plug_to_identified(*bus);
  closing(*bus);
  download(*bus);
  over_umockdev(*bus, argc > 1 ? std::max(1.0, std::atof(argv[1])) : 20);
  return 0;
}

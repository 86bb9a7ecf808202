#include "usb/bodies.h"

#include <future>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <hidapi.h>
#include <libusb.h>
#include <unistd.h>

#include "device/unit.h"
#include "device/usb/discovery.h"
#include "device/usb/hotplug.h"
#include "device/wire/payload.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "skip_unless.h"
#include "temporary_folder.h"
#include "usb/plugged.h"

namespace sixpoint::tests {
namespace {

using device::AttachedDevice;
using device::DiscoveryFilter;
using device::HotplugEvent;
using device::HotplugWatch;
using device::Unit;
using std::chrono::milliseconds;
using std::chrono::seconds;

// The devices as soon as `count` of them are complete.
std::vector<AttachedDevice> wait_for(std::size_t count, const DiscoveryFilter& filter = {}) {
  std::vector<AttachedDevice> found;
  for (int attempt = 0; attempt < 500; ++attempt) {
    found = device::attached_devices(filter).value_or(std::vector<AttachedDevice>{});
    if (found.size() == count &&
        std::all_of(found.begin(), found.end(), [](const auto& one) { return one.complete(); })) {
      break;
    }
    std::this_thread::sleep_for(milliseconds(10));
  }
  return found;
}

// The next event of this kind about this unit, within ten seconds.
std::optional<AttachedDevice> event_of(HotplugWatch& watch, HotplugEvent::Kind kind,
                                       const std::string& serial) {
  for (int i = 0; i < 20; ++i) {
    const auto event = watch.next(milliseconds(500));
    if (!event) {
      ADD_FAILURE() << event.error().brief();
      return std::nullopt;
    }
    if (*event && (*event)->kind == kind && (*event)->device.serial == serial) {
      return (*event)->device;
    }
  }
  ADD_FAILURE() << serial << ": no such event in time";
  return std::nullopt;
}

void enumerates_by_id_and_serial(UsbBench& bench) {
  EXPECT_TRUE(wait_for(0).empty());
  Plugged a(bench, make_unit(11));
  Plugged b(bench, make_unit(12));
  ASSERT_OK(a.status());
  ASSERT_OK(b.status());
  const auto all = wait_for(2);
  ASSERT_EQ(all.size(), 2U);
  std::set<std::string> serials;
  for (const AttachedDevice& found : all) {
    EXPECT_EQ(found.vendor_id, device::kUsbVendorId);
    EXPECT_EQ(found.product_id, device::kMonitorProductId);
    EXPECT_EQ(found.model, "wgt3x-bt-bench-unit");
    serials.insert(found.serial);
  }
  EXPECT_EQ(serials, (std::set<std::string>{a->serial, b->serial}));
  EXPECT_NE(all[0].hidraw_node, all[1].hidraw_node);
  EXPECT_NE(all[0].usb_node, all[1].usb_node);

  DiscoveryFilter filter;
  filter.serial = b->serial;
  const auto one = *device::attached_devices(filter);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].port, b->port);
  filter.serial = "NOSUCHUNIT";
  EXPECT_TRUE(device::attached_devices(filter)->empty());
  filter = {};
  filter.product_ids = {device::kJigProductId};
  EXPECT_TRUE(device::attached_devices(filter)->empty());
  filter = {};
  filter.vendor_id = 0x1d6b;  // hubs
  const auto hubs = *device::attached_devices(filter);
  for (const AttachedDevice& other : hubs) {
    EXPECT_EQ(serials.count(other.serial), 0U);
  }

  // Oracles: hidapi's and libusb's own enumeration.
  std::set<std::string> nodes;
  hid_device_info* list = hid_enumerate(device::kUsbVendorId, device::kMonitorProductId);
  for (const hid_device_info* info = list; info != nullptr; info = info->next) {
    const std::wstring wide = info->serial_number == nullptr ? L"" : info->serial_number;
    EXPECT_EQ(serials.count(std::string(wide.begin(), wide.end())), 1U);
    EXPECT_EQ(info->interface_number, device::kHidInterface);
    nodes.insert(info->path);
  }
  hid_free_enumeration(list);
  EXPECT_EQ(nodes, (std::set<std::string>{all[0].hidraw_node, all[1].hidraw_node}));

  libusb_context* context = nullptr;
  ASSERT_EQ(libusb_init(&context), 0);
  libusb_device** devices = nullptr;
  const auto count = libusb_get_device_list(context, &devices);
  std::set<std::pair<int, int>> places;
  for (int i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor{};
    ASSERT_EQ(libusb_get_device_descriptor(devices[i], &descriptor), 0);
    if (descriptor.idVendor == device::kUsbVendorId) {
      places.emplace(libusb_get_bus_number(devices[i]), libusb_get_device_address(devices[i]));
      libusb_config_descriptor* configuration = nullptr;
      ASSERT_EQ(libusb_get_active_config_descriptor(devices[i], &configuration), 0);
      EXPECT_EQ(configuration->bNumInterfaces, 3);
      libusb_free_config_descriptor(configuration);
    }
  }
  libusb_free_device_list(devices, 1);
  libusb_exit(context);
  EXPECT_EQ(places, (std::set<std::pair<int, int>>{{all[0].bus, all[0].address},
                                                   {all[1].bus, all[1].address}}));
}

void opens_by_serial(UsbBench& bench) {
  EXPECT_FAILS(registry().open("hid:", posix_env()), ErrorCode::device_unavailable);
  Plugged a(bench, make_unit(21));
  ASSERT_OK(a.status());
  {
    auto unit = open("hid:");
    ASSERT_OK(unit);
    EXPECT_EQ((*unit)->identity().serial, a->serial) << "the only one there is";
  }
  Plugged b(bench, make_unit(22));
  ASSERT_OK(b.status());
  ASSERT_EQ(wait_for(2).size(), 2U);
  const auto several = registry().open("usb:", posix_env());
  EXPECT_FAILS(several, ErrorCode::usage);
  EXPECT_NE(several.error().hint.find(b->serial), std::string::npos) << several.error().hint;
  const auto none = registry().open("hid:NOSUCHUNIT", posix_env());
  EXPECT_FAILS(none, ErrorCode::device_unavailable);
  EXPECT_NE(none.error().hint.find(a->serial), std::string::npos) << none.error().hint;
  auto first = open(a->hid_address());
  auto second = open(b->usb_address());
  ASSERT_OK(first);
  ASSERT_OK(second);
  EXPECT_EQ((*first)->identity().serial, a->serial);
  EXPECT_EQ((*second)->identity().serial, b->serial);
  EXPECT_EQ((*first)->identity().firmware, "1.5.0");
}

void writes_constants_as_a_transaction(UsbBench& bench) {
  Plugged plugged(bench, make_unit(31));
  ASSERT_OK(plugged.status());
  device::WireOptions options;
  options.reply_time_out = milliseconds(100);
  options.commit_time_out = milliseconds(100);
  auto opened = open(plugged->hid_address(), options);
  ASSERT_OK(opened);
  Unit& unit = **opened;
  const auto before = unit.read_calibration();
  ASSERT_OK(before);
  {
    const std::lock_guard lock(plugged->unit->mutex);
    EXPECT_EQ(before->constants, plugged->unit->unit.truth().constants);
  }
  const device::CalibrationPage page{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                                     from_unix_seconds(1'600'000'000)};
  // The power fails in the middle of the commit, and comes back: the old page.
  {
    const std::lock_guard lock(plugged->unit->mutex);
    plugged->unit->unit.memory().cut_power_after(200);
  }
  EXPECT_FALSE(unit.write_calibration(page));
  {
    const std::lock_guard lock(plugged->unit->mutex);
    plugged->unit->unit.restore_power(plugged->clock->elapsed());
  }
  const auto after = unit.read_calibration();
  ASSERT_OK(after);
  EXPECT_EQ(*after, *before) << "neither half of the new page is in force";
  ASSERT_OK(unit.write_calibration(page));
  EXPECT_EQ(*unit.read_calibration(), page);
}

void streams_and_sees_loss(UsbBench& bench) {
  Plugged plugged(bench, make_unit(41));
  ASSERT_OK(plugged.status());
  auto opened = open(plugged->hid_address());
  ASSERT_OK(opened);
  Unit& unit = **opened;
  ASSERT_OK(unit.set_filter(device::FilterConfiguration::current));
  ASSERT_OK(unit.start_stream(100));
  std::uint32_t expected = 0;
  double sum = 0;
  while (expected < 150) {
    const auto block = unit.next_samples(seconds(2));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value());
    EXPECT_EQ((*block)->first_index, expected);
    expected += static_cast<std::uint32_t>((*block)->counts.size());
    for (const auto& counts : (*block)->counts) {
      sum += counts[2];
    }
  }
  // Oracle: closed form, z up. 2 LSB = 4 standard errors of 5.5 mg and the seating.
  {
    const std::lock_guard lock(plugged->unit->mutex);
    const auto& sensor = plugged->unit->unit.truth().current;
    EXPECT_NEAR(sum / expected, sensor.zero_lsb[2] + sensor.sensitivity_lsb_per_g[2], 2);
  }
  EXPECT_EQ(unit.stream_statistics().lost_samples, 0U);
  EXPECT_EQ(unit.stream_statistics().damaged_reports, 0U);

  // A report that never reaches the cable: the test takes it from the unit before the host does.
  bool taken = false;
  for (int i = 0; i < 2000 && !taken; ++i) {
    {
      const std::lock_guard lock(plugged->unit->mutex);
      taken =
          plugged->unit->unit.next_report(plugged->clock->elapsed() + milliseconds(20)).has_value();
    }
    std::this_thread::sleep_for(milliseconds(1));
  }
  ASSERT_TRUE(taken);
  for (int i = 0; i < 20 && unit.stream_statistics().lost_samples == 0; ++i) {
    ASSERT_OK(unit.next_samples(seconds(2)));
  }
  EXPECT_EQ(unit.stream_statistics().lost_samples, device::kSamplesPerReport);
  EXPECT_OK(unit.stop_stream());
}

void several_units_stream_at_once(UsbBench& bench) {
  constexpr std::size_t kUnits = 4;
  std::vector<std::unique_ptr<Plugged>> plugged;
  for (std::size_t i = 0; i < kUnits; ++i) {
    plugged.push_back(std::make_unique<Plugged>(bench, make_unit(51 + i)));
    ASSERT_OK(plugged.back()->status());
  }
  ASSERT_EQ(wait_for(kUnits).size(), kUnits);
  std::vector<std::future<std::string>> runs;
  for (auto& one : plugged) {
    runs.push_back(std::async(
        std::launch::async,
        [address = (**one).hid_address(), serial = (**one).serial]() -> std::string {
          auto unit = open(address);
          if (!unit) {
            return unit.error().brief();
          }
          if ((*unit)->identity().serial != serial) {
            return "another unit answered: " + (*unit)->identity().serial;
          }
          if (const auto status = (*unit)->start_stream(100); !status) {
            return status.error().brief();
          }
          std::uint64_t samples = 0;
          while (samples < 120) {
            const auto block = (*unit)->next_samples(seconds(2));
            if (!block) {
              return block.error().brief();
            }
            if (!*block) {
              return "silence";
            }
            samples += (*block)->counts.size();
          }
          return (*unit)->stream_statistics().lost_samples == 0 ? "" : "samples were lost";
        }));
  }
  for (auto& run : runs) {
    EXPECT_EQ(run.get(), "");
  }
}

device::WireOptions patient() {
  device::WireOptions options;
  options.reply_time_out = seconds(5);  // packing an hour takes the virtual unit a moment
  return options;
}

void downloads_and_resumes(UsbBench& bench) {
  Plugged plugged(bench, make_unit(61));
  ASSERT_OK(plugged.status());
  TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  auto unit = open(plugged->usb_address(), patient());
  ASSERT_OK(unit);
  const auto info = record(*plugged, **unit, seconds(1200));
  ASSERT_OK(info);
  ASSERT_GT(info->bytes, 400'000U) << "several blocks";
  ASSERT_OK((*unit)->download(*info, files, folder / "whole.gt3x"));
  EXPECT_EQ(sha256(*read_file(files, folder / "whole.gt3x")), info->sha256);

  // The cable is pulled in the middle.
  bool pulled = false;
  const auto pull = [&](std::uint64_t at) {
    if (!pulled && at > info->bytes / 2) {
      pulled = true;
      bench.unplug(*plugged);
    }
  };
  EXPECT_FAILS((*unit)->download(*info, files, folder / "broken.gt3x", pull),
               ErrorCode::device_unavailable);
  unit->reset();
  EXPECT_FALSE(files.info(folder / "broken.gt3x"));
  ASSERT_OK(bench.plug_in(*plugged));
  unit = open(plugged->usb_address());
  ASSERT_OK(unit);
  std::uint64_t first = 0;
  ASSERT_OK((*unit)->download(*info, files, folder / "broken.gt3x",
                              [&](std::uint64_t at) { first = first == 0 ? at : first; }));
  EXPECT_GT(first, info->bytes / 2) << "went on where it broke";
  EXPECT_EQ(sha256(*read_file(files, folder / "broken.gt3x")), info->sha256);
}

void hotplug_arrives_leaves_and_replugs(UsbBench& bench) {
  auto watch = HotplugWatch::start();
  ASSERT_OK(watch);
  const auto nothing = (*watch)->next(milliseconds(30));
  ASSERT_OK(nothing);
  EXPECT_FALSE(nothing->has_value());

  Plugged plugged(bench, make_unit(71));
  ASSERT_OK(plugged.status());
  const auto arrived = event_of(**watch, HotplugEvent::Kind::arrived, plugged->serial);
  ASSERT_TRUE(arrived);
  EXPECT_EQ(arrived->port, plugged->port);
  EXPECT_TRUE(arrived->complete());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);

  bench.unplug(*plugged);
  const auto left = event_of(**watch, HotplugEvent::Kind::left, plugged->serial);
  ASSERT_TRUE(left);
  EXPECT_EQ(left->usb_node, arrived->usb_node);
  EXPECT_FAILS((*unit)->identify(), ErrorCode::device_unavailable);

  // Back under another node, while the old handle is still open: the new one works.
  ASSERT_OK(bench.plug_in(*plugged));
  const auto back = event_of(**watch, HotplugEvent::Kind::arrived, plugged->serial);
  ASSERT_TRUE(back);
  EXPECT_NE(back->usb_node, arrived->usb_node);
  auto again = open(plugged->hid_address());
  ASSERT_OK(again);
  EXPECT_EQ((*again)->identity().serial, plugged->serial);
  EXPECT_FAILS((*unit)->identify(), ErrorCode::device_unavailable);

  // A watch that starts later reports the devices that are there; a cancelled one waits no more.
  auto late = HotplugWatch::start();
  ASSERT_OK(late);
  EXPECT_TRUE(event_of(**late, HotplugEvent::Kind::arrived, plugged->serial));
  auto waiting = std::async(std::launch::async, [&] { return (*late)->next(seconds(3600)); });
  (*late)->cancel();
  const auto cancelled = waiting.get();
  ASSERT_OK(cancelled);
  EXPECT_FALSE(cancelled->has_value());
}

void unplugging_in_flight_is_seen(UsbBench& bench) {
  // While it waits for samples that do not come, and for a reply.
  for (const bool streaming : {false, true}) {
    Plugged plugged(bench, make_unit(81));
    ASSERT_OK(plugged.status());
    auto unit = open(plugged->hid_address());
    ASSERT_OK(unit);
    if (streaming) {
      ASSERT_OK((*unit)->start_stream(30));
    }
    auto reading = std::async(std::launch::async, [&] {
      for (;;) {
        const auto block = (*unit)->next_samples(seconds(3600));
        if (!block) {
          return block.error().code;
        }
      }
    });
    std::this_thread::sleep_for(milliseconds(100));
    bench.unplug(*plugged);
    EXPECT_EQ(reading.get(), ErrorCode::device_unavailable);
    EXPECT_FAILS((*unit)->filter(), ErrorCode::device_unavailable);
  }
}

void cancel_ends_what_waits(UsbBench& bench) {
  Plugged plugged(bench, make_unit(91));
  ASSERT_OK(plugged.status());
  ASSERT_EQ(wait_for(1).size(), 1U);
  auto link = registry().open(plugged->usb_address(), posix_env());
  ASSERT_OK(link);
  for (device::Transport* transport : {link->reports.get(), link->bulk.get()}) {
    auto reading = std::async(std::launch::async, [&] {
      Bytes buffer(device::kBulkBlockBytes);
      return transport->read(buffer, seconds(3600));
    });
    std::this_thread::sleep_for(milliseconds(50));
    transport->cancel();
    EXPECT_FAILS(reading.get(), ErrorCode::device_unavailable);
    EXPECT_FAILS(transport->write(Bytes(64), seconds(1)), ErrorCode::device_unavailable);
  }
  // After it the unit can be opened again.
  *link = {};
  EXPECT_OK(open(plugged->hid_address()));
}

void a_second_program_is_told_who_is_in_the_way(UsbBench& bench) {
  Plugged plugged(bench, make_unit(101));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  const auto second = registry().open(plugged->usb_address(), posix_env());
  EXPECT_FAILS(second, ErrorCode::device_unavailable);
  EXPECT_NE(second.error().what.find("another program"), std::string::npos)
      << second.error().brief();
  EXPECT_NE(second.error().hint.find("fuser"), std::string::npos) << second.error().brief();
  EXPECT_OK((*unit)->identify()) << "the first is not disturbed";
  unit->reset();
  EXPECT_OK(open(plugged->usb_address()));
}

void permission_errors_name_the_rule(UsbBench& bench) {
  SIXPOINT_SKIP_UNLESS(::geteuid() == 0, "needs root, to become a user without access");
  Plugged plugged(bench, make_unit(111));
  ASSERT_OK(plugged.status());
  const auto found = wait_for(1);
  ASSERT_EQ(found.size(), 1U);
  constexpr uid_t kOrdinaryUser = 65534;
  ASSERT_EQ(::seteuid(kOrdinaryUser), 0);
  const auto refused = device::open_monitor(found[0], posix_env());
  ASSERT_EQ(::seteuid(0), 0);
  EXPECT_FAILS(refused, ErrorCode::permission);
  for (const char* rules :
       {"packaging/udev/60-sixpoint-detect.rules", "70-sixpoint-access.rules"}) {
    EXPECT_NE(refused.error().hint.find(rules), std::string::npos) << refused.error().brief();
  }
  EXPECT_OK(open(plugged->hid_address())) << "and root may";
}

void a_swapped_unit_is_never_taken_for_the_first(UsbBench& bench) {
  auto watch = HotplugWatch::start();
  ASSERT_OK(watch);
  Plugged first(bench, make_unit(121));
  ASSERT_OK(first.status());
  auto unit = open(first->hid_address());
  ASSERT_OK(unit);
  ASSERT_OK((*unit)->start_stream(100));
  const std::string port = first->port;
  bench.unplug(*first);
  Plugged second(bench, make_unit(122), port);
  ASSERT_OK(second.status());
  EXPECT_EQ(second->port, port);
  const auto arrived = event_of(**watch, HotplugEvent::Kind::arrived, second->serial);
  ASSERT_TRUE(arrived);
  EXPECT_EQ(arrived->port, port);
  // The old handle gives the reports that had come and then fails; it never reads the second unit.
  for (;;) {
    const auto block = (*unit)->next_samples(seconds(2));
    if (!block) {
      EXPECT_EQ(block.error().code, ErrorCode::device_unavailable);
      break;
    }
    ASSERT_TRUE(block->has_value()) << "silence instead of an error";
  }
  EXPECT_FAILS((*unit)->identify(), ErrorCode::device_unavailable);
  EXPECT_FAILS(registry().open(first->hid_address(), posix_env()), ErrorCode::device_unavailable);
  auto other = open(second->hid_address());
  ASSERT_OK(other);
  EXPECT_EQ((*other)->identity().serial, second->serial);
}

}  // namespace

const std::vector<UsbBody>& usb_bodies() {
  static const std::vector<UsbBody> kBodies = {
      {"EnumeratesByIdAndSerial", enumerates_by_id_and_serial},
      {"OpensBySerial", opens_by_serial},
      {"WritesConstantsAsATransaction", writes_constants_as_a_transaction},
      {"StreamsAndSeesLoss", streams_and_sees_loss},
      {"SeveralUnitsStreamAtOnce", several_units_stream_at_once},
      {"DownloadsAndResumes", downloads_and_resumes},
      {"HotplugArrivesLeavesAndReplugs", hotplug_arrives_leaves_and_replugs},
      {"UnpluggingInFlightIsSeen", unplugging_in_flight_is_seen},
      {"CancelEndsWhatWaits", cancel_ends_what_waits},
      {"ASecondProgramIsToldWhoIsInTheWay", a_second_program_is_told_who_is_in_the_way},
      {"PermissionErrorsNameTheRule", permission_errors_name_the_rule},
      {"ASwappedUnitIsNeverTakenForTheFirst", a_swapped_unit_is_never_taken_for_the_first},
  };
  return kBodies;
}

}  // namespace sixpoint::tests

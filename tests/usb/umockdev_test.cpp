// The USB tests over umockdev, and what only this carrier can do: devices that misbehave, and the
// installed program as a child process.
#include <atomic>
#include <csignal>
#include <filesystem>
#include <future>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "device/jig.h"
#include "device/unit.h"
#include "device/usb/discovery.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/usb/usb_drive.h"
#include "skip_unless.h"
#include "temporary_folder.h"
#include "usb/bodies.h"
#include "usb/child.h"
#include "usb/misbehaving.h"
#include "usb/plugged.h"
#include "usb/technician.h"
#include "usb/umockdev_bench.h"

namespace sixpoint::tests {
namespace {

using mocks::UsbAnswer;
using std::chrono::milliseconds;
using std::chrono::seconds;

class Umockdev : public testing::TestWithParam<UsbBody> {};

TEST_P(Umockdev, Body) {
  auto bus = mocks::UmockdevBus::make();
  ASSERT_OK(bus);
  UmockdevBench bench(std::move(*bus));
  GetParam().run(bench);
}

INSTANTIATE_TEST_SUITE_P(Usb, Umockdev, testing::ValuesIn(usb_bodies()),
                         [](const auto& one) { return std::string(one.param.name); });

INSTANTIATE_TEST_SUITE_P(Faults, Umockdev, testing::ValuesIn(usb_fault_bodies()),
                         [](const auto& one) { return std::string(one.param.name); });

TEST_F(Misbehaving, GarbageOnReportsIsCountedAndSurvived) {
  std::atomic<int> garbage = 5;
  wilful->on_in = [&](std::uint8_t endpoint) -> std::optional<UsbAnswer> {
    const bool now = endpoint == device::kHidInEndpoint && garbage > 0;
    garbage -= now ? 1 : 0;
    return now ? std::optional(UsbAnswer::done(Bytes(garbage % 2 == 0 ? 64 : 3, 0xA5)))
               : std::nullopt;
  };
  auto link = open();
  ASSERT_OK(link);
  auto opened = device::WireUnit::open(std::move(*link));
  ASSERT_OK(opened);
  EXPECT_EQ((*opened)->identity().serial, unit.serial);
  EXPECT_EQ((*opened)->stream_statistics().damaged_reports, 5U);
}

// docs/devices/wgt3x-bt-bench-unit.md: a thread per unit, stopped whatever it waits for. The
// reading and the bulk thread wait for an hour here, which no test lasts; bench/usb_bench says how
// long stopping takes.
TEST_F(Misbehaving, TheThreadsOfAUnitStopWhateverTheyWaitFor) {
  for (int i = 0; i < 10; ++i) {
    auto link = i == 0 ? open() : registry().open(unit.hid_address(), posix_env());
    ASSERT_OK(link);
    auto& bulk = *link->bulk;
    auto blocks = std::async(std::launch::async, [&bulk] {
      Bytes buffer(device::kBulkBlockBytes);
      return bulk.read(buffer, std::chrono::hours(1));
    });
    auto opened = device::WireUnit::open(std::move(*link));
    ASSERT_OK(opened);
    ASSERT_OK((*opened)->start_stream(100));
    ASSERT_OK((*opened)->next_samples(seconds(5)));
    ASSERT_OK((*opened)->stop_stream());
    auto samples = std::async(std::launch::async,
                              [&] { return (*opened)->next_samples(std::chrono::hours(1)); });
    std::this_thread::sleep_for(milliseconds(5));
    (*opened)->cancel();
    EXPECT_FAILS(samples.get(), ErrorCode::device_unavailable);
    EXPECT_FAILS(blocks.get(), ErrorCode::device_unavailable);
    opened->reset();
  }
}

// Strings of a device are not printed to a terminal unchanged, and open no other device.
TEST_F(Misbehaving, HostileSerialNumbersNameNothing) {
  for (const std::string& serial :
       {std::string("A\x1b[2JB"), std::string("two words"), std::string("\xc5\xbelut\xc3\xbd"),
        std::string(120, 'A'), std::string("../../etc"), std::string("%n%s"), std::string("a,b=c"),
        std::string()}) {
    SCOPED_TRACE(testing::PrintToString(serial));
    mocks::VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    options.truth.serial = serial;
    const auto plugged =
        std::make_shared<mocks::PluggedUnit>(std::move(options), std::make_shared<LeapingClock>());
    auto hostile = bus->plug_in(std::make_shared<mocks::UsbUnit>(plugged));
    ASSERT_OK(hostile);
    const auto found = device::attached_devices();
    ASSERT_OK(found);
    ASSERT_EQ(found->size(), 1U);
    const std::string& shown = found->front().serial;
    EXPECT_TRUE(shown.empty() || shown == serial);
    EXPECT_TRUE(
        std::all_of(shown.begin(), shown.end(), [](char c) { return c > ' ' && c <= '~'; }));
    for (const std::string& more : {std::string("--json"), std::string()}) {
      const ChildAnswer listed =
          more.empty() ? run_child({"devices"}) : run_child({"devices", more});
      EXPECT_EQ(listed.exit_code, 0) << listed.people;
      EXPECT_EQ((listed.out + listed.people).find('\x1b'), std::string::npos);
      EXPECT_EQ(std::count(listed.out.begin(), listed.out.end(), '\n') == 1, more.empty());
    }
    // By its own name, and as the only one there is: that unit, or a refusal with its reason.
    for (const std::string& address : {"hid:" + serial, std::string("hid:")}) {
      auto link = registry().open(address, posix_env());
      if (!link) {
        EXPECT_EQ(link.error().brief().find('\x1b'), std::string::npos);
        continue;
      }
      const auto unit_or_not = device::WireUnit::open(std::move(*link));
      if (unit_or_not) {
        EXPECT_EQ((*unit_or_not)->identity().serial, serial);
      } else {
        EXPECT_EQ(unit_or_not.error().code, ErrorCode::bad_data);
      }
    }
    bus->unplug(hostile->port);
  }
}

class Program : public testing::Test {
 protected:
  void SetUp() override {
    auto bus = mocks::UmockdevBus::make();
    ASSERT_OK(bus);
    bench = std::make_unique<UmockdevBench>(std::move(*bus));
  }
  std::unique_ptr<UmockdevBench> bench;
};

TEST_F(Program, ListsWhatIsPluggedIn) {
  auto a = make_unit(1);
  auto b = make_unit(2);
  ASSERT_OK(bench->plug_in(a));
  ASSERT_OK(bench->plug_in(b));
  const ChildAnswer answer = run_child({"devices", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = nlohmann::json::parse(answer.out);
  EXPECT_EQ(json["schema"], "sixpoint/devices/1");
  ASSERT_EQ(json["devices"].size(), 2U);
  EXPECT_EQ(json["devices"][0]["address"], a.hid_address());
  EXPECT_EQ(json["devices"][0]["port"], "1-1");
  EXPECT_EQ(json["devices"][1]["serial"], b.serial);
  EXPECT_EQ(json["devices"][1]["model"], "wgt3x-bt-bench-unit");
  EXPECT_EQ(json["devices"][1]["accessible"], true);
  bench->unplug(a);
  EXPECT_EQ(run_child({"devices"}).out.find(a.serial), std::string::npos);
  const ChildAnswer doctor = run_child({"doctor", "--json"});
  EXPECT_NE(doctor.out.find("1 of our devices plugged in"), std::string::npos) << doctor.out;
}

// Oracle: the order in which it was done.
TEST_F(Program, SaysWhatComesAndGoes) {
  auto a = make_unit(1);
  ASSERT_OK(bench->plug_in(a));
  auto b = make_unit(2);
  const ChildAnswer answer = run_child_lines(
      {"devices", "--watch", "--for", "20", "--json"}, [&](const std::string& line, pid_t child) {
        // Each event leads to the next.
        const auto json = nlohmann::json::parse(line, nullptr, false);
        const std::string event =
            json["event"].get<std::string>() + " " + json["device"]["serial"].get<std::string>();
        if (event == "arrived " + a.serial && b.port.empty()) {
          ASSERT_OK(bench->plug_in(b));
        } else if (event == "arrived " + b.serial) {
          bench->unplug(a);
        } else if (event == "left " + a.serial) {
          ::kill(child, SIGINT);
        }
      });
  EXPECT_EQ(answer.exit_code, 3) << answer.people;
  std::vector<std::string> events;
  std::istringstream lines(answer.out);
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line);
    EXPECT_EQ(json["schema"], "sixpoint/device-event/1");
    events.push_back(json["event"].get<std::string>() + " " +
                     json["device"]["serial"].get<std::string>());
  }
  EXPECT_EQ(events, (std::vector<std::string>{"arrived " + a.serial, "arrived " + b.serial,
                                              "left " + a.serial}));
}

// A unit of files alone is found as another product; it has no hidraw node and needs none.
TEST_F(Program, FindsAUnitOfFilesAlone) {
  const auto truth = sim::draw_unit(3);
  mocks::VirtualUnitOptions options;
  options.truth = truth;
  auto volume = mocks::unit_volume(mocks::VirtualUnit(options));
  ASSERT_OK(volume);
  const auto drive = std::make_shared<mocks::UsbDrive>(
      truth, std::make_shared<const mocks::FatImage>(*std::move(volume)),
      std::make_shared<LeapingClock>());
  ASSERT_OK(bench->bus().plug_in(drive));
  const ChildAnswer answer = run_child({"devices", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = nlohmann::json::parse(answer.out);
  ASSERT_EQ(json["devices"].size(), 1U);
  EXPECT_EQ(json["devices"][0]["model"], "file-monitor");
  EXPECT_EQ(json["devices"][0]["serial"], truth.serial);
  EXPECT_EQ(json["devices"][0]["address"], nullptr) << "there is no block device here to mount";
  EXPECT_NE(json["devices"][0]["hint"].get<std::string>().find("drive:FOLDER"), std::string::npos);
  EXPECT_FAILS(registry().open("hid:", posix_env()), ErrorCode::device_unavailable);
}

TEST_F(Program, SaysWhichSerialsThereAre) {
  auto unit = make_unit(1);
  ASSERT_OK(bench->plug_in(unit));
  const ChildAnswer answer = run_child({"jig", "--device", "hid:NOSUCHUNIT"});
  EXPECT_EQ(answer.exit_code, 69);
  EXPECT_NE(answer.people.find(unit.serial), std::string::npos) << answer.people;
}

// As a person without the udev rules: the message names them, `devices` says it of each device, and
// with permission the same person gets on.
TEST_F(Program, WithoutPermissionNamesTheUdevRules) {
  SIXPOINT_SKIP_UNLESS(::geteuid() == 0, "needs root, to start the program as another user");
  auto unit = make_unit(1);
  ASSERT_OK(bench->plug_in(unit));
  bench->bus().allow(unit.port, false);
  const std::string bed = ::getenv("UMOCKDEV_DIR");
  ASSERT_EQ(::chmod(bed.c_str(), 0777), 0);  // udev's events are sockets in it
  TemporaryFolder folder;
  ASSERT_EQ(::chmod(folder.path().c_str(), 0777), 0);
  std::filesystem::copy_file(SIXPOINT_PROGRAM, folder / "sixpoint");
  const auto as_nobody = [&](std::vector<std::string> arguments) {
    // A person has a home of their own; root's operators are none of theirs.
    arguments.insert(arguments.begin(),
                     {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups",
                      "/usr/bin/env", "HOME=" + folder.path(), folder / "sixpoint"});
    return run_program(arguments);
  };
  const ChildAnswer refused =
      as_nobody({"jig", "--device", unit.hid_address(), "--store", folder / "s.db"});
  EXPECT_EQ(refused.exit_code, 77) << refused.people;
  for (const char* rules :
       {"packaging/udev/60-sixpoint-detect.rules", "70-sixpoint-access.rules"}) {
    EXPECT_NE(refused.people.find(rules), std::string::npos) << refused.people;
  }
  const ChildAnswer listed = as_nobody({"devices", "--json"});
  EXPECT_EQ(listed.exit_code, 0) << listed.people;
  const auto json = nlohmann::json::parse(listed.out);
  ASSERT_EQ(json["devices"].size(), 1U);
  EXPECT_EQ(json["devices"][0]["accessible"], false);
  EXPECT_NE(json["devices"][0]["hint"].get<std::string>().find("60-sixpoint-detect.rules"),
            std::string::npos);
  bench->bus().allow(unit.port, true);
  EXPECT_EQ(nlohmann::json::parse(as_nobody({"devices", "--json"}).out)["devices"][0]["accessible"],
            true);
}

TEST_F(Program, MeasuresAUnitOnTheJigAndWritesItsConstants) {
  constexpr int kPace = 8;  // the unit's time passes so much faster than the program's
  auto unit = make_unit(5, {}, kPace);
  ASSERT_OK(bench->plug_in(unit));
  TemporaryFolder folder;
  Technician technician(unit);
  const ChildAnswer answer =
      run_child({"jig", "--device", unit.hid_address(), "--jig", "manual", "--filter", "current",
                 "--dwell", "0.5", "--write", "--json", "--store", folder / "store.db"},
                [&](const std::string& line) { technician.on_line(line); });
  ASSERT_EQ(answer.exit_code, 0) << answer.people << answer.out;
  EXPECT_GE(technician.turns, 11) << "six faces, three to verify, two after writing";
  const auto json = nlohmann::json::parse(answer.out);
  EXPECT_EQ(json["serial"], unit.serial);
  EXPECT_EQ(json["verdict"], "pass");
  EXPECT_EQ(json["stream"]["lost_samples"], 0);
  EXPECT_FALSE(json["stored_id"].is_null());
  // Oracle: what the simulated sensor really is. 0.7 % and 2 LSB: half a second of noise per pose.
  const std::lock_guard lock(unit.unit->mutex);
  const auto& truth = unit.unit->unit.truth();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(json["constants"]["sensitivity_g_per_lsb"][axis].get<double>() *
                    truth.current.sensitivity_lsb_per_g[axis],
                1, 0.007);
    EXPECT_NEAR(json["constants"]["zero_lsb"][axis].get<double>(), truth.current.zero_lsb[axis], 2);
  }
  const auto page = device::decode_calibration_page(*unit.unit->unit.memory().read());
  ASSERT_OK(page);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_EQ(json["constants"]["zero_lsb"].size(), kAxes);
    EXPECT_NEAR(page->constants.zero_lsb[axis], truth.current.zero_lsb[axis], 3);
  }
}

// What passed through hidapi, played back without it: the same run.
TEST_F(Program, RecordsASessionThatReplaysWithoutTheUnit) {
  auto unit = make_unit(5, {}, 8);
  ASSERT_OK(bench->plug_in(unit));
  const TemporaryFolder folder;
  const std::string session = folder / "session.zip";
  Technician technician(unit);
  const auto jig = [&](const std::string& device, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"jig",     "--device",         device, "--jig",
                                          "manual",  "--dwell",          "0.5",  "--json",
                                          "--store", folder / "store.db"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_child(arguments, [&](const std::string& line) { technician.on_line(line); });
  };
  const ChildAnswer recorded = jig(unit.hid_address(), {"--record", session});
  ASSERT_EQ(recorded.exit_code, 0) << recorded.people;
  bench->unplug(unit);
  for (const std::string& match : {std::string(), std::string(",match=key")}) {
    const ChildAnswer replayed = jig("replay:" + session + match, {});
    ASSERT_EQ(replayed.exit_code, 0) << replayed.people;
    EXPECT_EQ(nlohmann::json::parse(replayed.out)["constants"],
              nlohmann::json::parse(recorded.out)["constants"]);
  }
}

TEST_F(Program, EndsWithDeviceUnavailableWhenTheCableIsPulled) {
  auto unit = make_unit(6);
  ASSERT_OK(bench->plug_in(unit));
  TemporaryFolder folder;
  const ChildAnswer answer =
      run_child({"jig", "--device", unit.usb_address(), "--jig", "manual", "--patience", "1",
                 "--store", folder / "store.db"},
                [&](const std::string& line) {
                  if (line.starts_with("turn the unit") && !unit.port.empty()) {
                    bench->unplug(unit);
                  }
                });
  EXPECT_EQ(answer.exit_code, 69) << answer.people;
  EXPECT_NE(answer.people.find("did not come back within 1 s; plug it in"), std::string::npos)
      << answer.people;
}

// As in the kernel, what a killed program held is free.
TEST_F(Program, ThatIsKilledLetsGoOfItsUnit) {
  auto unit = make_unit(7);
  ASSERT_OK(bench->plug_in(unit));
  TemporaryFolder folder;
  for (int round = 0; round < 5; ++round) {
    const ChildAnswer answer = run_child_signalled(
        {"jig", "--device", unit.hid_address(), "--jig", "manual", "--store", folder / "store.db"},
        [](const std::string& line, pid_t child) {
          if (line.starts_with("turn the unit")) {
            ::kill(child, SIGKILL);
          }
        });
    EXPECT_EQ(answer.exit_code, 128 + SIGKILL) << round << ": " << answer.people;
  }
}

}  // namespace
}  // namespace sixpoint::tests

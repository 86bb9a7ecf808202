// sixpoint virtual by its contract: the program as a child, a USB/IP client of the tests' own.
#include <csignal>
#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "cli/run_child.h"
#include "device/jigs/hid_jig.h"
#include "device/wire/protocol.h"
#include "expect_result.h"
#include "gap/judge/diagnosis.h"
#include "gt3x/recording.h"
#include "mocks/usb/usbip_client.h"
#include "run_command.h"
#include "sim/effects/effect.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::UsbipClient;
using Data = UsbipClient::Data;

// `sixpoint virtual ARGUMENTS --json`, up to its document.
class Served : public tests::Child {
 public:
  explicit Served(std::vector<std::string> arguments)
      : Child(whole(std::move(arguments))), document(next_document()) {}
  UsbipClient connect() const {
    return UsbipClient(document["usbip"]["port"].get<std::uint16_t>());
  }

  nlohmann::json document;

 private:
  static std::vector<std::string> whole(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"virtual", "--usbip", "0", "--json"});
    return arguments;
  }
};

// What a diagnosis would leave behind that found these effects, at the simulator's default sizes.
std::string augmented(const std::vector<const sim::EffectKind*>& kinds) {
  gap::Diagnosis diagnosis;
  diagnosis.protocol = "production";
  diagnosis.serial = "MOS2A45130007";
  diagnosis.seed = 5;
  diagnosis.unit.noise_mg = {3.9, 3.9, 5.5};
  for (const sim::EffectKind* kind : kinds) {
    gap::EffectFinding finding;
    finding.name = kind->name;
    for (const sim::Parameter& parameter : kind->parameters) {
      finding.parameters.push_back({parameter.name, parameter.default_value, {}});
    }
    diagnosis.effects.push_back(finding);
  }
  return gap::augmented_scenario(diagnosis).dump();
}

// gap.md: the augmented scenario is one command away from the virtual unit.
TEST(VirtualCommand, TakesTheAugmentedScenarioOfEveryEffect) {
  const tests::TemporaryFolder folder;
  const auto& kinds = sim::effect_catalogue();
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const std::vector<std::vector<const sim::EffectKind*>> sets = {
        {&kinds[i]}, {&kinds[i], &kinds[(i + 7) % kinds.size()]}};
    for (const auto& set : sets) {
      SCOPED_TRACE(set.front()->name + " and " + set.back()->name);
      std::ofstream(folder / "augmented.json") << augmented(set);
      Served served({"--scenario", folder / "augmented.json"});
      ASSERT_TRUE(served.document.is_object());
      ASSERT_TRUE(served.document.contains("devices")) << served.document.dump();
      EXPECT_EQ(served.document["devices"][0]["serial"], "MOS2A45130007");
      EXPECT_EQ(served.connect().list().size(), 1U);
    }
  }
}

TEST(VirtualCommand, SaysWhatItServesAndServesIt) {
  for (const int signal : {SIGINT, SIGTERM}) {
    Served served({"--count", "3", "--device", "virtual:seed=7,serial=MOS2A45130007"});
    ASSERT_TRUE(served.document.is_object());
    EXPECT_EQ(served.document["schema"], "sixpoint/virtual/1");
    EXPECT_EQ(served.document["usbip"]["host"], "127.0.0.1");
    ASSERT_EQ(served.document["devices"].size(), 3U);
    EXPECT_EQ(served.document["devices"][0]["serial"], "MOS2A45130007");
    const auto devices = served.connect().list();
    ASSERT_EQ(devices.size(), 3U);
    std::set<std::string> serials;
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(devices[i].busid, served.document["devices"][i]["busid"]);
      serials.insert(served.document["devices"][i]["serial"]);
      auto client = served.connect();
      ASSERT_EQ(client.import(devices[i].busid), 0U);
      // The serial number of the descriptors is that of the document.
      const Data text = client.control(0x80, 6, 0x0303, 0x0409, 255).data;
      std::string serial;
      for (std::size_t at = 2; at < text.size(); at += 2) {
        serial += static_cast<char>(text[at]);
      }
      EXPECT_EQ(serial, served.document["devices"][i]["serial"]);
    }
    EXPECT_EQ(serials.size(), 3U);
    EXPECT_EQ(served.stop(signal), signal == SIGINT ? 3 : 0);
  }
}

TEST(VirtualCommand, ASecondCtrlCDoesNotEndTheOrderlyEnd) {
  Served served({"--count", "2"});
  ASSERT_TRUE(served.document.is_object());
  EXPECT_EQ(served.stop_repeatedly(SIGINT), 3);
}

TEST(VirtualCommand, TheSameSeedIsTheSameBench) {
  const auto serials = [](const std::string& seed) {
    Served served({"--count", "4", "--seed", seed});
    return served.document["devices"].dump();
  };
  EXPECT_EQ(serials("5"), serials("5"));
  EXPECT_NE(serials("5"), serials("6"));
}

// The jig turns the first unit: what its stream reads is the other way round afterwards.
TEST(VirtualCommand, TheJigTurnsTheFirstUnit) {
  Served served({"--jig"});
  ASSERT_EQ(served.document["devices"].size(), 2U);
  EXPECT_EQ(served.document["devices"][1]["kind"], "jig");
  EXPECT_EQ(served.document["devices"][1]["product_id"], "0002");
  auto jig = served.connect();
  ASSERT_EQ(jig.import("1-2"), 0U);
  EXPECT_EQ(jig.control(0x80, 6, 0x0200, 0, 255).data.size(), 41U);
  const auto ask = [](UsbipClient& client, std::uint16_t sequence, std::uint8_t command,
                      Bytes payload) {
    const auto report = device::encode({device::ReportKind::request, sequence,
                                        static_cast<device::Command>(command),
                                        device::ReplyCode::ok, std::move(payload)});
    EXPECT_EQ(client.out(1, Data(report.begin(), report.end())).status, 0);
    return device::decode(client.in(1, 64).data);
  };
  auto unit = served.connect();
  ASSERT_EQ(unit.import("1-1"), 0U);
  const auto reading = [&](std::uint16_t sequence) {
    EXPECT_TRUE(ask(unit, sequence, 10, {100, 0}).has_value());
    const auto block = device::decode_samples(*device::decode(unit.in(1, 64).data));
    const int z_lsb = block->counts.front()[2];
    unit.control(0x00, 9, 1, 0, 0);  // ends the stream
    return z_lsb;
  };
  const int before_lsb = reading(1);
  using device::JigCommand;
  EXPECT_EQ(ask(jig, 1, static_cast<std::uint8_t>(JigCommand::go_to),
                {static_cast<std::uint8_t>(device::Pose::minus_z)})
                ->code,
            device::ReplyCode::ok);
  posix_env().clock.sleep(std::chrono::seconds(3));
  EXPECT_LT(reading(2), before_lsb - 300) << "2 g are about 500 LSB";
}

// The oracle is the recording that `simulate` makes of the same scenario, its info.txt and log.bin.
TEST(VirtualCommand, TheScenariosRecordingIsOnTheVolume) {
  const tests::TemporaryFolder folder;
  const std::string scenario = folder / "S.json";
  std::ofstream(scenario) << R"({"schema": "sixpoint/scenario/1", "seed": 1,
    "unit": {"serial": "MOS2A45130007"},
    "motions": [{"kind": "still", "duration_s": 20, "pose": "+z"}]})";
  const std::string file = folder / "S.gt3x";
  ASSERT_EQ(
      tests::run_command(posix_env(), {"simulate", "--scenario", scenario, "-o", file}).exit_code,
      0);
  auto recording = gt3x::Recording::open(posix_env().files, file);
  ASSERT_OK(recording);

  Served served({"--scenario", scenario});
  EXPECT_EQ(served.document["devices"][0]["serial"], "MOS2A45130007");
  auto client = served.connect();
  ASSERT_EQ(client.import("1-1"), 0U);
  const auto read = [&client](std::uint32_t block, std::uint8_t count) {
    Data command = {'U', 'S', 'B',  'C', 1,  0,    0, 0, 0, static_cast<std::uint8_t>(count * 2),
                    0,   0,   0x80, 0,   10, 0x28, 0};
    UsbipClient::put(command, block, 4);
    command.insert(command.end(), {0, 0, count});
    command.resize(31, 0);
    client.out(3, command);
    const Data data = client.in(3, std::uint32_t{count} * 512).data;
    EXPECT_EQ(client.in(3, 13).data.back(), 0);
    return data;
  };
  // A reader of FAT16 of its own: boot sector, root folder, chains of neighbours.
  const Data boot = read(0, 1);
  const auto little = [](const Data& bytes, std::size_t at, unsigned width) {
    std::uint32_t value = 0;
    while (width-- > 0) {
      value = value << 8U | bytes.at(at + width);
    }
    return value;
  };
  const std::uint32_t root_block = little(boot, 14, 2) + boot[16] * little(boot, 22, 2);
  const std::uint32_t data_block = root_block + little(boot, 17, 2) * 32 / 512;
  const Data root = read(root_block, 1);
  int found = 0;
  for (std::size_t at = 0; at < root.size() && root[at] != 0; at += 32) {
    const std::string name(root.begin() + static_cast<std::ptrdiff_t>(at),
                           root.begin() + static_cast<std::ptrdiff_t>(at) + 11);
    const std::uint32_t size = little(root, at + 28, 4);
    const std::string entry = name == "INFO    TXT"   ? "info.txt"
                              : name == "LOG     BIN" ? "log.bin"
                                                      : "";
    if (entry.empty()) {
      continue;
    }
    ++found;
    const std::uint32_t first = data_block + (little(root, at + 26, 2) - 2) * boot[13];
    Data content = read(first, static_cast<std::uint8_t>((size + 511) / 512));
    content.resize(size);
    auto wanted = recording->open_entry(entry);
    ASSERT_OK(wanted);
    EXPECT_TRUE(gt3x::read_all(**wanted, 1U << 20).value() == content) << name;
    EXPECT_GT(size, 300U);
  }
  EXPECT_EQ(found, 2);
}

// Mass storage alone: another product, one interface, and a volume from which capture works is
// tests/system/program.sh's.
TEST(VirtualCommand, AUnitOfFilesAloneIsOffered) {
  Served served({"--device", "virtual:seed=7,interfaces=storage", "--count", "2"});
  ASSERT_EQ(served.document["devices"].size(), 2U) << served.document;
  EXPECT_EQ(served.document["devices"][0]["kind"], "drive");
  EXPECT_EQ(served.document["devices"][0]["product_id"], "0003");
  EXPECT_EQ(served.document["devices"][0]["serial"], "MOS2A45139074");
  EXPECT_EQ(served.document["devices"][1]["product_id"], "0001");
  EXPECT_EQ(served.stop(SIGTERM), 0);
}

TEST(VirtualCommand, RefusesWhatItCannotDo) {
  const auto code = [](const std::vector<std::string>& arguments) {
    return tests::run_command(posix_env(), arguments).exit_code;
  };
  EXPECT_EQ(code({"virtual", "--device", "virtual:shoe=1"}), 64);
  EXPECT_EQ(code({"virtual", "--device", "virtual:interfaces=storage", "--jig"}), 64);
  EXPECT_EQ(code({"jig", "--device", "virtual:interfaces=storage"}), 64);
  EXPECT_EQ(code({"virtual", "--usbip", "70000"}), 64);
  EXPECT_EQ(code({"virtual", "--count", "0"}), 64);
  EXPECT_EQ(code({"virtual", "--scenario", "/nonexistent.json"}), 66);
  for (const char* other : {"foo", "hid:X", "hid:serial=MOS2A45130007", "hid:X=1,seed=7"}) {
    const auto answer = tests::run_command(posix_env(), {"virtual", "--device", other});
    EXPECT_EQ(answer.exit_code, 64) << other;
    EXPECT_THAT(answer.people,
                AllOf(HasSubstr(std::string("--device ") + other), HasSubstr("virtual:KEY=VALUE")));
  }
  const tests::TemporaryFolder folder;
  std::ofstream(folder / "long.json") << R"({"schema": "sixpoint/scenario/1",
    "motions": [{"kind": "free_living", "duration_s": 8000000}]})";
  EXPECT_EQ(code({"virtual", "--scenario", folder / "long.json"}), 78);
  Served served({});
  const auto port = std::to_string(served.document["usbip"]["port"].get<int>());
  const auto taken = tests::run_command(posix_env(), {"virtual", "--usbip", port});
  EXPECT_EQ(taken.exit_code, 69) << "as of a station";
  EXPECT_THAT(taken.people, HasSubstr("127.0.0.1:" + port));
}

}  // namespace
}  // namespace sixpoint::cli

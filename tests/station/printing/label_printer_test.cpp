#include "station/printing/label_printer.h"

#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "station/printing/fake_printer.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Answers as it is told, and notes what it printed.
class Sender {
 public:
  LabelSender sender() {
    return [this](std::string_view zpl, const std::stop_token& stop) -> Result<Sent> {
      ++attempts;
      while (hangs && !stop.stop_requested()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
      if (away || hangs) {
        return fail(ErrorCode::device_unavailable, "connection refused", "tcp://printer:9100");
      }
      const std::lock_guard lock(mutex);
      printed.emplace_back(zpl);
      return answer;
    };
  }
  std::vector<std::string> all() {
    const std::lock_guard lock(mutex);
    return printed;
  }
  std::atomic<int> attempts{0};
  std::atomic<bool> away{false};
  std::atomic<bool> hangs{false};
  Sent answer = Sent::taken;
  std::vector<std::string> printed;
  std::mutex mutex;
};

std::unique_ptr<LabelPrinter> opened(const std::string& folder, const LabelSender& send,
                                     LabelPrinterOptions options = {0.01, 0.05}) {
  auto printer = LabelPrinter::open(posix_env(), "tcp://printer:9100", folder, send, options);
  EXPECT_OK(printer);
  return *std::move(printer);
}

nlohmann::ordered_json label_of(const LabelPrinter& printer, const std::string& run) {
  const auto json = printer.to_json();
  for (const auto& label : json["labels"]) {
    if (label["run"] == run) {
      return label;
    }
  }
  return nlohmann::ordered_json::object();
}

template <class Test>
bool comes(const Test& test) {
  for (int i = 0; i < 4000 && !test(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return test();
}

bool becomes(const LabelPrinter& printer, const std::string& run, const std::string& state) {
  return comes([&] { return label_of(printer, run).value("state", "") == state; });
}

TEST(LabelPrinter, PausesGrow) {
  const LabelPrinterOptions options;
  EXPECT_EQ(retry_pause_s(1, options), 2);
  EXPECT_EQ(retry_pause_s(2, options), 4);
  EXPECT_EQ(retry_pause_s(5, options), 32);
  EXPECT_EQ(retry_pause_s(6, options), 60);
  EXPECT_EQ(retry_pause_s(1'000'000, options), 60);
  EXPECT_EQ(retry_pause_s(0, options), 2);
}

TEST(LabelPrinter, PrintsEachRunOnceAndAgainWhenAsked) {
  const tests::TemporaryFolder folder;
  Sender sender;
  const auto printer = opened(folder / "labels", sender.sender());
  const Label label{"aa", "MOS2A1", "one"};
  EXPECT_OK(printer->add(label));
  EXPECT_OK(printer->add(label));
  EXPECT_TRUE(becomes(*printer, "aa", "printed"));
  EXPECT_OK(printer->add(label));  // a run that was stored twice
  EXPECT_OK(printer->add({"bb", "MOS2A2", "two"}));
  EXPECT_TRUE(becomes(*printer, "bb", "printed"));
  EXPECT_THAT(sender.all(), ElementsAre("one", "two"));
  EXPECT_OK(printer->add_again(label));
  EXPECT_TRUE(comes([&] { return sender.all().size() == 3; }));
  EXPECT_EQ(sender.all().back(), "one");
  EXPECT_FAILS(printer->add({"../x", "MOS2A1", "three"}), ErrorCode::usage);
  EXPECT_FAILS(printer->add({"", "MOS2A1", "three"}), ErrorCode::usage);
  EXPECT_FAILS(printer->add({"0123ABCD", "MOS2A1", "three"}), ErrorCode::usage);
  EXPECT_FAILS(printer->add({std::string(65, 'a'), "MOS2A1", "three"}), ErrorCode::usage);
}

// The printer is away: the label is on the disk, is tried again and again, and says why; the next
// program goes on, and prints in the order of the runs.
TEST(LabelPrinter, ALabelWaitsForThePrinterAcrossARestart) {
  const tests::TemporaryFolder folder;
  Sender sender;
  sender.away = true;
  {
    const auto printer = opened(folder / "labels", sender.sender());
    EXPECT_OK(printer->add({"bb", "MOS2A2", "first"}));
    std::this_thread::sleep_for(
        std::chrono::milliseconds(3));  // labels are ordered by milliseconds
    EXPECT_OK(printer->add({"aa", "MOS2A1", "second"}));
    EXPECT_TRUE(comes([&] { return label_of(*printer, "bb").value("failures", 0) >= 3; }));
    EXPECT_EQ(label_of(*printer, "bb")["state"], "waiting");
    EXPECT_THAT(label_of(*printer, "bb")["problem"], HasSubstr("connection refused"));
    EXPECT_THAT(sender.all(), ElementsAre());
  }
  sender.away = false;
  const auto printer = opened(folder / "labels", sender.sender());
  EXPECT_TRUE(becomes(*printer, "aa", "printed"));
  EXPECT_THAT(sender.all(), ElementsAre("first", "second"));
}

TEST(LabelPrinter, WhatWasPrintedIsNotPrintedByTheNextProgram) {
  const tests::TemporaryFolder folder;
  Sender sender;
  {
    const auto printer = opened(folder / "labels", sender.sender());
    EXPECT_OK(printer->add({"aa", "MOS2A1", "one"}));
    EXPECT_TRUE(becomes(*printer, "aa", "printed"));
    EXPECT_TRUE(comes([&] {
      std::ifstream in(folder / "labels/aa.json");
      return nlohmann::json::parse(in, nullptr, false).value("state", "") == "printed";
    }));
  }
  const auto printer = opened(folder / "labels", sender.sender());
  EXPECT_OK(printer->add({"aa", "MOS2A1", "one"}));
  EXPECT_EQ(label_of(*printer, "aa")["state"], "printed");
  EXPECT_THAT(sender.all(), ElementsAre("one"));
}

// "Print label again" does not wait for the end of a pause.
TEST(LabelPrinter, AskingAgainEndsThePause) {
  const tests::TemporaryFolder folder;
  Sender sender;
  sender.away = true;
  const auto printer = opened(folder / "labels", sender.sender(), {3600, 3600});
  EXPECT_OK(printer->add({"aa", "MOS2A1", "one"}));
  EXPECT_TRUE(comes([&] { return label_of(*printer, "aa").value("failures", 0) == 1; }));
  sender.away = false;
  EXPECT_OK(printer->add_again({"aa", "MOS2A1", "one"}));
  EXPECT_TRUE(becomes(*printer, "aa", "printed"));
}

TEST(LabelPrinter, WhatWasNotConfirmedIsNotSentTwice) {
  const tests::TemporaryFolder folder;
  Sender sender;
  sender.answer = Sent::unconfirmed;
  const auto printer = opened(folder / "labels", sender.sender());
  EXPECT_OK(printer->add({"aa", "MOS2A1", "one"}));
  EXPECT_TRUE(becomes(*printer, "aa", "unconfirmed"));
  EXPECT_OK(printer->add({"bb", "MOS2A2", "two"}));
  EXPECT_TRUE(becomes(*printer, "bb", "unconfirmed"));
  EXPECT_THAT(sender.all(), ElementsAre("one", "two"));
}

// Oracle: add() comes back, and the end comes, while the printer never answers.
TEST(LabelPrinter, APrinterThatHangsHoldsNeitherCallersNorTheEnd) {
  const tests::TemporaryFolder folder;
  Sender sender;
  sender.hangs = true;
  {
    const auto printer = opened(folder / "labels", sender.sender());
    EXPECT_OK(printer->add({"aa", "MOS2A1", "one"}));
    EXPECT_TRUE(comes([&] { return sender.attempts == 1; }));
    EXPECT_OK(printer->add({"bb", "MOS2A2", "two"}));
    EXPECT_EQ(printer->to_json()["labels"].size(), 2);
  }
  EXPECT_EQ(sender.attempts, 1);
  EXPECT_TRUE(std::filesystem::exists(folder / "labels/aa.json"));
}

TEST(LabelPrinter, ABadFileSetsAsideItselfAlone) {
  const tests::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "labels");
  std::ofstream(folder / "labels/aa.json") << "{";
  std::ofstream(folder / "labels/bb.json")
      << R"({"run": "cc", "serial": "S", "state": "waiting", "added_ms": 1, "zpl": "other"})";
  std::ofstream(folder / "labels/dd.json")
      << R"({"run": "dd", "serial": "S", "state": "waiting", "added_ms": 1, "zpl": "good"})";
  std::ofstream(folder / "labels/readme.txt") << "not ours";
  Sender sender;
  const auto printer = opened(folder / "labels", sender.sender());
  EXPECT_TRUE(becomes(*printer, "dd", "printed"));
  EXPECT_THAT(sender.all(), ElementsAre("good"));
  EXPECT_TRUE(std::filesystem::exists(folder / "labels/aa.json.unreadable"));
  EXPECT_TRUE(std::filesystem::exists(folder / "labels/bb.json.unreadable"));
  EXPECT_TRUE(std::filesystem::exists(folder / "labels/readme.txt"));
}

TEST(LabelPrinter, TooManyAreRefusedAndOldOnesForgotten) {
  const tests::TemporaryFolder folder;
  Sender sender;
  sender.away = true;
  LabelPrinterOptions options{0.01, 0.05};
  options.most_waiting = 3;
  options.remembered = 2;
  const auto printer = opened(folder / "labels", sender.sender(), options);
  for (const char* run : {"a1", "a2", "a3"}) {
    EXPECT_OK(printer->add({run, "MOS2A1", run}));
  }
  EXPECT_FAILS(printer->add({"a4", "MOS2A1", "a4"}), ErrorCode::io);
  sender.away = false;
  EXPECT_TRUE(comes([&] { return sender.all().size() == 3; }));
  EXPECT_TRUE(comes([&] { return !std::filesystem::exists(folder / "labels/a1.json"); }));
  EXPECT_TRUE(std::filesystem::exists(folder / "labels/a3.json"));
}

// From the disk to a printer that is switched on later.
TEST(LabelPrinter, PrintsOverTheNetworkWhenThePrinterComes) {
  const tests::TemporaryFolder folder;
  int port = 0;
  {
    const FakePrinter gone([](int) {});
    port = gone.port();
  }
  const auto address = *parse_printer("tcp://127.0.0.1:" + std::to_string(port));
  const auto printer =
      opened(folder / "labels", [&](std::string_view zpl, const std::stop_token& stop) {
        return send_label(address, zpl, stop, 20);
      });
  EXPECT_OK(printer->add({"aa", "MOS2A1", "^XA^XZ\n"}));
  EXPECT_TRUE(comes([&] { return label_of(*printer, "aa").value("failures", 0) >= 1; }));
  std::mutex mutex;
  std::string got;
  const FakePrinter later(
      [&](int connection) {
        const std::string all = FakePrinter::read_all(connection);
        const std::lock_guard lock(mutex);
        got += all;
      },
      port);
  EXPECT_TRUE(becomes(*printer, "aa", "printed"));
  const std::lock_guard lock(mutex);
  EXPECT_EQ(got, "^XA^XZ\n");
}

}  // namespace
}  // namespace sixpoint::station

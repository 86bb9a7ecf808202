#include "station/printing/printer_connection.h"

#include <chrono>
#include <csignal>
#include <fstream>
#include <mutex>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "expect_result.h"
#include "station/printing/fake_printer.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

const std::string kLabel = "^XA^FDMOS2A45130007^FS^XZ\n";

Result<Sent> send(const std::string& printer, const std::string& zpl = kLabel,
                  double time_out_s = 20) {
  return send_label(*parse_printer(printer), zpl, std::stop_token(), time_out_s);
}

TEST(PrinterConnection, APrinterThatClosesAfterTheLastByteHasTakenTheLabel) {
  std::string got;
  std::mutex mutex;
  const FakePrinter printer([&](int connection) {
    const std::lock_guard lock(mutex);
    got = FakePrinter::read_all(connection);
  });
  const auto sent = send(printer.address());
  ASSERT_OK(sent);
  EXPECT_EQ(*sent, Sent::taken);
  const std::lock_guard lock(mutex);
  EXPECT_EQ(got, kLabel);
}

// Half a label: the printer reads some bytes and closes, or resets at once.
TEST(PrinterConnection, APrinterThatClosesInTheMiddleHasNotTakenIt) {
  const std::string long_label(4'000'000, 'x');
  const FakePrinter printer([](int connection) {
    std::array<char, 4> some{};
    static_cast<void>(::recv(connection, some.data(), some.size(), 0));
  });
  EXPECT_FAILS(send(printer.address()), ErrorCode::device_unavailable);
  EXPECT_FAILS(send(printer.address(), long_label), ErrorCode::device_unavailable);
}

TEST(PrinterConnection, APrinterThatRefusesOrHasNoAddressIsAnError) {
  std::string address;
  {
    const FakePrinter printer([](int) {});
    address = printer.address();
  }
  const auto refused = send(address);
  EXPECT_FAILS(refused, ErrorCode::device_unavailable);
  EXPECT_THAT(refused.error().brief(), HasSubstr("refused"));
  EXPECT_FAILS(send("tcp://no-such-printer.invalid:9100"), ErrorCode::device_unavailable);
}

// All bytes are there and the printer says nothing: out of paper, or one that never closes. A
// second label by itself would be one too many.
TEST(PrinterConnection, APrinterThatNeverClosesIsUnconfirmed) {
  std::stop_source end;
  const FakePrinter printer([&](int) {
    while (!end.stop_requested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  const auto sent = send(printer.address(), kLabel, 0.3);
  EXPECT_OK(sent);
  EXPECT_EQ(*sent, Sent::unconfirmed);
  // More than the buffers hold: it does not read at all.
  EXPECT_FAILS(send(printer.address(), std::string(60'000'000, 'x'), 0.3),
               ErrorCode::device_unavailable);
  end.request_stop();
}

TEST(PrinterConnection, AStopIsHeardWhileThePrinterHangs) {
  std::stop_source end;
  const FakePrinter printer([&](int) {
    while (!end.stop_requested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FAILS(send_label(*parse_printer(printer.address()), std::string(60'000'000, 'x'),
                          stop.get_token(), 3600),
               ErrorCode::device_unavailable);
  end.request_stop();
}

TEST(PrinterConnection, ADeviceTakesTheBytes) {
  const tests::TemporaryFolder folder;
  const std::string pipe = folder / "lp0";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const auto away = send(pipe);
  EXPECT_FAILS(away, ErrorCode::device_unavailable);
  EXPECT_THAT(away.error().what, HasSubstr("no program reads"));

  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  const auto sent = send(pipe);
  EXPECT_OK(sent);
  EXPECT_EQ(*sent, Sent::taken);
  std::array<char, 256> got{};
  const ssize_t n = ::read(reader, got.data(), got.size());
  ASSERT_GT(n, 0);
  EXPECT_EQ(std::string(got.data(), static_cast<std::size_t>(n)), kLabel);

  // It is there and takes nothing more.
  EXPECT_FAILS(send(pipe, std::string(2'000'000, 'x'), 0.2), ErrorCode::device_unavailable);
  // It goes in the middle: an error, and no SIGPIPE.
  std::jthread leaver([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ::close(reader);
  });
  EXPECT_FAILS(send(pipe, std::string(2'000'000, 'x')), ErrorCode::device_unavailable);
  // Nor does one wait for what this thread does next.
  sigset_t left;
  ASSERT_EQ(sigpending(&left), 0);
  EXPECT_EQ(sigismember(&left, SIGPIPE), 0);
  ASSERT_EQ(pthread_sigmask(SIG_BLOCK, nullptr, &left), 0);
  EXPECT_EQ(sigismember(&left, SIGPIPE), 0);
}

// The system's event queue refuses a device that is always ready.
TEST(PrinterConnection, ADeviceThatIsAlwaysReadyTakesTheBytes) {
  const auto sent = send("/dev/null");
  ASSERT_OK(sent);
  EXPECT_EQ(*sent, Sent::taken);
}

// The path was free when the station started, and a file is there now.
TEST(PrinterConnection, NothingIsWrittenIntoAFile) {
  const tests::TemporaryFolder folder;
  std::ofstream(folder / "lp0") << "content";
  EXPECT_FAILS(send(folder / "lp0"), ErrorCode::device_unavailable);
  EXPECT_FAILS(send(folder / "away"), ErrorCode::device_unavailable);
  std::ifstream in(folder / "lp0");
  std::string content;
  in >> content;
  EXPECT_EQ(content, "content");
}

}  // namespace
}  // namespace sixpoint::station

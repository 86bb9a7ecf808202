#include "station/printing/printer_address.h"

#include <fstream>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

// The table of the header: what is a printer, and that it is said as it was given.
TEST(PrinterAddress, KnowsDevicesAndNetworkPrinters) {
  for (const char* text :
       {"/dev/usb/lp0", "tcp://label-printer:9100", "tcp://10.0.0.7:1", "tcp://[fe80::1]:65535"}) {
    const auto printer = parse_printer(text);
    ASSERT_OK(printer);
    EXPECT_EQ(printer->text(), text);
  }
  EXPECT_EQ(parse_printer("tcp://label-printer.plant:9100")->host, "label-printer.plant");
  EXPECT_EQ(parse_printer("tcp://[::1]:9100")->host, "::1");
  EXPECT_EQ(parse_printer("/dev/usb/lp0")->port, 0);
}

TEST(PrinterAddress, AnythingElseIsRefused) {
  for (const std::string& text :
       std::vector<std::string>{"",
                                " ",
                                "lp0",
                                "dev/usb/lp0",
                                "./lp0",
                                "/dev/../etc/passwd",
                                "/dev/lp/..",
                                "/dev/",
                                "/dev/lp0\n",
                                std::string("/dev/lp0\0", 9),
                                "/" + std::string(2000, 'a'),
                                "tcp://",
                                "tcp://host",
                                "tcp://host:",
                                "tcp://:9100",
                                "tcp://host:0",
                                "tcp://host:65536",
                                "tcp://host:-1",
                                "tcp://host:9100/x",
                                "tcp://host:9100?x",
                                "tcp://host:+1",
                                "tcp://ada@host:9100",
                                "tcp://ada:pin@host:9100",
                                "tcp://host name:9100",
                                "tcp://-x:9100",
                                "tcp://[::1:9100",
                                "tcp://[]:9100",
                                "tcp://a::b:9100",
                                "tcp://h\x1b[2J:9100",
                                "tcp://" + std::string(254, 'a') + ":9100",
                                "http://host:9100",
                                "udp://host:9100",
                                "file:///dev/usb/lp0",
                                "TCP://host:9100"}) {
    const auto printer = parse_printer(text);
    ASSERT_FALSE(printer) << text;
    EXPECT_EQ(printer.error().code, ErrorCode::usage) << text;
    EXPECT_EQ(printer.error().brief().find('\x1b'), std::string::npos);
  }
}

// Labels go into no file and no folder; a printer that is switched off may be there later.
TEST(PrinterAddress, APathOfAnythingElseIsRefused) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  std::ofstream(folder / "store.db") << "content";
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_FAILS(check_printer(files, *parse_printer(folder / "store.db")), ErrorCode::usage);
  EXPECT_FAILS(check_printer(files, *parse_printer(folder.path())), ErrorCode::usage);
  EXPECT_OK(check_printer(files, *parse_printer(folder / "pipe")));
  EXPECT_OK(check_printer(files, *parse_printer("/dev/null")));
  EXPECT_OK(check_printer(files, *parse_printer(folder / "away")));
  EXPECT_OK(check_printer(files, *parse_printer("tcp://printer:9100")));
}

}  // namespace
}  // namespace sixpoint::station

// sixpoint station by its contract (docs/station.md); tests/station/page has the page itself.
#include <arpa/inet.h>
#include <sys/socket.h>

#include "cli/command_fixture.h"
#include "cli/run_child.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using tests::Child;

// The whole answer of HTTP to a GET without more than its Host.
std::string get(int port, const std::string& path) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const std::string request = "GET " + path +
                              " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
                              "\r\nConnection: close\r\n\r\n";
  std::string answer;
  if (::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0 &&
      ::send(fd, request.data(), request.size(), MSG_NOSIGNAL) ==
          static_cast<ssize_t>(request.size())) {
    std::array<char, 4096> some{};
    for (ssize_t n = 1; n > 0;) {
      n = ::recv(fd, some.data(), some.size(), 0);
      answer.append(some.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0)));
    }
  }
  ::close(fd);
  return answer;
}

class StationCommand : public tests::CommandTest {
 protected:
  std::vector<std::string> arguments(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {"station", "--store", path("s.db"), "--state", path("state"),
                                    "--files", path("."), "--station",  "bench-1"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  tests::Answer refused(const std::vector<std::string>& more) { return run(arguments(more)); }
  // "http://127.0.0.1:PORT/..."
  static int port_of(const std::string& address) {
    const std::string_view before = "http://127.0.0.1:";
    return address.starts_with(before) ? std::atoi(address.c_str() + before.size()) : 0;
  }
};

// Refused before anything is opened: 64 is usage, 66 a file that is not there.
TEST_F(StationCommand, RefusesWhatItCannotServe) {
  const std::vector<std::string> unit = {"--device", "virtual:seed=7"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), unit.begin(), unit.end());
    return refused(more);
  };
  EXPECT_EQ(refused({}).exit_code, 64) << "no unit";
  EXPECT_EQ(with({"--port", "65536"}).exit_code, 64);
  EXPECT_EQ(with({"--side-seconds", "9"}).exit_code, 64);
  EXPECT_EQ(with({"--limits", path("none.toml")}).exit_code, 66);
  EXPECT_EQ(with({"--gravity", "98"}).exit_code, 64) << "no place on Earth";
  std::vector<std::string> seventeen;
  for (int i = 0; i < 17; ++i) {
    seventeen.insert(seventeen.end(), {"--device", "virtual:seed=" + std::to_string(i)});
  }
  const auto too_many = refused(seventeen);
  EXPECT_EQ(too_many.exit_code, 64);
  EXPECT_THAT(too_many.people, HasSubstr("16"));
}

// "--bind: another address needs --token", of eight characters and more that an address may hold.
TEST_F(StationCommand, OnOtherAddressesItNeedsAToken) {
  const auto bound = [&](const std::string& address, const std::string& token) {
    return refused({"--device", "virtual:seed=7", "--bind", address, "--token", token});
  };
  const auto none = refused({"--device", "virtual:seed=7", "--bind", "0.0.0.0"});
  EXPECT_EQ(none.exit_code, 64);
  EXPECT_THAT(none.people, HasSubstr("--token"));
  EXPECT_EQ(bound("0.0.0.0", "seven77").exit_code, 64);
  for (const char* token : {"with a blank", "a/slash/in/it", "quote\"quote"}) {
    EXPECT_EQ(bound("0.0.0.0", token).exit_code, 64) << token;
    EXPECT_EQ(bound("127.0.0.1", token).exit_code, 64) << token;
  }
}

// Its one line is the address of the page; it serves there until a signal, and ends with 3 by
// Ctrl-C, with 0 by the one of a supervisor.
TEST_F(StationCommand, ServesItsPageUntilItIsStopped) {
  for (const int signal : {SIGINT, SIGTERM}) {
    Child station(arguments({"--port", "0", "--device", "virtual:seed=7"}));
    const std::string address = station.line();
    ASSERT_THAT(address, StartsWith("http://127.0.0.1:"));
    EXPECT_EQ(address.back(), '/');
    const int port = port_of(address);
    const std::string page = get(port, "/");
    EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
    EXPECT_THAT(page, HasSubstr("text/html"));
    EXPECT_THAT(get(port, "/no-such-page"), StartsWith("HTTP/1.1 404"));
    EXPECT_EQ(station.stop(signal), signal == SIGINT ? 3 : 0);
    EXPECT_EQ(get(port, "/"), "") << "nobody listens any more";
  }
}

// Without the token only what tells a person to give it; the address that is printed has it.
TEST_F(StationCommand, ATokenIsAskedForAndPrinted) {
  Child station(
      arguments({"--port", "0", "--device", "virtual:seed=7", "--token", "0123456789abcdef"}));
  const std::string address = station.line();
  EXPECT_THAT(address, testing::EndsWith("/?token=0123456789abcdef"));
  const int port = port_of(address);
  EXPECT_THAT(get(port, "/api/lanes"), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(get(port, "/?token=0123456789abcdee"), testing::Not(StartsWith("HTTP/1.1 200")));
  EXPECT_THAT(get(port, "/?token=0123456789abcdef"), HasSubstr("Set-Cookie"));
}

}  // namespace
}  // namespace sixpoint::cli

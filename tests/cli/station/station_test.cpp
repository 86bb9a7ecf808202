// sixpoint station by its contract (docs/station.md); tests/station/page has the page itself.
#include <filesystem>
#include <fstream>
#include <thread>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include "cli/command_fixture.h"
#include "cli/run_child.h"
#include "http_request.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using tests::Child;

// The whole answer of HTTP to a request with its Host and these lines.
std::string get(int port, const std::string& path, const std::string& more_head = {},
                const std::string& method = "GET") {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const std::string request = method + " " + path +
                              " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
                              "\r\nConnection: close\r\n" + more_head + "\r\n";
  return tests::answer_to(address, request);
}

// Accepts and never answers.
class SilentServer {
 public:
  SilentServer() : listener_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(listener_, 16), 0);
    EXPECT_EQ(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~SilentServer() { ::close(listener_); }
  SilentServer(const SilentServer&) = delete;
  SilentServer& operator=(const SilentServer&) = delete;
  int listener() const { return listener_; }
  std::string store() const {
    return "postgresql://reader@127.0.0.1:" + std::to_string(port_) + "/none?sslmode=disable";
  }
  // Somebody has connected, or does so within ten seconds.
  bool is_asked() const {
    pollfd waiting{listener_, POLLIN, 0};
    return ::poll(&waiting, 1, 10'000) == 1;
  }
  // That nobody has accepted yet.
  int connections() const {
    pollfd waiting{listener_, POLLIN, 0};
    int number = 0;
    while (::poll(&waiting, 1, 0) == 1) {
      ::close(::accept(listener_, nullptr, nullptr));
      ++number;
    }
    return number;
  }

 private:
  int listener_;
  int port_ = 0;
};

class StationCommand : public tests::CommandTest {
 protected:
  std::vector<std::string> arguments(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {"station", "--store", path("s.db"), "--state", path("state"),
                                    "--files", path("."), "--station",  "bench-1"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  tests::Answer refused(const std::vector<std::string>& more) { return run(arguments(more)); }
  // The lines of a request that has the station's token.
  std::string head() const {
    std::ifstream in(path("state/token"));
    std::string token;
    std::getline(in, token);
    return "Authorization: Bearer " + token + "\r\n";
  }
  nlohmann::json lane(int port) const {
    const std::string answer = get(port, "/api/lanes/1", head());
    return nlohmann::json::parse(answer.substr(answer.find("\r\n\r\n") + 4), nullptr, false);
  }
  void wait_until_idle(int port) const {
    for (int i = 0; i < 600 && lane(port).value("state", "") != "idle"; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }
  // Of a run of a unit that the jig turns.
  nlohmann::json measured(int port) const {
    EXPECT_THAT(get(port, "/api/run", head(), "POST"), StartsWith("HTTP/1.1 202"));
    nlohmann::json result;
    for (int i = 0; i < 600 && !(result = lane(port)["result"]).is_object(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return result;
  }
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
  for (const char* option : {"--station", "--jig-id"}) {
    for (const std::string& name : {std::string("bench \xff"), std::string(201, 'x')}) {
      const auto answer = run({"station", "--store", path("s.db"), "--state", path("state"),
                               "--device", "virtual:seed=7", option, name});
      EXPECT_EQ(answer.exit_code, 64) << option;
      EXPECT_THAT(answer.people, HasSubstr("cannot be stored as a text"));
    }
  }
  EXPECT_EQ(with({"--limits", path("none.toml")}).exit_code, 66);
  EXPECT_EQ(with({"--gravity", "98"}).exit_code, 64) << "no place on Earth";
  for (const char* device :
       {"nonsense", "serial:1", "virtual:foo=1", "virtual:seed=-1", "replay:a.zip,match=so"}) {
    EXPECT_EQ(with({"--device", device}).exit_code, 64) << device;
  }
  // Two lanes would take the unit from each other.
  EXPECT_THAT(with({"--device", "virtual:seed=7", "--device", "virtual:seed=7"}).people,
              HasSubstr("name each device once"));
  EXPECT_FALSE(std::filesystem::exists(path("state"))) << "nothing is made before";
  std::vector<std::string> seventeen;
  for (int i = 0; i < 17; ++i) {
    seventeen.insert(seventeen.end(), {"--device", "virtual:seed=" + std::to_string(i)});
  }
  const auto too_many = refused(seventeen);
  EXPECT_EQ(too_many.exit_code, 64);
  EXPECT_THAT(too_many.people, HasSubstr("16"));
}

// Another address needs TLS; a token on the command line is in the list of processes.
TEST_F(StationCommand, OnOtherAddressesItNeedsTls) {
  const std::vector<std::string> unit = {"--device", "virtual:seed=7"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), unit.begin(), unit.end());
    return refused(more);
  };
  const auto plain = with({"--bind", "0.0.0.0"});
  EXPECT_EQ(plain.exit_code, 64);
  EXPECT_THAT(plain.people, HasSubstr("--tls-cert"));
  EXPECT_EQ(with({"--bind", "0.0.0.0", "--tls-cert", path("c.pem")}).exit_code, 64) << "no key";
  EXPECT_EQ(with({"--tls-cert", path("none.pem"), "--tls-key", path("none.pem")}).exit_code, 66);
  const auto token = with({"--token", "0123456789abcdef"});
  EXPECT_EQ(token.exit_code, 64);
  EXPECT_THAT(token.people, HasSubstr("--token-file"));
  std::ofstream(path("token")) << "short";
  EXPECT_EQ(with({"--token-file", path("token")}).exit_code, 65);
}

TEST_F(StationCommand, APrinterThatIsNoneIsRefused) {
  std::ofstream(path("file")) << "content";
  for (const std::string& printer :
       {std::string("lp0"), std::string("http://printer:9100"), std::string("tcp://printer"),
        std::string("tcp://ada@printer:9100"), path("file"), path("."),
        std::string("/dev/../tmp")}) {
    EXPECT_EQ(refused({"--device", "virtual:seed=7", "--printer", printer}).exit_code, 64)
        << printer;
  }
  EXPECT_FALSE(std::filesystem::exists(path("state/labels")));
}

// Its one line is the address of the page; it serves there until a signal, and ends with 3 by
// Ctrl-C, with 0 by the one of a supervisor.
TEST_F(StationCommand, ServesItsPageUntilItIsStopped) {
  for (const int signal : {SIGINT, SIGTERM}) {
    Child station(arguments({"--port", "0", "--device", "virtual:seed=7"}));
    const std::string address = station.line();
    ASSERT_THAT(address, StartsWith("http://127.0.0.1:"));
    const int port = port_of(address);
    const std::string page = get(port, "/");
    EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
    EXPECT_THAT(page, HasSubstr("text/html"));
    EXPECT_THAT(get(port, "/no-such-page"), StartsWith("HTTP/1.1 401")) << "no session";
    EXPECT_THAT(get(port, "/", "Host: elsewhere\r\n"), StartsWith("HTTP/1.1 400"));
    EXPECT_EQ(station.stop(signal), signal == SIGINT ? 3 : 0);
    EXPECT_EQ(get(port, "/"), "") << "no one listens any more";
  }
}

bool machine_has_ipv6() {
  const int socket = ::socket(AF_INET6, SOCK_STREAM, 0);
  sockaddr_in6 address{};
  address.sin6_family = AF_INET6;
  address.sin6_addr = in6addr_loopback;
  const bool has = socket >= 0 &&
                   ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(socket);
  return has;
}

// Oracle: the address of Python's client. RFC 3986 puts an IPv6 address into brackets. A machine
// without IPv6 has no such address, and the station says so.
TEST_F(StationCommand, AnIpv6AddressCanBeOpenedAsItIsPrinted) {
  Child station(arguments({"--port", "0", "--bind", "::1", "--device", "virtual:seed=7"}));
  const std::string address = station.line();
  if (!machine_has_ipv6()) {
    EXPECT_EQ(address, "");
    EXPECT_NE(station.wait(), 0);
    return;
  }
  ASSERT_THAT(address, StartsWith("http://[::1]:"));
  const std::string fetch =
      "python3 -c 'import sys, urllib.request; "
      "sys.exit(urllib.request.build_opener(urllib.request.ProxyHandler({})).open(\"" +
      address.substr(0, address.find('#')) + "\").status != 200)'";
  EXPECT_EQ(std::system(fetch.c_str()), 0);
}

// Oracle: the TLS of Python, which checks the certificate and the name. Plain HTTP is not answered.
TEST_F(StationCommand, ServesHttps) {
  const auto command = [](const std::string& line) { return std::system(line.c_str()); };
  ASSERT_EQ(command("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes "
                    "-days 2 -subj /CN=bench -addext subjectAltName=IP:127.0.0.1 -keyout " +
                    path("key.pem") + " -out " + path("cert.pem") + " 2>/dev/null"),
            0);
  Child station(arguments({"--port", "0", "--device", "virtual:seed=7", "--tls-cert",
                           path("cert.pem"), "--tls-key", path("key.pem")}));
  const std::string address = station.line();
  ASSERT_THAT(address, StartsWith("https://127.0.0.1:"));
  const std::string page = address.substr(0, address.find('#'));
  const auto fetched = [&](const std::string& trusted) {
    return command(
        "python3 -c 'import ssl, sys, urllib.request; "
        "sys.exit(urllib.request.urlopen(\"" +
        page + "\", context=ssl.create_default_context(" + trusted +
        ")).status != 200)' 2>/dev/null");
  };
  EXPECT_EQ(fetched("cafile=\"" + path("cert.pem") + "\""), 0);
  EXPECT_NE(fetched(""), 0) << "one that no list of trusted certificates has";
  EXPECT_THAT(get(std::atoi(page.c_str() + std::string_view("https://127.0.0.1:").size()), "/"),
              testing::Not(HasSubstr("HTTP/1.1 200")));
  std::ofstream(path("other.pem")) << "no key";
  EXPECT_EQ(run({"station", "--store", path("s.db"), "--state", path("other state"), "--device",
                 "virtual:seed=7", "--tls-cert", path("cert.pem"), "--tls-key", path("other.pem")})
                .exit_code,
            65);
}

// Two would go on with the same runs and print the same labels.
TEST_F(StationCommand, OneStationAtATimeInAStateFolder) {
  const std::vector<std::string> words = arguments({"--port", "0", "--device", "virtual:seed=7"});
  {
    Child first(words);
    ASSERT_THAT(first.line(), StartsWith("http://"));
    Child second(words);
    EXPECT_EQ(second.wait(), 73);
    const auto refused = run(words);
    EXPECT_EQ(refused.exit_code, 73);
    EXPECT_THAT(refused.people, HasSubstr("another station is running"));
    EXPECT_THAT(refused.people, HasSubstr("--state"));
    EXPECT_EQ(first.stop(SIGKILL), -1);
  }
  Child next(words);
  EXPECT_THAT(next.line(), StartsWith("http://")) << "a killed one holds nothing";
}

// 0.0.0.0 opens nothing on another machine: the address has the name of the certificate, and the
// station answers to it. Oracle: as above.
TEST_F(StationCommand, OnAllAddressesItIsOpenedByTheNameInItsCertificate) {
  const auto command = [](const std::string& line) { return std::system(line.c_str()); };
  ASSERT_EQ(command("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes "
                    "-days 2 -subj /CN=other -addext "
                    "'subjectAltName=DNS:*.example,IP:127.0.0.1,DNS:Bench-3' -keyout " +
                    path("key.pem") + " -out " + path("cert.pem") + " 2>/dev/null"),
            0);
  Child station(arguments({"--port", "0", "--device", "virtual:seed=7", "--bind", "0.0.0.0",
                           "--tls-cert", path("cert.pem"), "--tls-key", path("key.pem")}));
  const std::string address = station.line();
  const std::string_view before = "https://bench-3:";
  ASSERT_THAT(address, StartsWith(std::string(before)));
  const std::string port = std::to_string(std::atoi(address.c_str() + before.size()));
  const auto answers_to = [&](const std::string& name) {
    return command(
               "python3 -c 'import ssl, sys, urllib.request as u; sys.exit(u.urlopen(u.Request("
               "\"https://127.0.0.1:" +
               port + "/\", headers={\"Host\": \"" + name + ":" + port +
               "\"}), context=ssl.create_default_context(cafile=\"" + path("cert.pem") +
               "\")).status != 200)' 2>/dev/null") == 0;
  };
  EXPECT_TRUE(answers_to("bench-3"));
  EXPECT_TRUE(answers_to("127.0.0.1"));
  EXPECT_FALSE(answers_to("other")) << "the subject is no name";
  EXPECT_FALSE(answers_to("evil.example")) << "names with a * are other machines' too";
  EXPECT_FALSE(answers_to("*.example"));
}

// The token is in a file of its owner alone; what is printed is a code for one browser.
TEST_F(StationCommand, TheTokenIsInAFileAndACodeIsPrinted) {
  const auto text_of = [](const std::string& file) {
    std::ifstream in(file);
    std::string line;
    std::getline(in, line);
    return line;
  };
  std::string token;
  {
    Child station(arguments({"--port", "0", "--device", "virtual:seed=7"}));
    const std::string address = station.line();
    EXPECT_THAT(address, testing::MatchesRegex("http://127.0.0.1:[0-9]+/#code=.{14}"));
    token = text_of(path("state/token"));
    EXPECT_EQ(token.size(), 32U);
    EXPECT_THAT(address, testing::Not(HasSubstr(token)));
    EXPECT_EQ(std::filesystem::status(path("state/token")).permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    const int port = port_of(address);
    EXPECT_THAT(get(port, "/api/state"), StartsWith("HTTP/1.1 401"));
    EXPECT_THAT(get(port, "/api/state", "Authorization: Bearer " + token + "\r\n"),
                StartsWith("HTTP/1.1 200"));
  }
  Child again(arguments({"--port", "0", "--device", "virtual:seed=7"}));
  const int port = port_of(again.line());
  EXPECT_THAT(get(port, "/api/state", "Authorization: Bearer " + token + "\r\n"),
              StartsWith("HTTP/1.1 200"))
      << "the token stays";
}

// PINs are read from standard input: an argument is in the list of processes.
TEST_F(StationCommand, OperatorsAreNamedWithAPin) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  const auto with_pin = [&](const std::string& pin, const std::vector<std::string>& words) {
    return tests::run_command(posix_env(), words, pin + "\n");
  };
  EXPECT_THAT(run({"operator", "list"}).out, HasSubstr("none"));
  EXPECT_EQ(with_pin("471100", {"operator", "add", "Ada"}).exit_code, 0);
  EXPECT_EQ(with_pin("081500", {"operator", "add", "Eve", "--role", "engineer"}).exit_code, 0);
  EXPECT_EQ(with_pin("12", {"operator", "add", "Bo"}).exit_code, 64);
  EXPECT_EQ(with_pin("1234", {"operator", "add", "Bo", "--role", "boss"}).exit_code, 64);
  EXPECT_EQ(run({"operator", "list"}).out, "Ada: technician\nEve: engineer\n");
  const std::vector<std::string> sign = {"station-lock", "sign",       "--reason",  "cleaned",
                                         "--store",      path("o.db"), "--operator"};
  const auto signed_by = [&](const std::string& name, const std::string& pin) {
    auto words = sign;
    words.push_back(name);
    return with_pin(pin, words).exit_code;
  };
  EXPECT_EQ(signed_by("Ada", "471100"), 77) << "a technician";
  EXPECT_EQ(signed_by("Eve", "471100"), 77) << "not Eve's PIN";
  EXPECT_EQ(signed_by("Eve", "081500"), 0);
  EXPECT_EQ(run({"operator", "disable", "Ada"}).exit_code, 0);
  EXPECT_EQ(run({"operator", "disable", "Ada"}).exit_code, 66);
  ::unsetenv("XDG_DATA_HOME");
}

// A store that accepts and never answers holds a thread of the station for ten seconds; the station
// ends without it, and says so.
TEST_F(StationCommand, EndsInTimeWhateverItsThreadsWaitFor) {
  const SilentServer server;
  // The first question, before the page is served, is refused at once.
  std::jthread refuser([&] { ::close(::accept(server.listener(), nullptr, nullptr)); });
  testing::internal::CaptureStderr();
  Child station({"station", "--port", "0", "--device", "virtual:seed=7", "--state", path("state"),
                 "--files", path("."), "--store", server.store()});
  ASSERT_THAT(station.line(), StartsWith("http://"));
  EXPECT_TRUE(server.is_asked());
  EXPECT_EQ(station.stop(SIGTERM), 0);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("ended while a lane was at work"));
}

// Each question would wait for the server's time-out, and hold up lanes and page.
TEST_F(StationCommand, AStoreThatDoesNotAnswerIsNotAskedAtEachQuestion) {
  const SilentServer server;
  Child station({"station", "--port", "0", "--device", "virtual:seed=7", "--state", path("state"),
                 "--files", path("."), "--store", server.store() + "&connect_timeout=2"});
  const int port = port_of(station.line());
  for (int i = 0; i < 3; ++i) {
    EXPECT_THAT(get(port, "/api/check-units", head()), HasSubstr("postgresql://reader@127.0.0.1"));
  }
  EXPECT_EQ(station.stop(SIGTERM), 0);
  EXPECT_EQ(server.connections(), 1) << "before the page was served";
}

// The jig's due date holds on the page as in the terminal. Oracle: the answer of the lane.
TEST_F(StationCommand, AnOverdueJigMeasuresNothingOnThePageEither) {
  const auto result_with = [&](const std::vector<std::string>& more) {
    auto words = arguments({"--port", "0", "--device", "virtual:seed=7,jig=auto"});
    words.insert(words.end(), more.begin(), more.end());
    Child station(words);
    const int port = port_of(station.line());
    wait_until_idle(port);
    const std::string state = get(port, "/api/state", head());
    EXPECT_THAT(state, HasSubstr("\"jig_due\":\"2001-01-01"));
    EXPECT_THAT(state, HasSubstr("\"jig_over\":true"));
    EXPECT_THAT(state,
                HasSubstr(more.size() > 2 ? "{\"reason\":\"lab closed\",\"signed_by\":\"Eve\"}"
                                          : "\"jig_exception\":null"));
    return measured(port);
  };
  const auto overdue = result_with({"--jig-due", "2001-01-01"});
  EXPECT_EQ(overdue["verdict"], "refused") << overdue;
  const auto signed_for = result_with(
      {"--jig-due", "2001-01-01", "--jig-exception", "lab closed", "--jig-exception-by", "Eve"});
  EXPECT_EQ(signed_for["verdict"], "pass") << signed_for;
  EXPECT_EQ(refused({"--device", "virtual:seed=7", "--jig-due", "soon"}).exit_code, 64);
  EXPECT_EQ(refused({"--device", "virtual:seed=7", "--jig-due", "2999-01-01", "--jig-exception",
                     "lab closed"})
                .exit_code,
            64)
      << "who signs? Before the day, too";
}

// As where the disk of the store is away: no new store takes its place. The run is in the journal, and
// the page says so: no reason for the station to end with an error. Its constants are written while
// the journal has them.
TEST_F(StationCommand, ARunInTheJournalDoesNotChangeHowItEnds) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  Child station(arguments({"--port", "0", "--device", "virtual:seed=7,jig=auto"}));
  const int port = port_of(station.line());
  wait_until_idle(port);
  for (const char* ending : {"", "-wal", "-shm"}) {
    std::filesystem::remove(path("s.db") + ending);
  }
  nlohmann::json result = measured(port);
  EXPECT_EQ(result["verdict"], "pass") << result;
  for (int i = 0; i < 600 && !result.contains("kept_here"); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    result = lane(port)["result"];
  }
  EXPECT_EQ(result.value("kept_here", false), true) << result;
  // As where another program gave the journal to the store, and the store is away again: there they
  // may have been withdrawn.
  const auto write_now = [&](const std::string& verdict, bool written) {
    const std::string body = R"({"last_run":true})";
    const std::string more =
        head() + "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
    EXPECT_THAT(get(port, "/api/run", more, "POST"), StartsWith("HTTP/1.1 202"));
    const auto is_done = [&] {
      result = lane(port)["result"];
      return result.is_object() && result["verdict"] == verdict &&
             result.value("written", false) == written;
    };
    for (int i = 0; i < 600 && !is_done(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    EXPECT_EQ(result["verdict"], verdict) << result;
  };
  std::filesystem::rename(path("data/sixpoint/journal"), path("given"));
  write_now("refused", false);
  EXPECT_THAT(result["reasons"].dump(), HasSubstr("there is no store"));
  EXPECT_EQ(result.value("can_write", false), true) << "they wait on";
  std::filesystem::rename(path("given"), path("data/sixpoint/journal"));
  write_now("pass", true);
  EXPECT_EQ(station.stop(SIGTERM), 0);
  EXPECT_FALSE(std::filesystem::exists(path("s.db")));
  ::unsetenv("XDG_DATA_HOME");
}

// Not into a last resort in the temporary folder, which ends with the service.
TEST_F(StationCommand, ARunThatNeitherStoreNorJournalTakesWaitsInTheStateFolder) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  std::ofstream(path("s.db")) << std::string(2000, 'x');  // no store
  std::filesystem::create_directories(path("data/sixpoint"));
  std::ofstream(path("data/sixpoint/journal")) << "in the way of the journal";
  Child station(arguments({"--port", "0", "--device", "virtual:seed=7,jig=auto"}));
  const int port = port_of(station.line());
  wait_until_idle(port);
  nlohmann::json result = measured(port);
  const auto wait_for = [&](const char* key) {
    for (int i = 0; i < 600 && !result.contains(key); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      result = lane(port)["result"];
    }
  };
  wait_for("problem");
  EXPECT_THAT(result.value("problem", ""), HasSubstr("not stored yet")) << result;
  EXPECT_FALSE(result.value("kept_here", false)) << result;
  std::filesystem::remove(path("data/sixpoint/journal"));
  wait_for("run");
  EXPECT_TRUE(result.value("kept_here", false)) << result;
  EXPECT_FALSE(std::filesystem::is_empty(path("data/sixpoint/journal")));
  EXPECT_EQ(station.stop(SIGTERM), 0);
  ::unsetenv("XDG_DATA_HOME");
}

}  // namespace
}  // namespace sixpoint::cli

// The server with clients that are slow, many, or send nothing.
#include "station/page/server.h"

#include <Eigen/Core>  // before httplib.h, whose macro _res is a name in Eigen
#include <array>
#include <filesystem>
#include <fstream>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "http_request.h"
#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

// The status line of the answer to these bytes.
std::string answer_to(const Station& station, const std::string& bytes) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(station.server->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const std::string answer = tests::answer_to(address, bytes, "\r\n");
  return answer.substr(0, answer.find("\r\n"));
}

// `curl -X POST` sends neither a body nor its length; all that a run takes is optional.
TEST(Server, ARequestWithoutABodyIsAnswered) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  const std::string host = station.head() + "\r\n";
  EXPECT_THAT(answer_to(station, "POST /api/lanes/1/stop HTTP/1.1\r\n" + host), HasSubstr(" 409 "));
  EXPECT_THAT(answer_to(station, "POST /api/run HTTP/1.1\r\n" + host), HasSubstr(" 202 "));
  station.wait_state(1, "running");
}

// 0.0.0.0 opens nothing: an address of this machine stands for it, whatever routes there are.
TEST(Server, AllAddressesArePrintedAsOneOfThem) {
  const tests::TemporaryFolder folder;
  for (const char* bind : {"0.0.0.0", "::"}) {
    ServerOptions options;
    options.bind = bind;
    Station station({"virtual:seed=7"}, folder.path(), 24, {}, options);
    const std::string host = station.server->host();
    EXPECT_THAT(host, testing::AnyOf(testing::MatchesRegex("[0-9]+(\\.[0-9]+){3}"),
                                     testing::StartsWith("[")))
        << bind;
    EXPECT_NE(host, "0.0.0.0");
    EXPECT_NE(host, "[::]");
  }
}

// Refused by what its head announces: no thread and no memory waits for the body.
TEST(Server, ABodyThatIsAnnouncedTooLongIsRefusedFromTheHead) {
  const tests::TemporaryFolder folder;
  ServerOptions options;
  options.request_time_out_s = 600;  // the answer does not come from the time-out
  Station station({"virtual:seed=7"}, folder.path(), 24, {}, options);
  for (int i = 0; i < 40; ++i) {
    EXPECT_THAT(answer_to(station, "POST /api/run HTTP/1.1\r\n" + station.head() +
                                       "Content-Length: 600000\r\n\r\n{"),
                HasSubstr(" 413 "));
  }
}

// Two thousand pages at once: those beyond the limit are refused, and the station goes on.
TEST(Server, AnswersDuringThousandsOfEventStreams) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path(), 4);
  station.wait_state(1, "idle");
  std::vector<int> sockets;
  const std::string request = "GET /api/events HTTP/1.1\r\n" + station.head() + "\r\n";
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(station.server->port()));
  inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
  for (int i = 0; i < 2000; ++i) {
    const int descriptor = socket(AF_INET, SOCK_STREAM, 0);
    if (descriptor < 0) {
      break;  // as many as this process may open
    }
    const timeval patience{10, 0};
    setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
    if (connect(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0) {
      EXPECT_GT(send(descriptor, request.data(), request.size(), MSG_NOSIGNAL), 0);
    }
    sockets.push_back(descriptor);
  }
  EXPECT_GT(sockets.size(), 400U);
  EXPECT_EQ(station.get("/api/state")["schema"], "sixpoint/station/1") << "it answers";
  std::size_t served = 0;
  std::size_t refused = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(sockets.size(), 100); ++i) {
    std::array<char, 64> head{};
    const auto count = recv(sockets[i], head.data(), head.size(), 0);
    const std::string_view text(head.data(), static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    served += text.starts_with("HTTP/1.1 200") ? 1 : 0;
    refused += text.starts_with("HTTP/1.1 503") ? 1 : 0;
  }
  EXPECT_LE(served, 4U);
  EXPECT_GE(refused, 90U);
  for (const int descriptor : sockets) {
    close(descriptor);
  }
  // A page gets a stream again, once the station has noticed that the others have gone.
  for (int i = 0; i < 500; ++i) {
    std::string text;
    station.client().Get("/api/events", [&](const char* data, std::size_t size) {
      text.append(data, size);
      return false;
    });
    if (text.starts_with("event: state")) {
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  ADD_FAILURE() << "no stream after the others had gone";
}

// A defect outside handle(): an event stream asks for the state by itself.
TEST(Server, ADefectInAnEventStreamEndsThatStreamAlone) {
  class DefectiveBench final : public PracticeBench {
   public:
    bool has(const std::string& /*device*/) const override {
      throw std::runtime_error("no such key");
    }
    Status turn(const std::string&, device::Pose, double) override { return {}; }
    Status lean(const std::string&) override { return {}; }
    Status knock(const std::string&) override { return {}; }
    Status set_plugged(const std::string&, bool) override { return {}; }
    Status swap(const std::string&, const std::string&) override { return {}; }
  } bench;
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  Api api({}, ApiParts{posix_env(), *station.lanes, *station.repairs, station.sign_in, &bench});
  const auto server = Server::open(posix_env(), api, {}).value();
  std::thread serving([&] { server->serve(); });
  httplib::Client client("127.0.0.1", server->port());
  client.set_read_timeout(10);
  client.set_default_headers({{"Authorization", std::string("Bearer ") + Station::kToken}});
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(client.Get("/api/events").error(), httplib::Error::Read) << "closed in the middle";
    const auto me = client.Get("/api/me");
    EXPECT_TRUE(me && me->status == 200) << "the others go on";
  }
  server->stop();
  serving.join();
}

// A plain connection to the station; -1 when this process may open no more.
int connect_to(const Station& station, int receive_bytes = 0) {
  const int descriptor = socket(AF_INET, SOCK_STREAM, 0);
  if (descriptor < 0) {
    return -1;
  }
  if (receive_bytes > 0) {
    setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof(receive_bytes));
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(station.server->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) {
    close(descriptor);
    return -1;
  }
  return descriptor;
}

double resident_mb() {
  std::ifstream file("/proc/self/statm");
  double pages = 0;
  file >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// Clients that say nothing, half a line, or half a body, far more of them than there are threads:
// the page's own requests are answered at once, within the client's time-out, and memory stays
// bounded.
TEST(Server, IncompleteRequestsHoldNoThread) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  const double before_mb = resident_mb();
  const std::string host = station.head();
  const std::array<std::string, 4> said = {
      "", "GET /api/st", "GET /api/state HTTP/1.1\r\n" + host,
      "POST /api/run HTTP/1.1\r\n" + host + "Content-Length: 60000\r\n\r\n{\"operator\":"};
  std::vector<int> sockets;
  for (std::size_t i = 0; i < 400; ++i) {
    const int descriptor = connect_to(station);
    if (descriptor < 0) {
      break;
    }
    const std::string& text = said[i % said.size()];
    EXPECT_EQ(send(descriptor, text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
    sockets.push_back(descriptor);
  }
  EXPECT_EQ(sockets.size(), 400U);
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(station.get("/api/state")["schema"], "sixpoint/station/1");
  }
  EXPECT_LT(resident_mb() - before_mb, 64);
  // They are closed when their time is over; what was half said was not done.
  for (const int descriptor : sockets) {
    const timeval patience{60, 0};
    setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    char byte = 0;
    EXPECT_LE(recv(descriptor, &byte, 1, 0), 0) << "closed without an answer";
    close(descriptor);
  }
  EXPECT_EQ(station.lane(1)["state"], "idle");
}

// More idle connections than permitted: the oldest is closed, and the newest gets its answer.
TEST(Server, ClosesTheOldestOfTooManyIdleConnections) {
  const tests::TemporaryFolder folder;
  ServerOptions options;
  options.most_idle = 20;
  options.request_time_out_s = 60;  // none is closed for another reason
  Station station({"virtual:seed=7,pace=20"}, folder.path(), 24, {}, options);
  const int oldest = connect_to(station);
  ASSERT_GE(oldest, 0);
  std::vector<int> others;
  for (int i = 0; i < 30; ++i) {
    others.push_back(connect_to(station));
  }
  EXPECT_EQ(station.get("/api/state")["schema"], "sixpoint/station/1");
  const timeval patience{30, 0};
  setsockopt(oldest, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  char byte = 0;
  EXPECT_EQ(recv(oldest, &byte, 1, 0), 0) << "closed";
  const std::string request =
      "GET /icon.svg HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(station.server->port()) +
      "\r\n\r\n";
  EXPECT_GT(send(others.back(), request.data(), request.size(), MSG_NOSIGNAL), 0);
  std::array<char, 16> head{};
  EXPECT_GT(recv(others.back(), head.data(), head.size(), 0), 0);
  EXPECT_THAT(std::string(head.data(), head.size()), testing::StartsWith("HTTP/1.1 200"));
  for (const int descriptor : others) {
    close(descriptor);
  }
  close(oldest);
}

// Pages that are open and read nothing take every stream; they are closed, and others get one.
TEST(Server, ClosesPagesThatDoNotRead) {
  const tests::TemporaryFolder folder;
  ServerOptions options;
  options.request_time_out_s = 1;
  options.most_unread_bytes = 4096;
  Station station({"virtual:seed=7,pace=100"}, folder.path(), 4, {}, options);
  station.wait_state(1, "idle");
  const std::string request = "GET /api/events HTTP/1.1\r\n" + station.head() + "\r\n";
  const auto streams = [&] {
    int status = 0;
    station.client().Get(
        "/api/events",
        [&](const httplib::Response& response) {
          status = response.status;
          return false;
        },
        [](const char* /*data*/, std::size_t /*size*/) { return false; });
    return status;
  };
  const double before_mb = resident_mb();
  std::vector<int> sockets;
  for (int i = 0; i < 4; ++i) {
    sockets.push_back(connect_to(station, 4096));
    ASSERT_GE(sockets.back(), 0);
    EXPECT_GT(send(sockets.back(), request.data(), request.size(), MSG_NOSIGNAL), 0);
  }
  for (const int descriptor : sockets) {
    std::array<char, 12> head{};
    EXPECT_EQ(recv(descriptor, head.data(), head.size(), MSG_WAITALL), 12);
    EXPECT_EQ(std::string_view(head.data(), head.size()), "HTTP/1.1 200") << "a stream is taken";
  }
  int status = 0;
  for (int i = 0; i < 600 && status != 200; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    status = streams();
  }
  EXPECT_EQ(status, 200) << "and one is free again";
  EXPECT_LT(resident_mb() - before_mb, 64);
  for (const int descriptor : sockets) {
    close(descriptor);
  }
}

// What the station answers to a request over its unix socket, without a session and without the
// token; empty where it cannot be reached.
std::string answer_over(const std::string& socket_path, const std::string& request) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  socket_path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  return tests::answer_to(address, request);
}

const char* const kAskState = "GET /api/state HTTP/1.1\r\nHost: station\r\n\r\n";

TEST(Server, TheOwnerNeedsNoTokenOnTheUnixSocketAndOthersCannotOpenIt) {
  const tests::TemporaryFolder folder;
  const std::string path = folder / "station.sock";
  ServerOptions options;
  options.unix_socket = path;
  {
    Station station({"virtual:seed=7"}, folder.path(), 24, {}, options);
    station.wait_state(1, "idle");
    struct stat info {};
    ASSERT_EQ(::lstat(path.c_str(), &info), 0);
    EXPECT_TRUE(S_ISSOCK(info.st_mode));
    EXPECT_EQ(info.st_mode & 0777U, 0600U);
    EXPECT_EQ(info.st_uid, ::geteuid());
    const std::string state = answer_over(path, kAskState);
    EXPECT_THAT(state, testing::StartsWith("HTTP/1.1 200"));
    EXPECT_THAT(state, HasSubstr("sixpoint/station/1"));
    EXPECT_THAT(answer_over(path,
                            "POST /api/run HTTP/1.1\r\nHost: station\r\nContent-Length: 0"
                            "\r\n\r\n"),
                testing::StartsWith("HTTP/1.1 202"));
    EXPECT_THAT(answer_over(path, "nonsense\r\n\r\n"), testing::StartsWith("HTTP/1.1 400"));
    // The port asks as before.
    auto client = station.client();
    client.set_default_headers({});
    EXPECT_EQ(client.Get("/api/state")->status, 401);
  }
  EXPECT_FALSE(std::filesystem::exists(path)) << "removed at the end";
}

TEST(Server, ASocketReplacesOneThatWasLeftAndNothingElse) {
  const tests::TemporaryFolder folder;
  const std::string path = folder / "station.sock";
  Station first({"virtual:seed=7"}, folder / "one");
  const auto opened = [&](const std::string& socket_path) {
    ServerOptions options;
    options.unix_socket = socket_path;
    return Server::open(posix_env(), *first.api, options);
  };
  std::ofstream(folder / "file") << "content";
  EXPECT_FAILS(opened(folder / "file"), ErrorCode::usage);
  EXPECT_EQ(std::filesystem::file_size(folder / "file"), 7U);
  std::filesystem::create_symlink(folder / "file", folder / "link");
  EXPECT_FAILS(opened(folder / "link"), ErrorCode::usage);
  EXPECT_FAILS(opened(folder / std::string(120, 'a')), ErrorCode::usage);
  EXPECT_FAILS(opened(folder / "none/station.sock"), ErrorCode::cannot_create);

  // A station that was killed: its socket is there, and no one listens.
  const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  ASSERT_EQ(::bind(left, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ::close(left);
  const auto second = opened(path);
  EXPECT_OK(second);
  EXPECT_FAILS(opened(path), ErrorCode::device_unavailable);  // one that is alive
}

}  // namespace
}  // namespace sixpoint::station

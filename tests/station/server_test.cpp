// The station's server by an HTTP client: what it serves, what it refuses, and that runs survive.
#include "station/server.h"

#include <array>
#include <cmath>
#include <fstream>
#include <future>
#include <thread>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <httplib.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <unistd.h>

#include "expect_result.h"
#include "mocks/virtual_bench.h"
#include "station/devices.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using Json = nlohmann::ordered_json;
using testing::Contains;
using testing::HasSubstr;

// A whole station in this process; what it would store is kept here.
class Station {
 public:
  // `its_bench`: one that outlives this program, where the units shall.
  explicit Station(std::vector<std::string> devices, const std::string& folder,
                   std::string token = {}, int most_streams = 24,
                   std::shared_ptr<mocks::VirtualBench> its_bench = {},
                   const ServerOptions& server_options = {})
      : bench_(its_bench ? std::move(its_bench) : std::make_shared<mocks::VirtualBench>()),
        registry_(known_devices()) {
    bench_->register_in(registry_);
    LanesOptions options;
    options.devices = std::move(devices);
    options.state_folder = folder + "/state";
    options.capture_folder = folder;
    options.station = "bench-1";
    options.retry_s = 0.02;
    auto opened = Lanes::open(
        posix_env(), registry_, options,
        [this](const JigReport& report, const RunLabels& labels) -> Result<KeptRun> {
          const std::lock_guard lock(mutex);
          if (store_is_away) {
            return fail(ErrorCode::io, "the disk is full");
          }
          reports.push_back(report);
          operators.push_back(labels.operator_name);
          return KeptRun{"abc123", "def456", ""};
        },
        [](const CaptureReport&) -> Result<std::string> { return std::string("c0ffee"); });
    EXPECT_OK(opened);
    lanes = *std::move(opened);
    repairs = std::make_unique<RepairJob>(
        posix_env(), [folder] { return db::Store::open(posix_env(), folder + "/store.db"); });
    ApiOptions api_options;
    api_options.token = std::move(token);
    api_options.files_folder = folder;
    api_options.most_streams = most_streams;
    api = std::make_unique<Api>(
        api_options,
        ApiParts{posix_env(),
                 *lanes,
                 *repairs,
                 bench_.get(),
                 [](const CaptureReport&) -> Result<std::string> { return std::string("c0ffee"); },
                 {}});
    auto listening = Server::open(posix_env(), *api, server_options);
    EXPECT_OK(listening);
    server = *std::move(listening);
    thread_ = std::thread([this] { server->serve(); });
  }
  ~Station() {
    server->stop();
    thread_.join();
  }
  httplib::Client client() const {
    httplib::Client client("127.0.0.1", server->port());
    client.set_read_timeout(10);
    return client;
  }
  Json get(const std::string& path) const {
    const auto answer = client().Get(path);
    return answer ? Json::parse(answer->body, nullptr, false) : Json();
  }
  int post(const std::string& path, const Json& body, const std::string& who = "me") const {
    const auto answer =
        client().Post(path, {{"X-Sixpoint-Client", who}}, body.dump(), "application/json");
    return answer ? answer->status : 0;
  }
  Json lane(int number) const { return get("/api/lanes/" + std::to_string(number)); }
  // Asks for the lane until `ready` likes it, 30 s at most.
  template <class Ready>
  Json wait(int number, Ready ready) const {
    Json json;
    for (int i = 0; i < 3000; ++i) {
      json = lane(number);
      if (ready(json)) {
        return json;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ADD_FAILURE() << "never came: " << json.dump(1);
    return json;
  }
  Json wait_state(int number, const std::string& state) const {
    return wait(number, [&](const Json& json) { return json["state"] == state; });
  }

  std::mutex mutex;
  std::vector<JigReport> reports;
  std::vector<std::string> operators;
  bool store_is_away = false;

 private:
  std::shared_ptr<mocks::VirtualBench> bench_;
  device::TransportRegistry registry_;  // the lanes' threads use it

 public:
  std::unique_ptr<Lanes> lanes;
  std::unique_ptr<RepairJob> repairs;
  std::unique_ptr<Api> api;
  std::unique_ptr<Server> server;

 private:
  std::thread thread_;
};

// The status line of the answer to these bytes.
std::string answer_to(const Station& station, const std::string& bytes) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(station.server->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string answer;
  if (::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0 &&
      ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size())) {
    std::array<char, 1024> some{};
    for (ssize_t n = 1; n > 0 && answer.find("\r\n") == std::string::npos;) {
      n = ::recv(fd, some.data(), some.size(), 0);
      answer.append(some.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0)));
    }
  }
  ::close(fd);
  return answer.substr(0, answer.find("\r\n"));
}

// What a person does: looks where the unit is wanted, and turns it there.
void serve(const Station& station, int lane, int placements) {
  std::string last;
  for (int done = 0; done < placements;) {
    const Json json = station.wait(lane, [&](const Json& now) {
      return now["state"] == "done" ||
             (now["run"].is_object() && now["run"]["wanted"].is_string() &&
              now["run"]["prompt"] != last);
    });
    if (json["state"] == "done") {
      return;
    }
    last = json["run"]["prompt"].get<std::string>();
    EXPECT_EQ(station.post("/api/lanes/" + std::to_string(lane) + "/hand",
                           {{"do", "turn"}, {"pose", json["run"]["wanted"]}}),
              200);
    ++done;
  }
}

TEST(Server, RunsAJigAndKeepsItWithItsSamples) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/run", {{"lane", 1}, {"operator", "Ada"}}), 202);
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane.dump(1);
  EXPECT_EQ(lane["result"]["run"], "abc123");
  EXPECT_EQ(lane["run"]["taken"].size(), 14U);
  ASSERT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.operators.front(), "Ada");
  EXPECT_THAT(station.reports.front().raw_csv, testing::StartsWith("device_time_us,"));
  EXPECT_EQ(station.reports.front().verification.poses.size(), 8U);
}

TEST(Server, AHandIsToldWhatToDoAndSlipsAreRefusedWithTheReason) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=50"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/run", {{"operator", "Ada"}}), 202);
  const auto hand = [&](const Json& body) { return station.post("/api/lanes/1/hand", body); };
  const auto refusal_of = [&](const std::string& text) {
    station.wait(1, [&](const Json& json) {
      return json["run"].is_object() &&
             json["run"]["last_refusal"].get<std::string>().find(text) != std::string::npos;
    });
  };
  serve(station, 1, 3);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 3; });
  EXPECT_EQ(hand({{"do", "turn"}, {"pose", "+z"}}), 200);
  refusal_of("+z is done already");
  EXPECT_EQ(hand({{"do", "lean"}}), 200);
  refusal_of("lies on none of its six faces");
  EXPECT_EQ(hand({{"do", "turn"}, {"pose", "-x"}, {"tilt_deg", 7.2}}), 200);
  refusal_of("tilted");
  // Undo, and the pose is wanted again.
  EXPECT_EQ(station.post("/api/lanes/1/undo", Json::object()), 200);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 2; });
  serve(station, 1, 40);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane.dump(1);
}

TEST(Server, AUnitThatIsPulledOutGoesOnAndAnotherIsNoticed) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,pace=50"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/run", Json::object()), 202);
  serve(station, 1, 4);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 4; });
  const auto hand = [&](const Json& body) { return station.post("/api/lanes/1/hand", body); };
  hand({{"do", "unplug"}});
  const auto before = std::chrono::steady_clock::now();
  station.wait_state(1, "unit_away");
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(5));
  hand({{"do", "plug"}});
  station.wait_state(1, "running");
  EXPECT_EQ(station.lane(1)["run"]["taken"].size(), 4U) << "nothing is lost";
  // Another unit in its place: nothing of it gets into the run.
  hand({{"do", "swap"}, {"serial", "MOS2A45139999"}});
  const Json wrong = station.wait_state(1, "wrong_unit");
  EXPECT_THAT(wrong["message"].get<std::string>(), HasSubstr("MOS2A45139999"));
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["serial"], "MOS2A45130007");
  EXPECT_EQ(lane["result"]["verdict"], "stopped");
}

TEST(Server, ARunSurvivesTheProgram) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,pace=50";
  std::size_t rows = 0;
  {
    Station station({device}, folder.path());
    station.wait_state(1, "idle");
    ASSERT_EQ(station.post("/api/run", {{"operator", "Ada"}}), 202);
    serve(station, 1, 7);
    station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 7; });
    EXPECT_TRUE(station.reports.empty());
  }
  {
    Station station({device}, folder.path());
    const Json lane = station.wait_state(1, "running");
    EXPECT_EQ(lane["operator"], "Ada");
    station.wait(1, [](const Json& json) {
      return json["run"].is_object() && json["run"]["taken"].size() == 7;
    });
    serve(station, 1, 20);
    const Json done = station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"]["stored"] == true;
    });
    EXPECT_EQ(done["result"]["verdict"], "pass") << done.dump(1);
    ASSERT_EQ(station.reports.size(), 1U);
    const std::string& raw = station.reports.front().raw_csv;
    rows = static_cast<std::size_t>(std::count(raw.begin(), raw.end(), '\n'));
    EXPECT_GT(rows, 14U * 600U) << "the samples of both programs";
    EXPECT_EQ(raw.find("device_time_us", 1), std::string::npos) << "one headline";
  }
  Station station({device}, folder.path());
  station.wait_state(1, "idle");  // nothing is left to go on with
}

TEST(Server, AnInterruptedRunWhoseUnitIsGoneIsClosedWithItsData) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,pace=50";
  {
    Station station({device}, folder.path());
    station.wait_state(1, "idle");
    ASSERT_EQ(station.post("/api/run", Json::object()), 202);
    serve(station, 1, 2);
    station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 2; });
    station.post("/api/lanes/1/hand", {{"do", "unplug"}});
    station.wait_state(1, "unit_away");
  }
  // The same lane, another unit at its address.
  Station station({device}, folder.path());
  station.wait_state(1, "running");
  station.post("/api/lanes/1/hand", {{"do", "unplug"}});
  station.wait_state(1, "unit_away");
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  ASSERT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.reports.front().faces.size(), 2U);
  EXPECT_GT(station.reports.front().raw_csv.size(), 20'000U);
}

TEST(Server, AStoreThatIsAwayIsTriedAgain) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.store_is_away = true;
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/run", Json::object()), 202);
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"].contains("problem");
  });
  EXPECT_EQ(lane["result"]["verdict"], "pass");
  EXPECT_EQ(lane["result"]["stored"], false);
  {
    const std::lock_guard lock(station.mutex);
    station.store_is_away = false;
  }
  station.wait(1, [](const Json& json) { return json["result"]["stored"] == true; });
  EXPECT_EQ(station.reports.size(), 1U);
}

TEST(Server, TwoOperatorsOnOneLane) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/run", {{"operator", "Ada"}}, "page-a"), 202);
  EXPECT_EQ(station.post("/api/run", {{"operator", "Bob"}}, "page-b"), 409);
  station.wait_state(1, "running");
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object(), "page-b"), 409);
  EXPECT_EQ(station.post("/api/lanes/1/take", {{"operator", "Bob"}}, "page-b"), 200);
  EXPECT_EQ(station.post("/api/lanes/1/undo", Json::object(), "page-a"), 409);
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object(), "page-b"), 200);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["operator"], "Bob");
  EXPECT_EQ(lane["result"]["verdict"], "stopped");
}

TEST(Server, TheScannedSerialMustBeTheUnitsOwn) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:serial=MOS2A45130007", "virtual:serial=MOS2A45130008"}, folder.path());
  station.wait_state(1, "idle");
  station.wait_state(2, "idle");
  EXPECT_EQ(station.post("/api/scan", {{"serial", "MOS2A45130008"}}), 200);
  EXPECT_EQ(station.lane(2)["scan"]["matches"], true);
  EXPECT_EQ(station.post("/api/scan", {{"serial", "MOS2A00000000"}}), 409);
  EXPECT_EQ(station.post("/api/lanes/1/scan", {{"serial", "MOS2A45130008"}}), 409);
  EXPECT_EQ(station.lane(1)["scan"]["matches"], false);
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}), 409) << "the label is another unit's";
  EXPECT_EQ(station.post("/api/lanes/1/scan", {{"serial", "MOS2A45130007"}}), 200);
}

TEST(Server, NonsenseIsRefused) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  auto client = station.client();
  const auto post = [&](const std::string& path, const std::string& body) {
    const auto answer = client.Post(path, body, "application/json");
    return answer ? answer->status : 0;
  };
  EXPECT_EQ(post("/api/run", "{"), 400);
  EXPECT_EQ(post("/api/run", "[]"), 400);
  EXPECT_EQ(post("/api/run", R"({"lane": "one"})"), 400);
  EXPECT_EQ(post("/api/run", R"({"lane": -1})"), 400);
  EXPECT_EQ(post("/api/run", R"({"lane": 99})"), 404);
  EXPECT_EQ(
      post("/api/run", R"({"operator": )" + std::string("\"") + std::string(500, 'x') + "\"}"),
      400);
  EXPECT_EQ(post("/api/run", std::string(40'000, '[')), 400) << "deep";
  EXPECT_EQ(post("/api/run", std::string(1'000'000, ' ')), 413);
  EXPECT_EQ(post("/api/nothing", "{}"), 404);
  EXPECT_EQ(post("/", "{}"), 404);
  EXPECT_EQ(client.Get("/api/nothing")->status, 404);
  EXPECT_EQ(client.Get("/api/lanes/0")->status, 404);
  EXPECT_EQ(client.Get("/api/lanes/1x")->status, 404);
  EXPECT_EQ(client.Get("/../../etc/passwd")->status, 404);
  EXPECT_EQ(client.Get("/" + std::string(7000, 'a'))->status, 404);
  EXPECT_EQ(client.Delete("/api/run")->status, 405);
  EXPECT_EQ(client.Get("/api/files?path=../..")->status, 403);
  EXPECT_EQ(client.Get("/api/files?path=%2Fetc")->status, 403);
  EXPECT_EQ(client.Get("/api/files?path=nowhere")->status, 404);
  EXPECT_EQ(post("/api/check", R"({"file": "../x.gt3x"})"), 403);
  EXPECT_EQ(post("/api/repair", R"({"folder": "", "output": "../out"})"), 403);
  EXPECT_EQ(post("/api/lanes/1/undo", ""), 409) << "nothing runs";
  // Every answer is JSON with a code, and none may be framed, sniffed or kept.
  const auto answer = client.Get("/api/nothing");
  EXPECT_EQ(Json::parse(answer->body)["error"]["code"], "not_found");
  EXPECT_THAT(answer->get_header_value("Content-Security-Policy"), HasSubstr("default-src 'none'"));
  EXPECT_EQ(answer->get_header_value("Access-Control-Allow-Origin"), "");
  EXPECT_EQ(answer->get_header_value("Cache-Control"), "no-store");
}

// `curl -X POST` sends neither a body nor its length; all that a run takes is optional.
TEST(Server, ARequestWithoutABodyIsAnswered) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  const std::string host = "Host: 127.0.0.1:" + std::to_string(station.server->port()) + "\r\n\r\n";
  EXPECT_THAT(answer_to(station, "POST /api/lanes/1/stop HTTP/1.1\r\n" + host), HasSubstr(" 409 "));
  EXPECT_THAT(answer_to(station, "POST /api/run HTTP/1.1\r\n" + host), HasSubstr(" 202 "));
  station.wait_state(1, "running");
}

TEST(Server, OtherPagesInTheBrowserMayNotCommandIt) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  auto client = station.client();
  const std::string own = "127.0.0.1:" + std::to_string(station.server->port());
  const auto ask = [&](httplib::Headers headers) {
    return client.Post("/api/run", headers, "{}", "text/plain")->status;
  };
  EXPECT_EQ(ask({{"Origin", "http://evil.example"}}), 403);
  EXPECT_EQ(ask({{"Origin", "null"}}), 403);
  EXPECT_EQ(ask({{"Origin", "https://" + own}}), 403) << "the scheme is part of it";
  EXPECT_EQ(ask({{"Sec-Fetch-Site", "cross-site"}}), 403);
  EXPECT_EQ(ask({{"Sec-Fetch-Site", "same-site"}}), 403) << "another port of this machine";
  // DNS rebinding: the browser believes that it talks to evil.example.
  EXPECT_EQ(ask({{"Host", "evil.example:" + std::to_string(station.server->port())}}), 421);
  EXPECT_EQ(ask({{"Host", "127.0.0.1.evil.example"}}), 421);
  EXPECT_EQ(client.Get("/api/state", {{"Host", "evil.example"}})->status, 421);
  EXPECT_EQ(station.lane(1)["state"], "idle") << "none of them started anything";
  EXPECT_EQ(ask({{"Origin", "http://" + own}, {"Sec-Fetch-Site", "same-origin"}}), 202);
}

TEST(Server, ATokenIsWantedEverywhere) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path(), "correct-horse");
  auto client = station.client();
  EXPECT_EQ(client.Get("/")->status, 401);
  EXPECT_EQ(client.Get("/api/state")->status, 401);
  EXPECT_EQ(client.Get("/api/events")->status, 401);
  EXPECT_EQ(client.Get("/?token=wrong")->status, 401);
  EXPECT_EQ(client.Get("/api/state?token=correct-horse")->status, 401) << "only for the first page";
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "Bearer correct-horse"}})->status, 200);
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "Bearer correct-hors"}})->status, 401);
  const auto first = client.Get("/?token=correct-horse");
  EXPECT_EQ(first->status, 303);
  const std::string cookie = first->get_header_value("Set-Cookie");
  EXPECT_THAT(cookie, HasSubstr("HttpOnly; SameSite=Strict"));
  EXPECT_EQ(client.Get("/", {{"Cookie", cookie.substr(0, cookie.find(';'))}})->status, 200);
  EXPECT_EQ(client.Get("/", {{"Cookie", "a=b; sixpoint_token=x"}})->status, 401);
}

TEST(Server, EventsCarryStateLanesAndReadings) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  std::string text;
  station.client().Get("/api/events", [&](const char* data, std::size_t size) {
    text.append(data, size);
    return text.find("event: live") == std::string::npos || text.size() < 4000;
  });
  EXPECT_THAT(text, testing::StartsWith("event: state\ndata: {\"schema\":\"sixpoint/station/1\""));
  const std::size_t live = text.find("event: live\ndata: ");
  ASSERT_NE(live, std::string::npos);
  const std::size_t begin = live + std::string("event: live\ndata: ").size();
  const Json json = Json::parse(text.substr(begin, text.find('\n', begin) - begin));
  ASSERT_FALSE(json["lanes"].empty());
  EXPECT_EQ(json["lanes"][0]["mg"].size() % 3, 0U);
  EXPECT_EQ(json["lanes"][0]["live"]["face"], "+z");
}

// How far from +z the box on the page stands: the newest reading of lane 1, as the page has it.
double shown_tilt_deg(const Station& station) {
  std::string text;
  Json json;
  station.client().Get("/api/events", [&](const char* data, std::size_t size) {
    text.append(data, size);
    const std::string head = "event: live\ndata: ";
    const std::size_t live = text.find(head);
    const std::size_t end = live == std::string::npos ? live : text.find('\n', live + head.size());
    if (end != std::string::npos) {
      const std::size_t begin = live + head.size();
      json = Json::parse(text.substr(begin, end - begin), nullptr, false);
      text.erase(0, end);
      return json["lanes"].empty() || json["lanes"][0]["mg"].size() < 3;
    }
    return true;
  });
  const auto mg = json["lanes"][0]["mg"].get<std::vector<double>>();
  const double z = mg[mg.size() - 1];
  return std::atan2(std::hypot(mg[mg.size() - 2], mg[mg.size() - 3]), z) * 180 / M_PI;
}

// A unit with constants of the other filter configuration lies right, and its box stood 25 degrees
// askew. Oracle: the virtual unit's true constants, which have it at +z.
TEST(Server, TheLiveBoxGoesByWhatTheRunHasSeenOfAnAffectedUnit) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,positive_lsb=305/302/280,negative_lsb=-205/-208/-228,"
                   "zero_lsb=50/47/26,true_sensitivity_lsb_per_g=237.7/251.8/242.3,"
                   "true_zero_lsb=-30/127/26,pace=20"},
                  folder.path());
  station.wait_state(1, "idle");
  EXPECT_GT(shown_tilt_deg(station), 20) << "by the unit's own constants";
  ASSERT_EQ(station.post("/api/run", Json::object()), 202);
  serve(station, 1, 1);
  station.wait(1, [](const Json& json) {
    return json["run"].is_object() && json["run"]["taken"].size() == 1;
  });
  // It lies where it lay. The reading that was taken may have been the last one shown by the old
  // ones.
  double shown_deg = shown_tilt_deg(station);
  for (int i = 0; i < 500 && shown_deg > 2; ++i) {
    shown_deg = shown_tilt_deg(station);
  }
  EXPECT_LT(shown_deg, 2) << "seating and noise of a single reading";
}

// Two thousand pages at once: those beyond the limit are refused, and the station goes on.
TEST(Server, ThousandsOfEventStreamsDoNotTakeItDown) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path(), "", 4);
  station.wait_state(1, "idle");
  std::vector<int> sockets;
  const std::string request =
      "GET /api/events HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(station.server->port()) +
      "\r\n\r\n";
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
  EXPECT_EQ(station.get("/api/state")["schema"], "sixpoint/station/1") << "it still answers";
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
  // Room again for a page, once the station has seen that they went.
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

// A connection to the station, made by hand; -1 when this process may open no more.
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
TEST(Server, IdleAndHalfSaidRequestsHoldNoThread) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  const double before_mb = resident_mb();
  const std::string host = "Host: 127.0.0.1:" + std::to_string(station.server->port()) + "\r\n";
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

// More than may wait: the oldest goes, and the newest is heard.
TEST(Server, WhenTooManyWaitTheOldestGoes) {
  const tests::TemporaryFolder folder;
  ServerOptions options;
  options.most_waiting = 20;
  options.request_time_out_s = 60;  // nobody goes for another reason
  Station station({"virtual:seed=7,pace=20"}, folder.path(), "", 24, {}, options);
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

// Pages that are open and read nothing take every stream; they are let go of, and others get in.
TEST(Server, PagesThatDoNotReadAreLetGo) {
  const tests::TemporaryFolder folder;
  ServerOptions options;
  options.request_time_out_s = 1;
  Station station({"virtual:seed=7,pace=100"}, folder.path(), "", 4, {}, options);
  station.wait_state(1, "idle");
  const std::string request =
      "GET /api/events HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(station.server->port()) +
      "\r\n\r\n";
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
  for (int i = 0; i < 3000 && status != 200; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    status = streams();
  }
  EXPECT_EQ(status, 200) << "and one is free again";
  EXPECT_LT(resident_mb() - before_mb, 64);
  for (const int descriptor : sockets) {
    close(descriptor);
  }
}

TEST(Server, CapturesACalibrationFileSideBySide) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/capture", {{"lane", 1}}), 202);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["kind"], "capture");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
  EXPECT_EQ(lane["result"]["stored"], true);
  const Json files = station.get("/api/files?path=");
  ASSERT_EQ(files["files"].size(), 1U);
  const std::string name = files["files"][0]["name"];
  const auto answer =
      station.client().Post("/api/check", Json{{"file", name}}.dump(), "text/plain");
  ASSERT_EQ(answer->status, 200) << answer->body;
  const Json check = Json::parse(answer->body);
  EXPECT_EQ(check["usable"], true);
  EXPECT_TRUE(check["repeat_sides"].empty());
}

// A hand that does a capture's bidding, up to and with side `last`. Answers with the sides in the
// order in which they were asked.
std::vector<std::string> serve_capture(const Station& station, std::size_t last) {
  std::vector<std::string> asked;
  for (;;) {
    const Json lane = station.wait(1, [&](const Json& now) {
      return now["state"] == "done" ||
             (now["capture"].is_object() && now["capture"]["side"].is_string() &&
              now["capture"]["placed"] == false);
    });
    if (lane["state"] == "done" || lane["capture"]["number"] > last) {
      return asked;
    }
    asked.push_back(lane["capture"]["side"]);
    EXPECT_EQ(station.post("/api/lanes/1/hand", {{"do", "turn"}, {"pose", asked.back()}}), 200);
    EXPECT_EQ(station.post("/api/lanes/1/placed", Json::object()), 200);
    station.wait(1, [&](const Json& now) {
      return now["state"] != "capturing" || now["capture"]["placed"] == true ||
             now["capture"]["side"] != asked.back();
    });
  }
}

constexpr const char* kCaptured = "virtual:seed=7,serial=MOS2A45130007,pace=100";

TEST(Server, ACaptureSurvivesAReplugAndAsksTheSideUnderWayAgain) {
  const tests::TemporaryFolder folder;
  Station station({kCaptured}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/capture", Json::object()), 202);
  EXPECT_THAT(serve_capture(station, 2), testing::ElementsAre("+z", "-z"));
  const auto hand = [&](const Json& body) { return station.post("/api/lanes/1/hand", body); };
  // Pulled out while it rests on the third side.
  const Json third = station.wait(1, [](const Json& json) {
    return json["capture"].is_object() && json["capture"]["number"] == 3;
  });
  ASSERT_EQ(station.post("/api/lanes/1/placed", Json::object()), 200);
  hand({{"do", "unplug"}});
  const Json away = station.wait_state(1, "unit_away");
  EXPECT_TRUE(away["capture"].is_object()) << "the capture is still there";
  hand({{"do", "plug"}});
  const Json back = station.wait(1, [](const Json& json) {
    return json["state"] == "capturing" && json["capture"]["side"].is_string();
  });
  EXPECT_EQ(back["capture"]["side"], third["capture"]["side"]) << "asked again";
  EXPECT_EQ(back["capture"]["placed"], false);
  // And once more while it waits for a hand: nobody has to press anything to have it noticed.
  hand({{"do", "unplug"}});
  station.wait_state(1, "unit_away");
  hand({{"do", "plug"}});
  station.wait_state(1, "capturing");
  const auto rest = serve_capture(station, 6);
  ASSERT_EQ(rest.size(), 4U) << "the two that were done are not asked again";
  EXPECT_EQ(rest.front(), third["capture"]["side"].get<std::string>());
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
  EXPECT_TRUE(lane["capture"].is_null());
  // The file that was put together from the pieces is a calibration file like any other.
  std::string file = lane["result"]["file"];
  file = file.substr(folder.path().size() + 1);
  const auto answer =
      station.client().Post("/api/check", Json{{"file", file}}.dump(), "application/json");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(Json::parse(answer->body)["usable"], true);
}

TEST(Server, AnotherUnitInACaptureIsNoticedAndNothingIsMixed) {
  const tests::TemporaryFolder folder;
  Station station({kCaptured}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/capture", Json::object()), 202);
  serve_capture(station, 1);
  EXPECT_EQ(station.post("/api/lanes/1/hand", {{"do", "swap"}, {"serial", "MOS2A45139999"}}), 200);
  const Json wrong = station.wait_state(1, "wrong_unit");
  EXPECT_THAT(wrong["message"].get<std::string>(), HasSubstr("MOS2A45139999"));
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "stopped");
  EXPECT_EQ(lane["result"]["serial"], "MOS2A45130007");
}

TEST(Server, ACaptureSurvivesTheProgram) {
  const tests::TemporaryFolder folder;
  const auto bench = std::make_shared<mocks::VirtualBench>();  // the units go on without it
  {
    Station station({kCaptured}, folder.path(), "", 24, bench);
    station.wait_state(1, "idle");
    ASSERT_EQ(station.post("/api/capture", {{"operator", "Ada"}}), 202);
    EXPECT_EQ(serve_capture(station, 3).size(), 3U);
  }
  {
    Station station({kCaptured}, folder.path(), "", 24, bench);
    station.wait(1, [](const Json& json) {
      return json["state"] == "capturing" && json["capture"]["number"] == 4;
    });
    EXPECT_EQ(station.lane(1)["operator"], "Ada");
    EXPECT_EQ(serve_capture(station, 6).size(), 3U) << "the first three are kept";
    const Json lane = station.wait_state(1, "done");
    EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
    EXPECT_EQ(lane["result"]["stored"], true);
  }
  Station station({kCaptured}, folder.path(), "", 24, bench);
  station.wait_state(1, "idle");  // nothing is left to go on with
}

// A unit whose memory was lost meanwhile: it is said, and all sides are asked again.
TEST(Server, ACaptureWhoseRecordingTheUnitLostBeginsAnew) {
  const tests::TemporaryFolder folder;
  {
    Station station({kCaptured}, folder.path());
    station.wait_state(1, "idle");
    ASSERT_EQ(station.post("/api/capture", Json::object()), 202);
    EXPECT_EQ(serve_capture(station, 2).size(), 2U);
  }
  Station station({kCaptured}, folder.path());  // a unit that knows nothing of it
  station.wait_state(1, "capturing");
  EXPECT_EQ(serve_capture(station, 6).size(), 6U);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane["result"].dump(1);
  EXPECT_THAT(lane["result"]["notes"].dump(), HasSubstr("lost its recording; 2 sides are"));
}

TEST(Server, ACaptureOfAUnitThatCannotHelpIsRefused) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto,firmware=1.8.0"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/capture", {{"lane", 1}}), 202);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "refused");
  EXPECT_THAT(lane["result"]["reasons"].dump(), HasSubstr("firmware from 1.4.0 to 1.7.0"));
}

}  // namespace
}  // namespace sixpoint::station

// A whole station in this process, for the tests of lanes and page: virtual units, lanes, Api and
// server. The reports of its runs are in `reports`.
//
//   Station station({"virtual:seed=7,jig=auto"}, folder.path());
//   station.wait_state(1, "idle");
//   station.post("/api/run", {{"lane", 1}});
#pragma once

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <httplib.h>
#include <nlohmann/json.hpp>
#undef _res  // a macro of resolv.h, and the name of a parameter in Eigen

#include "cli/devices/known_devices.h"
#include "cli/station/practice_bench.h"
#include "expect_result.h"
#include "station/page/server.h"
#include "temporary_folder.h"

namespace sixpoint::station {

using Json = nlohmann::ordered_json;

class Station {
 public:
  static constexpr const char* kToken = "0123456789abcdef";

  // `its_bench`: one that outlives this program, where the units shall.
  // `refuses_starts`, `its_constants_are_withdrawn`: starts_refused and is_withdrawn from the first
  // moment on.
  explicit Station(std::vector<std::string> devices, const std::string& folder,
                   int most_streams = 24, std::shared_ptr<mocks::VirtualBench> its_bench = {},
                   const ServerOptions& server_options = {}, bool refuses_starts = false,
                   bool its_constants_are_withdrawn = false)
      : starts_refused(refuses_starts),
        is_withdrawn(its_constants_are_withdrawn),
        bench_(its_bench ? std::move(its_bench) : std::make_shared<mocks::VirtualBench>()),
        registry_(known_devices()),
        operators_(posix_env(), folder + "/operators.json") {
    bench_->register_in(registry_);
    LanesOptions options;
    options.devices = std::move(devices);
    options.state_folder = folder + "/state";
    options.capture_folder = folder;
    options.station = "bench-1";
    options.retry_s = 0.02;
    options.may_start = [this](const std::string&) -> Result<RetestState> {
      if (start_has_defect) {
        throw std::runtime_error("no such key");
      }
      const std::lock_guard lock(start_mutex);
      return starts_refused ? Result<RetestState>(
                                  fail(ErrorCode::configuration, "the jig is overdue", {}, "sign"))
                            : retest;
    };
    options.may_write = [this](const WaitingConstants& waiting) -> Result<std::optional<Error>> {
      const std::lock_guard lock(start_mutex);
      asked_to_write.push_back(waiting.serial + " " + waiting.id);
      if (no_answer) {
        return fail(*no_answer);
      }
      return is_withdrawn ? std::optional(Error{
                                ErrorCode::configuration, "these constants were withdrawn", {}, {}})
                          : std::nullopt;
    };
    const StoreConstants store_constants = [this](const CaptureReport&) {
      const std::lock_guard lock(mutex);
      return KeptConstants{"c0ffee", constants_file_problem, said};
    };
    auto opened = Lanes::open(
        posix_env(), registry_, options,
        [this](const JigReport& report, const RunLabels& labels) -> Result<RunInStore> {
          const std::lock_guard lock(mutex);
          if (store_is_away) {
            return fail(ErrorCode::io, "the disk is full");
          }
          if (has_defect) {
            throw std::runtime_error("no such key");
          }
          if (store_refuses) {
            return fail(ErrorCode::bad_data, "this cannot be stored as a text");
          }
          reports.push_back(report);
          operators.push_back(labels.operator_name);
          authenticated.push_back(labels.is_authenticated);
          kinds.push_back(labels.kind);
          jigs.push_back(labels.jig_id);
          return RunInStore{{"abc123", "def456"}, is_kept_here, {"report.json"}, said};
        },
        store_constants);
    EXPECT_OK(opened);
    lanes = *std::move(opened);
    repairs = std::make_unique<RepairJob>(
        posix_env(), [folder] { return db::Store::open(posix_env(), folder + "/store.db"); });
    ApiOptions api_options;
    api_options.tls = !server_options.tls_certificate.empty();
    api_options.files_folder = folder;
    api_options.most_streams = most_streams;
    api = std::make_unique<Api>(api_options, ApiParts{posix_env(),
                                                      *lanes,
                                                      *repairs,
                                                      sign_in,
                                                      &practice_bench_,
                                                      store_constants,
                                                      {},
                                                      nullptr,
                                                      &operators_});
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
    client.set_default_headers({{"Authorization", std::string("Bearer ") + kToken}});
    return client;
  }
  // The lines of a request's head that say where it goes and who sends it.
  std::string head() const {
    return "Host: 127.0.0.1:" + std::to_string(server->port()) + "\r\nAuthorization: Bearer " +
           kToken + "\r\n";
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
  // Starts a run or a capture in the first lane, once its unit is there.
  void start(const std::string& path, const Json& body = Json::object()) const {
    wait_state(1, "idle");
    EXPECT_EQ(post(path, body), 202);
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

  SignIn sign_in{posix_env().clock, kToken};
  std::mutex mutex;
  std::vector<JigReport> reports;
  std::vector<std::string> operators;
  std::vector<std::string> kinds;
  std::vector<std::string> jigs;
  std::vector<bool> authenticated;
  std::mutex start_mutex;                   // guards the five that follow
  bool starts_refused = false;              // the answer to whether a run may start
  RetestState retest;                       // ... otherwise: what the unit's earlier runs demand
  bool is_withdrawn = false;                // the constants that "write now" would write
  std::optional<Error> no_answer;           // of the store, to whether they are
  std::vector<std::string> asked_to_write;  // serial and constants
  bool store_is_away = false;               // and the journal with it
  bool store_refuses = false;               // the record itself
  bool has_defect = false;                  // to store throws
  std::atomic<bool> start_has_defect{false};
  bool is_kept_here = false;                    // the journal has it
  std::string said;                             // of the constants, when they are stored
  std::optional<Error> constants_file_problem;  // the disk takes no FILE.constants.json

 private:
  std::shared_ptr<mocks::VirtualBench> bench_;
  cli::VirtualPracticeBench practice_bench_{*bench_};
  device::TransportRegistry registry_;  // the lanes' threads use it
  Operators operators_;

 public:
  std::unique_ptr<Lanes> lanes;
  std::unique_ptr<RepairJob> repairs;
  std::unique_ptr<Api> api;
  std::unique_ptr<Server> server;

 private:
  std::thread thread_;
};

// Does what an operator does: turns the unit to the side that the run asks for.
inline void place_unit(const Station& station, int lane, int placements) {
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

// Another unit comes in place of MOS2A45130007, in the middle of its run or capture: the station
// notices it, and what is stopped then is the first unit's.
inline void expect_swap_is_noticed(const Station& station) {
  EXPECT_EQ(station.post("/api/lanes/1/hand", {{"do", "swap"}, {"serial", "MOS2A45139999"}}), 200);
  const Json wrong = station.wait_state(1, "wrong_unit");
  EXPECT_THAT(wrong["message"].get<std::string>(), testing::HasSubstr("MOS2A45139999"));
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "stopped");
  EXPECT_EQ(lane["result"]["serial"], "MOS2A45130007");
}

// Places the unit on the sides that a capture asks for, up to and with side `last`. Answers with
// the sides in the order in which they were asked.
inline std::vector<std::string> place_sides(const Station& station, std::size_t last) {
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

}  // namespace sixpoint::station

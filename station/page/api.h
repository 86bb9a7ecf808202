// What the page may ask the station: routes, JSON and the rules of who may ask (docs/station.md).
//
// No sockets here: server.h brings requests and carries answers, tests call handle() themselves.
// Threads: handle() and event streams may be used from many at once.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "mocks/virtual_bench.h"
#include "station/lanes.h"
#include "station/repair_job.h"

namespace sixpoint::station {

struct ApiRequest {
  std::string method;  // GET, POST ...
  std::string path;    // decoded, without the query
  std::string body;
  // Headers that matter, empty where they were not sent.
  std::string host;
  std::string origin;
  std::string fetch_site;     // Sec-Fetch-Site
  std::string authorization;  // Authorization
  std::string cookie;
  std::string client;  // X-Sixpoint-Client: who may command a run
  std::string path_parameter;
  std::map<std::string, std::string> parameters;  // of the query, the first of each name
  std::string token_parameter;                    // ?token=, on the first call of the page
};

struct ApiAnswer {
  int status = 200;
  std::string content_type = "application/json";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
};

struct ApiOptions {
  std::string station;
  std::string version;
  std::string bind = "127.0.0.1";
  std::string token;  // empty: none is needed, on the loopback address only
  // Below this folder files are listed, checked and mended, and nowhere else.
  std::string files_folder = ".";
  int most_streams = 24;
};

// A document of a stored run: kind is report.json, certificate.pdf, certificate.json or label.zpl.
struct RunDocument {
  std::string content_type;
  std::string body;
};
using RunDocuments =
    std::function<Result<RunDocument>(const std::string& run, const std::string& kind)>;

class StationDesk;  // station_desk.h

struct ApiParts {
  Env& env;
  Lanes& lanes;
  RepairJob& repairs;
  mocks::VirtualBench* bench = nullptr;  // null: no virtual units
  CaptureKeeper keep_capture;            // constants of a file that was checked
  RunDocuments run_document;
  StationDesk* desk = nullptr;  // null: no check units, no statistics
};

class EventStream;

class Api {
 public:
  Api(ApiOptions options, ApiParts parts);
  ~Api();
  Api(const Api&) = delete;
  Api& operator=(const Api&) = delete;

  // Known once the server listens: the Host header must name it.
  void set_port(int port) { port_ = port; }

  // Nothing where the request may go on; otherwise the answer that refuses it. To be asked before
  // the body is read.
  std::optional<ApiAnswer> guard(const ApiRequest& request) const;
  // Any request but that for events. Guards first.
  ApiAnswer handle(const ApiRequest& request);
  // Null beyond the limit of streams.
  std::unique_ptr<EventStream> open_events();
  int most_streams() const { return options_.most_streams; }

 private:
  friend class EventStream;
  nlohmann::ordered_json state() const;
  ApiAnswer get(const ApiRequest& request);
  ApiAnswer post(const ApiRequest& request);
  ApiAnswer run(const ApiRequest& request, const nlohmann::ordered_json& body);
  ApiAnswer lane_word(std::size_t lane, const std::string& word, const ApiRequest& request,
                      const nlohmann::ordered_json& body);
  ApiAnswer hand(std::size_t lane, const nlohmann::ordered_json& body);
  // Nothing where `what` is no route of theirs.
  std::optional<ApiAnswer> desk_view(const ApiRequest& request, const std::string& what);
  std::optional<ApiAnswer> desk_decision(const ApiRequest& request, const std::string& what,
                                         const nlohmann::ordered_json& body);
  ApiAnswer list_files(const std::string& relative) const;
  ApiAnswer check_file(const nlohmann::ordered_json& body);
  ApiAnswer start_repair(const nlohmann::ordered_json& body);
  Result<std::string> inside(const std::string& relative) const;

  ApiOptions options_;
  ApiParts parts_;
  std::atomic<int> port_{0};
  std::atomic<int> streams_{0};
};

// Server-sent events for one page. One thread.
class EventStream {
 public:
  ~EventStream();
  EventStream(const EventStream&) = delete;
  EventStream& operator=(const EventStream&) = delete;
  // What is new since the last call, empty when nothing is: call it every 40 ms. Memory does not
  // grow with a page that is slow to read: what it misses is left out.
  std::string next();

 private:
  friend class Api;
  explicit EventStream(Api& api);

  Api& api_;
  bool greeted_ = false;
  std::vector<std::uint64_t> seen_changes_;
  std::vector<std::uint64_t> next_reading_;
  std::uint64_t seen_job_ = 0;
  std::uint64_t seen_lock_ = 0;
  std::vector<std::size_t> seen_queue_;
  std::chrono::nanoseconds last_word_{0};
};

// The page's files: "/", "/page.js" and "/page.css", as they were built into the program.
struct PageAsset {
  std::string_view content_type;
  std::string_view body;
};
std::optional<PageAsset> page_asset(std::string_view path);

}  // namespace sixpoint::station

// The page's interface: routes, JSON, events, and which requests are permitted (docs/station.md).
//
//   ApiOptions options;
//   options.station = "bench-1";
//   Api api(options, {env, lanes, repairs, sign_in});
//   api.set_port(6020);
//   ApiRequest request;
//   request.method = "GET";
//   request.path = "/api/state";
//   request.host = "127.0.0.1:6020";
//   const ApiAnswer answer = api.handle(request);
//
// No sockets here: the server (server.h) brings requests and sends answers.
// Threads: handle(), guard() and open_events() may be called from many at once.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "station/access/operators.h"
#include "station/access/sign_in.h"
#include "station/lanes/lanes.h"
#include "station/page/practice_bench.h"
#include "station/page/repair_job.h"
#include "station/printing/label_printer.h"
#include "station/records/jig_due.h"

namespace sixpoint::station {

struct ApiRequest {
  std::string method;  // GET, POST ...
  std::string path;    // decoded, without the query
  std::string body;
  // Headers, empty where they were not sent.
  std::string host;
  std::string origin;
  std::string fetch_site;     // Sec-Fetch-Site
  std::string authorization;  // Authorization
  std::string cookie;
  std::string client;  // X-Sixpoint-Client: the page that may command a run
  // It came over the unix socket of the station, from the user who started it.
  bool is_local_user = false;
  // X-Sixpoint-Before: milliseconds of the station's own clock (clock_ms of GET /api/me). A command
  // that comes later is refused: no one waits for it any more.
  std::string before;
  std::map<std::string, std::string> parameters;  // of the query, the first of each name

  std::string parameter(const std::string& name) const;  // empty where it was not sent
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
  bool tls = false;  // the address of the page begins with https
  // Files are listed, checked and repaired below this folder, and nowhere else.
  std::string files_folder = ".";
  int most_streams = 24;
  JigDue jig;                  // when the jig itself is due, and who signed for it
  bool write_default = false;  // the page's runs write, unless a person says no
};

// A document of a stored run: kind is report.json, certificate.pdf, certificate.json or label.zpl.
struct RunDocument {
  std::string content_type;
  std::string body;
};
using RunDocuments =
    std::function<Result<RunDocument>(const std::string& run, const std::string& kind)>;

// Puts the label of a stored run on its way to the printer again; an error says why it has none.
using PrintAgain = std::function<Status(const std::string& run)>;

class QualityControl;  // quality_control.h

// What the routes lead to; all of it outlives the Api.
struct ApiParts {
  Env& env;
  Lanes& lanes;
  RepairJob& repairs;
  SignIn& sign_in;
  PracticeBench* bench = nullptr;       // null: no virtual units
  StoreConstants store_constants = {};  // of a file that was checked
  RunDocuments run_document = {};
  QualityControl* quality = nullptr;  // null: no check units, no statistics
  Operators* operators = nullptr;     // null: names are as they are typed
  LabelPrinter* printer = nullptr;    // null: the station has none
  PrintAgain print_again = {};
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
  // Names that the Host header may have too, in small letters: those of the certificate. Before the
  // first request.
  void set_names(std::vector<std::string> names) { names_ = std::move(names); }

  // The answer that refuses the request, or nothing where it is permitted. Needs no body: to be
  // called before the body is read.
  std::optional<ApiAnswer> guard(const ApiRequest& request) const;
  // Any request but that for events. Calls guard() first.
  ApiAnswer handle(const ApiRequest& request);
  // Null beyond the limit of streams.
  std::unique_ptr<EventStream> open_events();
  int most_streams() const { return options_.most_streams; }

 private:
  friend class EventStream;
  std::optional<ApiAnswer> check_session(const ApiRequest& request) const;
  std::string cookie_name() const;
  // Where a request comes from: the session of its browser.
  std::string place_of(const ApiRequest& request) const;
  // Whose name stands in the record of what is asked for; the answer says why none.
  tl::expected<SignedName, ApiAnswer> signer(const ApiRequest& request, const std::string& typed,
                                             OperatorRole needed) const;
  nlohmann::ordered_json me(const ApiRequest& request) const;
  ApiAnswer sign_in_operator(const ApiRequest& request, const nlohmann::ordered_json& body) const;
  ApiAnswer open_session(const nlohmann::ordered_json& body) const;
  nlohmann::ordered_json state() const;
  ApiAnswer get(const ApiRequest& request);
  ApiAnswer post(const ApiRequest& request);
  ApiAnswer get_document(const ApiRequest& request, const std::string& run,
                         const std::string& kind) const;
  ApiAnswer print_label(const ApiRequest& request, const std::string& run) const;
  ApiAnswer start_run(const ApiRequest& request, const nlohmann::ordered_json& body);
  ApiAnswer command_lane(std::size_t lane, const std::string& command, const ApiRequest& request,
                         const nlohmann::ordered_json& body);
  ApiAnswer move_virtual_unit(std::size_t lane, const nlohmann::ordered_json& body);
  // Nothing where `what` is no route of theirs.
  std::optional<ApiAnswer> get_quality(const ApiRequest& request, const std::string& what);
  std::optional<ApiAnswer> post_decision(const ApiRequest& request, const std::string& what,
                                         const nlohmann::ordered_json& body);
  ApiAnswer list_files(const std::string& relative) const;
  ApiAnswer check_file(const nlohmann::ordered_json& body);
  ApiAnswer start_repair(const nlohmann::ordered_json& body);
  Result<std::string> inside(const std::string& relative) const;

  ApiOptions options_;
  ApiParts parts_;
  std::atomic<int> port_{0};
  std::vector<std::string> names_;
  std::atomic<int> streams_{0};
};

// Server-sent events for one page. One thread.
class EventStream {
 public:
  ~EventStream();
  EventStream(const EventStream&) = delete;
  EventStream& operator=(const EventStream&) = delete;
  // What is new since the last call; empty when nothing is. To be called about thirty times a
  // second. A page that reads slowly misses readings; they are not stored for it.
  std::string next();

 private:
  friend class Api;
  explicit EventStream(Api& api);
  void add_changes(std::string& text);
  void add_live(std::string& text);

  Api& api_;
  bool started_ = false;
  std::vector<std::uint64_t> seen_changes_;
  std::vector<std::uint64_t> next_reading_;
  std::uint64_t seen_job_ = 0;
  std::chrono::nanoseconds last_job_event_{0};
  std::uint64_t seen_lock_ = 0;
  std::uint64_t seen_printer_ = 0;
  std::vector<std::size_t> seen_queue_;
  std::chrono::nanoseconds last_sent_{0};
};

// The page's files: "/", "/page.js" and "/page.css", as they were built into the program.
struct PageAsset {
  std::string_view content_type;
  std::string_view body;
};
std::optional<PageAsset> page_asset(std::string_view path);

}  // namespace sixpoint::station

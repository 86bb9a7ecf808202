#include "station/api.h"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "calib/solve.h"
#include "repair/file_tree.h"
#include "station/calibration_file.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostText = 200;     // of names and serial numbers that come in
constexpr std::size_t kMostListed = 2000;  // files of one folder
constexpr std::chrono::seconds kHeartbeat{5};

std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

ApiAnswer answer(int status, const Json& json) {
  return {status, "application/json", dump(json), {}};
}

ApiAnswer refusal(int status, std::string_view code, std::string_view what,
                  std::string_view hint = "") {
  Json json;
  json["error"]["code"] = code;
  json["error"]["what"] = what;
  json["error"]["hint"] = hint;
  return answer(status, json);
}

ApiAnswer refusal(const Error& error) {
  int status = 500;
  switch (error.code) {
    case ErrorCode::usage:
    case ErrorCode::bad_data:
    case ErrorCode::configuration:
      status = 400;
      break;
    case ErrorCode::no_input:
      status = 404;
      break;
    case ErrorCode::permission:
      status = 403;
      break;
    case ErrorCode::cannot_create:
      status = 409;
      break;
    case ErrorCode::device_unavailable:
      status = 503;
      break;
    case ErrorCode::internal:
    case ErrorCode::io:
      break;
  }
  return refusal(status, to_string(error.code), error.brief(), error.hint);
}

ApiAnswer refusal(const LaneRefusal& why) {
  switch (why.kind) {
    case LaneRefusal::Kind::no_such_lane:
      return refusal(404, "no_such_lane", why.what, why.hint);
    case LaneRefusal::Kind::conflict:
      return refusal(409, "conflict", why.what, why.hint);
    case LaneRefusal::Kind::bad_request:
      break;
  }
  return refusal(400, "bad_request", why.what, why.hint);
}

// Compares in a time that does not depend on where two texts differ.
bool same_secret(std::string_view a, std::string_view b) {
  unsigned differ = a.size() == b.size() ? 0U : 1U;
  for (std::size_t i = 0; i < b.size(); ++i) {
    differ |=
        static_cast<unsigned char>(i < a.size() ? a[i] : 0) ^ static_cast<unsigned char>(b[i]);
  }
  return differ == 0;
}

// The value of a cookie in a Cookie header.
std::string_view cookie_value(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(';'), header.size());
    std::string_view item = header.substr(0, end);
    header.remove_prefix(std::min(end + 1, header.size()));
    item.remove_prefix(std::min(item.find_first_not_of(' '), item.size()));
    if (item.size() > name.size() && item.starts_with(name) && item[name.size()] == '=') {
      return item.substr(name.size() + 1);
    }
  }
  return {};
}

bool is_loopback(std::string_view name) {
  return name == "127.0.0.1" || name == "localhost" || name == "[::1]" || name == "::1";
}

// An address in figures. A page of another name that was made to point here (DNS rebinding) still
// says its own name.
bool is_address(std::string_view name) {
  if (name.starts_with('[') && name.ends_with(']')) {
    return true;
  }
  return !name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos;
}

// A text of a JSON body; empty where it is not there. Nothing where it is no text or too long.
std::optional<std::string> text_of(const Json& body, const char* key) {
  if (!body.contains(key) || body[key].is_null()) {
    return std::string();
  }
  if (!body[key].is_string() || body[key].get_ref<const std::string&>().size() > kMostText) {
    return std::nullopt;
  }
  return body[key].get<std::string>();
}

std::optional<std::size_t> number_of(std::string_view text) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return number;
}

// The path "/api/a/b" as its parts after "/api/".
std::vector<std::string> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  std::string_view rest = path;
  rest.remove_prefix(std::string_view("/api/").size());
  while (!rest.empty() && parts.size() < 6) {
    const std::size_t end = std::min(rest.find('/'), rest.size());
    parts.emplace_back(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return parts;
}

ApiAnswer unknown_route() {
  return refusal(404, "not_found", "there is nothing at this address", "docs/station.md lists all");
}

ApiAnswer bad_field(std::string_view key, std::string_view wanted) {
  return refusal(400, "bad_request", fmt::format("'{}' must be {}", key, wanted));
}

const std::vector<std::pair<std::string, std::string>>& common_headers() {
  static const std::vector<std::pair<std::string, std::string>> kHeaders = {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
       "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
      {"X-Content-Type-Options", "nosniff"},
      {"X-Frame-Options", "DENY"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Cache-Control", "no-store"},
  };
  return kHeaders;
}

ApiAnswer with_headers(ApiAnswer given) {
  given.headers.insert(given.headers.end(), common_headers().begin(), common_headers().end());
  return given;
}

}  // namespace

Api::Api(ApiOptions options, ApiParts parts)
    : options_(std::move(options)), parts_(std::move(parts)) {}
Api::~Api() = default;

std::optional<ApiAnswer> Api::guard(const ApiRequest& request) const {
  // Host: a name that somebody made to point here is not ours (DNS rebinding).
  std::string_view name = request.host;
  const std::string port = fmt::format(":{}", port_.load());
  if (name.ends_with(port)) {
    name.remove_suffix(port.size());
  } else if (port_ != 80) {
    name = {};
  }
  const bool local = is_loopback(options_.bind);
  const bool ours = is_loopback(name) || (!local && (is_address(name) || name == options_.bind));
  if (!ours) {
    return with_headers(refusal(421, "wrong_host", "this station does not answer to that name",
                                "open it by the address that it printed"));
  }
  // Origin and Sec-Fetch-Site: other pages in the same browser have no business here (CSRF).
  const bool other_origin =
      !request.origin.empty() && request.origin != fmt::format("http://{}", request.host);
  const bool other_site = request.path.starts_with("/api/") && !request.fetch_site.empty() &&
                          request.fetch_site != "same-origin" && request.fetch_site != "none";
  if (other_origin || other_site) {
    return with_headers(refusal(403, "wrong_origin", "another page may not command this station"));
  }
  if (!options_.token.empty()) {
    constexpr std::string_view kBearer = "Bearer ";
    const std::string_view sent = request.authorization;
    const bool by_header =
        sent.starts_with(kBearer) && same_secret(sent.substr(kBearer.size()), options_.token);
    const bool by_cookie =
        same_secret(cookie_value(request.cookie, "sixpoint_token"), options_.token);
    if (!by_header && !by_cookie) {
      if (request.method == "GET" && request.path == "/" &&
          same_secret(request.token_parameter, options_.token)) {
        // The page's first call: from here on the cookie speaks, and the address shows nothing.
        ApiAnswer redirect{303, "text/plain", "", {}};
        redirect.headers.emplace_back("Location", "/");
        redirect.headers.emplace_back(
            "Set-Cookie",
            fmt::format("sixpoint_token={}; HttpOnly; SameSite=Strict; Path=/", options_.token));
        return with_headers(redirect);
      }
      return with_headers(refusal(401, "token_needed", "this station wants its token",
                                  "open it as http://ADDRESS:PORT/?token=TOKEN"));
    }
  }
  return std::nullopt;
}

Json Api::state() const {
  Json json;
  json["schema"] = "sixpoint/station/1";
  json["station"] = options_.station;
  json["version"] = options_.version;
  json["time_ms"] =
      std::chrono::duration<double, std::milli>(parts_.env.clock.now().time_since_epoch()).count();
  json["virtual_hands"] = Json::array();
  json["lanes"] = Json::array();
  for (std::size_t lane = 1; lane <= parts_.lanes.size(); ++lane) {
    json["lanes"].push_back(parts_.lanes.to_json(lane));
    if (parts_.bench != nullptr && parts_.bench->has(parts_.lanes.device(lane))) {
      json["virtual_hands"].push_back(lane);
    }
  }
  json["queue"] = parts_.lanes.queue();
  json["job"] = parts_.repairs.to_json();
  return json;
}

ApiAnswer Api::handle(const ApiRequest& request) {
  if (auto refused = guard(request)) {
    return *std::move(refused);
  }
  if (request.method == "GET" || request.method == "HEAD") {
    return with_headers(get(request));
  }
  if (request.method == "POST") {
    return with_headers(post(request));
  }
  ApiAnswer no = refusal(405, "method_not_allowed", "only GET and POST are known here");
  no.headers.emplace_back("Allow", "GET, HEAD, POST");
  return with_headers(no);
}

ApiAnswer Api::get(const ApiRequest& request) {
  if (const auto asset = page_asset(request.path)) {
    return {200, std::string(asset->content_type), std::string(asset->body), {}};
  }
  if (!request.path.starts_with("/api/")) {
    return unknown_route();
  }
  const auto parts = parts_of(request.path);
  if (parts.size() == 1 && parts[0] == "state") {
    return answer(200, state());
  }
  if (parts.size() == 1 && parts[0] == "files") {
    return list_files(request.path_parameter);
  }
  if (parts.size() == 1 && parts[0] == "job") {
    return answer(200, parts_.repairs.to_json());
  }
  if (parts.size() == 2 && parts[0] == "lanes") {
    const auto lane = number_of(parts[1]);
    if (!lane || *lane < 1 || *lane > parts_.lanes.size()) {
      return refusal(404, "no_such_lane", "there is no such lane");
    }
    return answer(200, parts_.lanes.to_json(*lane));
  }
  if (parts.size() == 3 && parts[0] == "runs" && parts_.run_document) {
    // A run's id is hex; anything else is no run and no path either.
    if (parts[1].empty() || parts[1].size() > 64 ||
        parts[1].find_first_not_of("0123456789abcdef") != std::string::npos) {
      return unknown_route();
    }
    const auto document = parts_.run_document(parts[1], parts[2]);
    if (!document) {
      return refusal(document.error());
    }
    ApiAnswer given{200, document->content_type, document->body, {}};
    given.headers.emplace_back(
        "Content-Disposition",
        fmt::format("attachment; filename=\"sixpoint-{}-{}\"", parts[1].substr(0, 12), parts[2]));
    return given;
  }
  return unknown_route();
}

ApiAnswer Api::post(const ApiRequest& request) {
  if (!request.path.starts_with("/api/")) {
    return unknown_route();
  }
  const auto parts = parts_of(request.path);
  Json body = Json::object();
  if (!request.body.empty()) {
    body = Json::parse(request.body, nullptr, false);
    if (body.is_discarded() || !body.is_object()) {
      return refusal(400, "bad_json", "the body is no JSON object");
    }
  }
  if (parts.size() == 1 && (parts[0] == "run" || parts[0] == "capture")) {
    return run(request, body);
  }
  if (parts.size() == 1 && parts[0] == "scan") {
    const auto serial = text_of(body, "serial");
    if (!serial || serial->empty()) {
      return bad_field("serial", "a serial number");
    }
    const auto lane = parts_.lanes.scan(0, *serial);
    return lane ? answer(200, {{"lane", *lane}}) : refusal(lane.error());
  }
  if (parts.size() == 1 && parts[0] == "check") {
    return check_file(body);
  }
  if (parts.size() == 1 && parts[0] == "repair") {
    return start_repair(body);
  }
  if (parts.size() == 2 && parts[0] == "repair" && parts[1] == "cancel") {
    parts_.repairs.cancel();
    return answer(200, parts_.repairs.to_json());
  }
  if (parts.size() == 3 && parts[0] == "lanes") {
    const auto lane = number_of(parts[1]);
    if (!lane) {
      return refusal(404, "no_such_lane", "there is no such lane");
    }
    return lane_word(*lane, parts[2], request, body);
  }
  return unknown_route();
}

ApiAnswer Api::run(const ApiRequest& request, const Json& body) {
  std::size_t lane = 1;
  if (body.contains("lane")) {
    if (!body["lane"].is_number_unsigned()) {
      return bad_field("lane", "a lane's number");
    }
    lane = body["lane"].get<std::size_t>();
  }
  StartOrder order;
  const auto operator_name = text_of(body, "operator");
  const auto serial = text_of(body, "serial");
  if (!operator_name || !serial) {
    return bad_field(operator_name ? "serial" : "operator", "a text of at most 200 bytes");
  }
  if (body.contains("write") && !body["write"].is_boolean()) {
    return bad_field("write", "true or false");
  }
  order.operator_name = *operator_name;
  order.serial = *serial;
  order.client = request.client.substr(0, kMostText);
  order.write = body.value("write", false);
  const auto started = request.path == "/api/capture" ? parts_.lanes.start_capture(lane, order)
                                                      : parts_.lanes.start(lane, order);
  return started ? answer(202, {{"lane", lane}, {"started", true}}) : refusal(started.error());
}

ApiAnswer Api::lane_word(std::size_t lane, const std::string& word, const ApiRequest& request,
                         const Json& body) {
  const std::string client = request.client.substr(0, kMostText);
  LaneAnswer<void> done;
  if (word == "undo" || word == "stop") {
    done = parts_.lanes.say(lane, client, word == "undo" ? OperatorWord::undo : OperatorWord::stop);
  } else if (word == "placed") {
    done = parts_.lanes.side_is_placed(lane, client);
  } else if (word == "take" || word == "scan") {
    const auto text = text_of(body, word == "take" ? "operator" : "serial");
    if (!text || (word == "scan" && (lane == 0 || text->empty()))) {
      return bad_field(word == "take" ? "operator" : "serial", "a text of at most 200 bytes");
    }
    if (word == "take") {
      done = parts_.lanes.take_over(lane, client, *text);
    } else if (const auto scanned = parts_.lanes.scan(lane, *text); !scanned) {
      done = tl::unexpected(scanned.error());
    }
  } else if (word == "hand") {
    return hand(lane, body);
  } else {
    return unknown_route();
  }
  return done ? answer(200, {{"lane", lane}}) : refusal(done.error());
}

// A virtual unit is turned by buttons of the page: for practice, and for tests.
ApiAnswer Api::hand(std::size_t lane, const Json& body) {
  if (lane < 1 || lane > parts_.lanes.size() || parts_.bench == nullptr ||
      !parts_.bench->has(parts_.lanes.device(lane))) {
    return refusal(404, "no_such_lane", "this lane has no virtual unit",
                   "a real unit is turned by hand");
  }
  const std::string& device = parts_.lanes.device(lane);
  const auto what = text_of(body, "do");
  const auto pose_text = text_of(body, "pose");
  const auto serial = text_of(body, "serial");
  if (!what || !pose_text || !serial) {
    return bad_field("do", "turn, lean, knock, unplug, plug or swap");
  }
  Status done;
  if (*what == "turn") {
    const auto pose = device::parse_pose(*pose_text);
    if (!pose) {
      return bad_field("pose", "one of +x -x +y -y +z -z");
    }
    double tilt_deg = 0;
    if (body.contains("tilt_deg")) {
      if (!body["tilt_deg"].is_number() || std::abs(body["tilt_deg"].get<double>()) > 90) {
        return bad_field("tilt_deg", "an angle from -90 to 90");
      }
      tilt_deg = body["tilt_deg"].get<double>();
    }
    done = parts_.bench->turn(device, *pose, tilt_deg);
  } else if (*what == "lean") {
    done = parts_.bench->lean(device);
  } else if (*what == "knock") {
    done = parts_.bench->knock(device);
  } else if (*what == "unplug" || *what == "plug") {
    done = parts_.bench->set_plugged(device, *what == "plug");
  } else if (*what == "swap") {
    const std::string other = serial->empty() ? "MOS2A99999999" : *serial;
    if (other.size() > 16 ||
        other.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789") != std::string::npos) {
      return bad_field("serial", "up to 16 capital letters and digits");
    }
    done = parts_.bench->swap(device, std::hash<std::string>{}(other), other);
  } else {
    return bad_field("do", "turn, lean, knock, unplug, plug or swap");
  }
  return done ? answer(200, {{"lane", lane}}) : refusal(done.error());
}

// A path that the page named, below the folder that this station may touch.
Result<std::string> Api::inside(const std::string& relative) const {
  const bool plain = relative.size() < 1000 && !relative.starts_with('/') &&
                     std::none_of(relative.begin(), relative.end(), [](char c) {
                       return static_cast<unsigned char>(c) < 0x20 || c == '\\';
                     });
  std::string_view rest = relative;
  bool up = false;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('/'), rest.size());
    up = up || rest.substr(0, end) == "..";
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  if (!plain || up) {
    return fail(ErrorCode::permission, "this path leads out of the station's folder",
                printable(relative, 100), "choose a folder below it (--files)");
  }
  return relative.empty() ? options_.files_folder : options_.files_folder + "/" + relative;
}

ApiAnswer Api::list_files(const std::string& relative) const {
  const auto folder = inside(relative);
  if (!folder) {
    return refusal(folder.error());
  }
  const auto names = parts_.env.files.list(*folder);
  if (!names) {
    return refusal(404, "no_input", "there is no such folder");
  }
  Json json;
  json["path"] = printable(relative);
  json["folders"] = Json::array();
  json["files"] = Json::array();
  json["cut"] = names->size() > kMostListed;
  for (std::size_t i = 0; i < std::min(names->size(), kMostListed); ++i) {
    const std::string& name = (*names)[i];
    const auto info = parts_.env.files.info(*folder + "/" + name);
    if (!info || name.starts_with('.')) {
      continue;
    }
    if (info->is_folder) {
      json["folders"].push_back(name);
    } else if (repair::has_ending(name, ".gt3x")) {
      json["files"].push_back({{"name", name}, {"bytes", info->size}});
    }
  }
  return answer(200, json);
}

ApiAnswer Api::check_file(const Json& body) {
  const auto name = text_of(body, "file");
  if (!name || name->empty()) {
    return bad_field("file", "a file below the station's folder");
  }
  const auto path = inside(*name);
  if (!path) {
    return refusal(path.error());
  }
  const auto check = check_calibration_file(parts_.env, *path);
  if (!check) {
    return refusal(check.error());
  }
  Json json;
  json["file"] = *name;
  json["serial"] = printable(check->serial, 40);
  json["firmware"] = printable(check->firmware, 40);
  json["usable"] = check->usable();
  json["refusal"] = check->refusal;
  json["reasons"] =
      check->solved ? check->solved->verification.reasons : std::vector<std::string>{};
  json["repeat_sides"] =
      check->solved ? Json(check->solved->verification.missing_directions) : Json::array();
  json["solved"] = check->solved ? calib::to_json(*check->solved) : Json(nullptr);
  json["constants_file"] = nullptr;
  json["stored_id"] = nullptr;
  if (check->usable() && body.value("save", Json(false)) == Json(true)) {
    CaptureReport report;
    report.serial = check->serial;
    report.firmware = check->firmware;
    report.file = *path;
    report.file_sha256 = check->sha256;
    report.solved = check->solved;
    const auto id = parts_.keep_capture(report);
    if (!id) {
      return refusal(id.error());
    }
    json["stored_id"] = *id;
    json["constants_file"] = *name + ".constants.json";
  }
  return answer(200, json);
}

ApiAnswer Api::start_repair(const Json& body) {
  const auto folder = text_of(body, "folder");
  const auto output = text_of(body, "output");
  const auto calibration = text_of(body, "calibration_file");
  if (!folder || !output || !calibration || output->empty()) {
    return bad_field("folder, output", "folders below the station's folder");
  }
  RepairOrder order;
  const auto from = inside(*folder);
  const auto into = inside(*output);
  const auto file = inside(*calibration);
  for (const auto* path : {&from, &into, &file}) {
    if (!*path) {
      return refusal(path->error());
    }
  }
  order.folder = *from;
  order.output = *into;
  order.calibration_file = calibration->empty() ? "" : *file;
  if (const Status started = parts_.repairs.start(order); !started) {
    return started.error().code == ErrorCode::usage
               ? refusal(409, "conflict", started.error().what, started.error().hint)
               : refusal(started.error());
  }
  return answer(202, parts_.repairs.to_json());
}

std::unique_ptr<EventStream> Api::open_events() {
  if (++streams_ > options_.most_streams) {
    --streams_;
    return nullptr;
  }
  return std::unique_ptr<EventStream>(new EventStream(*this));
}

// --- EventStream ---

namespace {

void add_event(std::string& text, std::string_view name, const Json& data) {
  text += "event: ";
  text += name;
  text += "\ndata: ";
  text += dump(data);  // one line: JSON escapes line ends
  text += "\n\n";
}

}  // namespace

EventStream::EventStream(Api& api)
    : api_(api), seen_changes_(api.parts_.lanes.size()), next_reading_(api.parts_.lanes.size()) {}
EventStream::~EventStream() { --api_.streams_; }

std::string EventStream::next() {
  std::string text;
  Lanes& lanes = api_.parts_.lanes;
  const auto now = api_.parts_.env.clock.elapsed();
  if (!greeted_) {
    greeted_ = true;
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      seen_changes_[i] = lanes.changes(i + 1);
    }
    seen_job_ = api_.parts_.repairs.changes();
    add_event(text, "state", api_.state());
  }
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const std::uint64_t changes = lanes.changes(i + 1);
    if (changes != seen_changes_[i]) {
      seen_changes_[i] = changes;
      add_event(text, "lane", lanes.to_json(i + 1));
    }
  }
  Json live;
  live["lanes"] = Json::array();
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const LaneTrace trace = lanes.trace(i + 1, next_reading_[i]);
    if (trace.force_mg.empty()) {
      continue;
    }
    next_reading_[i] = trace.first + trace.force_mg.size();
    Json lane;
    lane["lane"] = i + 1;
    lane["first"] = trace.first;
    lane["host_ms"] = trace.host_ms;
    Json& flat = lane["mg"] = Json::array();
    for (const auto& force_mg : trace.force_mg) {
      for (const std::int16_t mg : force_mg) {
        flat.push_back(mg);
      }
    }
    lane["live"] = lanes.live(i + 1);
    live["lanes"].push_back(std::move(lane));
  }
  auto queue = lanes.queue();
  if (!live["lanes"].empty() || queue != seen_queue_) {
    live["queue"] = queue;
    seen_queue_ = std::move(queue);
    add_event(text, "live", live);
  }
  if (const std::uint64_t job = api_.parts_.repairs.changes(); job != seen_job_) {
    seen_job_ = job;
    add_event(text, "job", api_.parts_.repairs.to_json());
  }
  if (text.empty() && now - last_word_ > kHeartbeat) {
    text = ": still here\n\n";
  }
  if (!text.empty()) {
    last_word_ = now;
  }
  return text;
}

}  // namespace sixpoint::station

#include "station/page/api.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "station/lanes/scan_rule.h"
#include "station/page/api_answers.h"
#include "station/page/quality_control.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

ApiAnswer lane_refusal(const LaneRefusal& why) {
  return why.kind == LaneRefusal::Kind::no_such_lane
             ? refusal(404, "no_such_lane", why.what, why.hint)
             : refusal(409, "conflict", why.what, why.hint);
}

std::string client_of(const ApiRequest& request) { return request.client.substr(0, kMostText); }

// Of the clock that no one sets.
std::int64_t clock_ms(Clock& clock) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(clock.elapsed()).count();
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

// A numeric address. A name that was made to point here (DNS rebinding) is not one.
bool is_address(std::string_view name) {
  if (name.starts_with('[') && name.ends_with(']')) {
    return true;
  }
  return !name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos;
}

std::string in_small_letters(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(), [](char c) {
    return 'A' <= c && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return small;
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

// An answer's own header holds.
ApiAnswer with_headers(ApiAnswer given) {
  for (const auto& header : common_headers()) {
    if (std::none_of(given.headers.begin(), given.headers.end(),
                     [&](const auto& own) { return own.first == header.first; })) {
      given.headers.push_back(header);
    }
  }
  return given;
}

}  // namespace

Api::Api(ApiOptions options, ApiParts parts)
    : options_(std::move(options)), parts_(std::move(parts)) {}
Api::~Api() = default;

std::string ApiRequest::parameter(const std::string& name) const {
  const auto found = parameters.find(name);
  return found == parameters.end() ? std::string() : found->second;
}

// Cookies know no port: without it, two stations of one machine would take each other's.
std::string Api::cookie_name() const { return fmt::format("sixpoint_session_{}", port_.load()); }

// The page itself has no secrets, and it is what asks a person to sign in.
std::optional<ApiAnswer> Api::check_session(const ApiRequest& request) const {
  constexpr std::string_view kBearer = "Bearer ";
  const std::string_view sent = request.authorization;
  if (request.is_local_user ||
      (sent.starts_with(kBearer) && parts_.sign_in.is_token(sent.substr(kBearer.size()))) ||
      parts_.sign_in.session_holds(cookie_value(request.cookie, cookie_name())) ||
      page_asset(request.path) || (request.method == "POST" && request.path == "/api/session")) {
    return std::nullopt;
  }
  return refusal(401, "sign_in", "this browser is not signed in",
                 "open the address that the station printed, or type its code");
}

ApiAnswer Api::open_session(const Json& body) const {
  const auto code = text_of(body, "code");
  const auto session = code ? parts_.sign_in.session_for(*code) : std::nullopt;
  if (!session) {
    return refusal(401, "wrong_code", "this code was used, is too old, or never was one",
                   "ask a page that is signed in for a new code, or type the station's token");
  }
  ApiAnswer opened = answer(200, {{"signed_in", true}});
  const auto life_s = std::chrono::duration_cast<std::chrono::seconds>(kSessionLife).count();
  opened.headers.emplace_back(
      "Set-Cookie", fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/; Max-Age={}{}",
                                cookie_name(), *session, life_s, options_.tls ? "; Secure" : ""));
  return opened;
}

std::optional<ApiAnswer> Api::guard(const ApiRequest& request) const {
  if (request.is_local_user) {
    return std::nullopt;  // no browser reaches a unix socket, and the name of its host means
                          // nothing
  }
  // Host: another name may have been made to point here (DNS rebinding).
  // Large and small letters are the same in it (RFC 9110, 4.2.3).
  std::string name = in_small_letters(request.host);
  const std::string port = fmt::format(":{}", port_.load());
  if (name.ends_with(port)) {
    name.resize(name.size() - port.size());
  } else if (port_ != (options_.tls ? 443 : 80)) {
    name.clear();
  }
  const bool local = is_loopback(options_.bind);
  const bool ours = is_loopback(name) || std::ranges::find(names_, name) != names_.end() ||
                    (!local && (is_address(name) || name == in_small_letters(options_.bind)));
  if (!ours) {
    return with_headers(refusal(421, "wrong_host", "this station does not answer to that name",
                                "open it by the address that it printed"));
  }
  // Origin and Sec-Fetch-Site: another page in the same browser sent this (CSRF).
  const bool other_origin =
      !request.origin.empty() &&
      request.origin != fmt::format("{}://{}", options_.tls ? "https" : "http", request.host);
  const bool other_site = request.path.starts_with("/api/") && !request.fetch_site.empty() &&
                          request.fetch_site != "same-origin" && request.fetch_site != "none";
  if (other_origin || other_site) {
    return with_headers(refusal(403, "wrong_origin", "another page may not command this station"));
  }
  auto refused = check_session(request);
  return refused ? std::optional(with_headers(*std::move(refused))) : std::nullopt;
}

std::string Api::place_of(const ApiRequest& request) const {
  const std::string_view session = cookie_value(request.cookie, cookie_name());
  return session.empty() ? "the token" : std::string(session);
}

tl::expected<SignedName, ApiAnswer> Api::signer(const ApiRequest& request, const std::string& typed,
                                                OperatorRole needed) const {
  if (parts_.operators == nullptr) {
    return SignedName{typed, false};
  }
  auto who = parts_.operators->who(place_of(request), typed, needed);
  if (!who) {
    const Error& why = who.error();
    return tl::unexpected<ApiAnswer>(why.code == ErrorCode::permission
                                         ? refusal(403, "operator_needed", why.what, why.hint)
                                         : refusal(why));
  }
  return *std::move(who);
}

Json Api::me(const ApiRequest& request) const {
  Json json;
  json["clock_ms"] = clock_ms(parts_.env.clock);
  json["client"] = public_name(client_of(request));
  json["operators"] = Json::array();
  json["operator"] = nullptr;
  if (parts_.operators != nullptr) {
    for (const Operator& each : parts_.operators->list().value_or(std::vector<Operator>())) {
      json["operators"].push_back(each.name);
    }
    if (const auto here = parts_.operators->at(place_of(request))) {
      json["operator"] = {{"name", here->name}, {"role", to_string(here->role)}};
    }
  }
  return json;
}

// {name, pin}; an empty name signs out.
ApiAnswer Api::sign_in_operator(const ApiRequest& request, const Json& body) const {
  const auto name = text_of(body, "name");
  const auto pin = text_of(body, "pin");
  if (parts_.operators == nullptr || !name || !pin) {
    return bad_field(name ? "pin" : "name", kNameWanted);
  }
  if (name->empty()) {
    parts_.operators->sign_out(place_of(request));
    return answer(200, me(request));
  }
  const auto who = parts_.operators->sign_in(place_of(request), *name, *pin);
  return who ? answer(200, me(request)) : refusal(who.error());
}

Json Api::state() const {
  Json json;
  json["schema"] = "sixpoint/station/1";
  json["station"] = options_.station;
  json["version"] = options_.version;
  const JigDue& jig = options_.jig;
  json["jig_due"] = jig.due ? Json(to_iso8601(*jig.due)) : Json(nullptr);
  json["jig_over"] = !check_jig_due({jig.due, {}, {}}, parts_.env.clock.now());
  json["jig_exception"] = jig.exception.empty() || jig.signed_by.empty()
                              ? Json(nullptr)
                              : Json{{"reason", printable(jig.exception, 200)},
                                     {"signed_by", printable(jig.signed_by, 60)}};
  json["write_default"] = options_.write_default;
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
  json["printer"] = parts_.printer != nullptr ? parts_.printer->to_json() : Json(nullptr);
  json["lock"] = parts_.quality != nullptr ? parts_.quality->lock() : Json(nullptr);
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
  if (parts.size() == 1 && parts[0] == "me") {
    return answer(200, me(request));
  }
  if (parts.size() == 1 && parts[0] == "files") {
    return list_files(request.parameter("path"));
  }
  if (parts.size() == 1 && parts[0] == "job") {
    return answer(200, parts_.repairs.to_json());
  }
  if (parts.size() == 1) {
    return get_quality(request, parts[0]).value_or(unknown_route());
  }
  if (parts.size() == 2 && parts[0] == "lanes") {
    const auto lane = number_of(parts[1]);
    if (!lane || *lane < 1 || *lane > parts_.lanes.size()) {
      return refusal(404, "no_such_lane", "there is no such lane");
    }
    return answer(200, parts_.lanes.to_json(*lane));
  }
  if (parts.size() == 3 && parts[0] == "runs") {
    return get_document(request, parts[1], parts[2]);
  }
  return unknown_route();
}

ApiAnswer Api::post(const ApiRequest& request) {
  if (!request.path.starts_with("/api/")) {
    return unknown_route();
  }
  const auto parts = parts_of(request.path);
  if (!request.before.empty()) {
    const auto before_ms = number_of(request.before);
    if (!before_ms) {
      return refusal(400, "bad_request", "X-Sixpoint-Before is a time in milliseconds");
    }
    if (clock_ms(parts_.env.clock) > static_cast<std::int64_t>(*before_ms)) {
      return refusal(408, "too_late", "this command came too late, and nothing was done",
                     "give it again");
    }
  }
  Json body = Json::object();
  if (!request.body.empty()) {
    body = parse_json(request.body);
    if (body.is_discarded() || !body.is_object()) {
      return refusal(400, "bad_json", "the body is no JSON object");
    }
  }
  const bool has_number = parts.size() == 3 && (parts[0] == "lanes" || parts[0] == "runs");
  const auto route = fmt::format("{}", fmt::join(parts, "/"));
  if (auto refused = refused_key(has_number ? parts[0] + "/" + parts[2] : route, body)) {
    return *std::move(refused);
  }
  if (parts.size() == 1 && parts[0] == "session") {
    return open_session(body);
  }
  if (parts.size() == 1 && parts[0] == "operator") {
    return sign_in_operator(request, body);
  }
  if (parts.size() == 1 && parts[0] == "code") {
    return answer(200, {{"code", parts_.sign_in.new_code()}});
  }
  if (parts.size() == 1 && (parts[0] == "run" || parts[0] == "capture")) {
    return start_run(request, body);
  }
  if (parts.size() == 1 && parts[0] == "scan") {
    if (body.value("dismiss", Json(false)) == Json(true)) {
      parts_.lanes.dismiss_scan(client_of(request));
      return answer(200, Json::object());
    }
    const auto serial = serial_of_label(text_of(body, "serial").value_or(""));
    if (!serial) {
      return bad_field("serial", "a serial number, or what a label of ours says");
    }
    const auto lane = parts_.lanes.scan(0, *serial, client_of(request));
    return lane ? answer(200, {{"lane", *lane}}) : lane_refusal(lane.error());
  }
  if (parts == std::vector<std::string>{"repair"} ||
      (parts == std::vector<std::string>{"check"} && body.value("save", Json(false)) == true)) {
    if (const auto who = signer(request, {}, OperatorRole::technician); !who) {
      return who.error();
    }
  }
  if (parts.size() == 1 && parts[0] == "check") {
    return check_file(body);
  }
  if (parts.size() == 1 && parts[0] == "repair") {
    return start_repair(body);
  }
  if (parts.size() == 1) {
    return post_decision(request, parts[0], body).value_or(unknown_route());
  }
  if (parts.size() == 2 && parts[0] == "repair" && parts[1] == "cancel") {
    parts_.repairs.cancel();
    return answer(200, parts_.repairs.to_json());
  }
  if (parts.size() == 3 && parts[0] == "runs" && parts[2] == "print") {
    return print_label(request, parts[1]);
  }
  if (parts.size() == 3 && parts[0] == "lanes") {
    const auto lane = number_of(parts[1]);
    if (!lane) {
      return refusal(404, "no_such_lane", "there is no such lane");
    }
    return command_lane(*lane, parts[2], request, body);
  }
  return unknown_route();
}

ApiAnswer Api::start_run(const ApiRequest& request, const Json& body) {
  const bool is_capture = request.path == "/api/capture";
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
    return bad_field(operator_name ? "serial" : "operator", kNameWanted);
  }
  for (const char* key : {"write", "last_run"}) {
    if (body.contains(key) && !body[key].is_boolean()) {
      return bad_field(key, "true or false");
    }
    if (is_capture && body.value(key, false)) {
      return bad_field(key, "false: a capture writes no constants");
    }
  }
  const auto who = signer(request, *operator_name, OperatorRole::technician);
  if (!who) {
    return who.error();
  }
  order.operator_name = who->name;
  order.is_authenticated = who->is_authenticated;
  order.serial = *serial;
  order.client = client_of(request);
  order.write = body.value("write", false);
  order.last_run = body.value("last_run", false);
  const auto started =
      is_capture ? parts_.lanes.start_capture(lane, order) : parts_.lanes.start(lane, order);
  return started ? answer(202, {{"lane", lane}, {"started", true}}) : lane_refusal(started.error());
}

ApiAnswer Api::command_lane(std::size_t lane, const std::string& command, const ApiRequest& request,
                            const Json& body) {
  const std::string client = client_of(request);
  LaneAnswer<void> done;
  if (command == "undo" || command == "stop") {
    done = parts_.lanes.command(lane, client,
                                command == "undo" ? OperatorCommand::undo : OperatorCommand::stop);
  } else if (command == "placed") {
    done = parts_.lanes.confirm_side(lane, client);
  } else if (command == "jig-free") {
    const auto who = signer(request, {}, OperatorRole::technician);
    if (!who) {
      return who.error();
    }
    done = parts_.lanes.release_jig(lane, client, who->name);
  } else if (command == "take") {
    const auto operator_name = text_of(body, "operator");
    if (!operator_name) {
      return bad_field("operator", kNameWanted);
    }
    const auto who = signer(request, *operator_name, OperatorRole::technician);
    if (!who) {
      return who.error();
    }
    done = parts_.lanes.take_over(lane, client, who->name);
  } else if (command == "scan") {
    const auto serial = serial_of_label(text_of(body, "serial").value_or(""));
    if (!serial || lane == 0) {
      return bad_field("serial", "a serial number, or what a label of ours says");
    }
    done = parts_.lanes.scan(lane, *serial, client).map([](std::size_t) {});
  } else if (command == "hand") {
    return move_virtual_unit(lane, body);
  } else {
    return unknown_route();
  }
  return done ? answer(200, {{"lane", lane}}) : lane_refusal(done.error());
}

// A virtual unit is turned by buttons of the page: for practice, and for tests.
ApiAnswer Api::move_virtual_unit(std::size_t lane, const Json& body) {
  if (lane < 1 || lane > parts_.lanes.size() || parts_.bench == nullptr ||
      !parts_.bench->has(parts_.lanes.device(lane))) {
    return refusal(404, "no_such_lane", "this lane has no virtual unit",
                   "a real unit is turned by hand");
  }
  const std::string& device = parts_.lanes.device(lane);
  const auto what = text_of(body, "do").value_or("");
  const auto pose_text = text_of(body, "pose");
  const auto serial = text_of(body, "serial");
  Status done;
  if (!pose_text || !serial) {
    return bad_field("do", "turn, lean, knock, unplug, plug or swap");
  }
  if (what == "turn") {
    const auto pose = device::parse_pose(*pose_text);
    if (!pose) {
      return bad_field("pose", "one of +x -x +y -y +z -z");
    }
    const Json tilt_deg = body.value("tilt_deg", Json(0.0));
    if (!tilt_deg.is_number() || std::abs(tilt_deg.get<double>()) > 90) {
      return bad_field("tilt_deg", "an angle from -90 to 90");
    }
    done = parts_.bench->turn(device, *pose, tilt_deg.get<double>());
  } else if (what == "lean") {
    done = parts_.bench->lean(device);
  } else if (what == "knock") {
    done = parts_.bench->knock(device);
  } else if (what == "unplug" || what == "plug") {
    done = parts_.bench->set_plugged(device, what == "plug");
  } else if (what == "swap") {
    const std::string other = serial->empty() ? "MOS2A99999999" : *serial;
    if (other.size() > 16 ||
        other.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789") != std::string::npos) {
      return bad_field("serial", "up to 16 capital letters and digits");
    }
    done = parts_.bench->swap(device, other);
  } else {
    return bad_field("do", "turn, lean, knock, unplug, plug or swap");
  }
  return done ? answer(200, {{"lane", lane}}) : refusal(done.error());
}

}  // namespace sixpoint::station

#include "station/page/api_answers.h"

#include <algorithm>
#include <array>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"
#include "db/name_rule.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

int http_status(ErrorCode code) {
  switch (code) {
    case ErrorCode::usage:
    case ErrorCode::bad_data:
    case ErrorCode::configuration:
      return 400;
    case ErrorCode::no_input:
      return 404;
    case ErrorCode::permission:
      return 403;
    case ErrorCode::cannot_create:
      return 409;
    case ErrorCode::device_unavailable:
      return 503;
    default:
      return 500;
  }
}

struct Route {
  std::string_view name;
  std::vector<std::string_view> keys;
};

const auto& post_routes() {
  static const std::array<Route, 19> kRoutes = {{
      {"session", {"code"}},
      {"operator", {"name", "pin"}},
      {"code", {}},
      {"run", {"lane", "operator", "serial", "write", "last_run"}},
      {"capture", {"lane", "operator", "serial", "write", "last_run"}},
      {"scan", {"serial", "dismiss"}},
      {"check", {"file", "save"}},
      {"check-units", {"serial", "action", "operator", "reason"}},
      {"station-lock", {"operator", "reason", "new_baseline"}},
      {"repair", {"folder", "output", "calibration_file"}},
      {"repair/cancel", {}},
      {"runs/print", {}},
      {"lanes/undo", {}},
      {"lanes/stop", {}},
      {"lanes/placed", {}},
      {"lanes/jig-free", {}},
      {"lanes/take", {"operator"}},
      {"lanes/scan", {"serial"}},
      {"lanes/hand", {"do", "pose", "tilt_deg", "serial"}},
  }};
  return kRoutes;
}

}  // namespace

std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

ApiAnswer answer(int status, const Json& json) {
  return {status, "application/json", dump(json), {}};
}

ApiAnswer refusal(int status, std::string_view code, std::string_view what, std::string_view hint) {
  Json json;
  json["error"]["code"] = code;
  json["error"]["what"] = what;
  json["error"]["hint"] = hint;
  return answer(status, json);
}

ApiAnswer refusal(const Error& error) {
  const std::string what =
      error.where.empty() ? error.what : fmt::format("{}: {}", error.where, error.what);
  return refusal(http_status(error.code), to_string(error.code), what, error.hint);
}

ApiAnswer unknown_route() {
  return refusal(404, "not_found", "there is nothing at this address", "docs/station.md lists all");
}

ApiAnswer bad_field(std::string_view key, std::string_view wanted) {
  return refusal(400, "bad_request", fmt::format("'{}' must be {}", key, wanted));
}

std::optional<std::string> text_of(const Json& body, const char* key) {
  if (!body.contains(key) || body[key].is_null()) {
    return std::string();
  }
  if (!body[key].is_string()) {
    return std::nullopt;
  }
  auto text = body[key].get<std::string>();
  return db::check_name(text) ? std::optional(std::move(text)) : std::nullopt;
}

std::optional<ApiAnswer> refused_key(std::string_view route, const Json& body) {
  const auto found = std::ranges::find(post_routes(), route, &Route::name);
  if (found == post_routes().end()) {
    return std::nullopt;
  }
  for (const auto& [key, value] : body.items()) {
    if (std::ranges::find(found->keys, key) == found->keys.end()) {
      return refusal(
          400, "bad_request", fmt::format("'{}' is no key of this request", printable(key, 60)),
          found->keys.empty() ? "it has none"
                              : fmt::format("its keys are {}", fmt::join(found->keys, ", ")));
    }
  }
  return std::nullopt;
}

}  // namespace sixpoint::station

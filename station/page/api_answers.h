// Answers and the fields of bodies, for api*.cpp and event_stream.cpp alone.
//
//   ApiAnswer scanned(const nlohmann::ordered_json& body) {
//     if (const auto serial = text_of(body, "serial")) {
//       return answer(200, {{"serial", *serial}});
//     }
//     return bad_field("serial", "a text");
//   }
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "station/page/api.h"

namespace sixpoint::station {

inline constexpr std::size_t kMostText = 200;  // bytes of a name or serial number in a request
inline constexpr std::string_view kNameWanted = "a text of at most 200 bytes, without NUL";

std::string dump(const nlohmann::ordered_json& json);
ApiAnswer answer(int status, const nlohmann::ordered_json& json);
ApiAnswer refusal(int status, std::string_view code, std::string_view what,
                  std::string_view hint = "");
// With the HTTP status of the error's code, and 500 for defects and disks.
ApiAnswer refusal(const Error& error);
ApiAnswer bad_field(std::string_view key, std::string_view wanted);
ApiAnswer unknown_route();
// A text field of a JSON body; empty where it is missing. Nothing where it is no text, longer than
// kMostText, or none that the store takes (db::check_name()).
std::optional<std::string> text_of(const nlohmann::ordered_json& body, const char* key);
// The refusal of a key of the body that is none of its route's (docs/station.md, Routes; a lane's
// number and a run's id are left out of the route: "lanes/take"). A mistyped `Lane` would start
// lane 1. Nothing where all are its own, and for a route that is none.
std::optional<ApiAnswer> refused_key(std::string_view route, const nlohmann::ordered_json& body);

}  // namespace sixpoint::station

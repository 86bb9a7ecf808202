// How the API's parts answer and read bodies; for api*.cpp and event_stream.cpp alone.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "station/api.h"

namespace sixpoint::station {

inline constexpr std::size_t kMostText = 200;  // of names and serial numbers that come in

std::string dump(const nlohmann::ordered_json& json);
ApiAnswer answer(int status, const nlohmann::ordered_json& json);
ApiAnswer refusal(int status, std::string_view code, std::string_view what,
                  std::string_view hint = "");
ApiAnswer refusal(const Error& error);
ApiAnswer bad_field(std::string_view key, std::string_view wanted);
ApiAnswer unknown_route();
// A text of a JSON body; empty where it is not there. Nothing where it is no text or too long.
std::optional<std::string> text_of(const nlohmann::ordered_json& body, const char* key);

}  // namespace sixpoint::station

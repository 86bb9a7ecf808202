// What the files of an archive's plan and of its results have in common. For archive_*.cpp alone.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "repair/archive_plan.h"

namespace sixpoint::repair {

inline std::string hash_of(std::string_view text) {
  return to_hex(sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size())));
}

// get<T>() would convert a number with a fraction, or beyond T, at any price. Throws as at() does.
template <class T>
T integer_of(const nlohmann::ordered_json& json) {
  if (json.is_number_unsigned()) {
    if (const auto number = json.get<std::uint64_t>(); std::in_range<T>(number)) {
      return static_cast<T>(number);
    }
  } else if (json.is_number_integer()) {
    if (const auto number = json.get<std::int64_t>(); std::in_range<T>(number)) {
      return static_cast<T>(number);
    }
  }
  return nlohmann::ordered_json().at("an integer").get<T>();
}

inline nlohmann::ordered_json error_to_json(const Error& error) {
  return {{"code", static_cast<int>(error.code)},
          {"what", error.what},
          {"where", encode_path(error.where)},
          {"hint", error.hint}};
}

// bad_data for a code that is none; throws as at() does for what is missing.
inline Result<Error> error_from_json(const nlohmann::ordered_json& json) {
  const int code = integer_of<int>(json.at("code"));
  if (!is_error_code(code)) {
    return fail(ErrorCode::bad_data, "an error of no known kind", {}, "make the plan anew");
  }
  SIXPOINT_ASSIGN(std::string where, decode_path(json.at("where").get<std::string>()));
  return Error{static_cast<ErrorCode>(code), json.at("what").get<std::string>(), std::move(where),
               json.at("hint").get<std::string>()};
}

}  // namespace sixpoint::repair

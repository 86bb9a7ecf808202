// What the files of an archive's plan and of its results have in common. For this room alone.
//
//   encode_path("100%.gt3x");  // "100%25.gt3x": any bytes as printable ASCII
//   const auto files = integer_of<std::size_t>(json.at("files"));
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/result.h"

namespace sixpoint::repair {

// Every byte that is no printable ASCII, and '%', becomes %NN.
std::string encode_path(std::string_view path);
// bad_data for what encode_path() does not write.
Result<std::string> decode_path(std::string_view text);

nlohmann::ordered_json error_to_json(const Error& error);
// bad_data for a code that is none; throws as at() does for what is missing.
Result<Error> error_from_json(const nlohmann::ordered_json& json);

// get<T>() would convert a number with a fraction, or beyond T, without an error. Throws as at()
// does.
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

}  // namespace sixpoint::repair

// JSON that others wrote.
//
//   const auto scenario = parse_json(R"({"seed": 3})");  // {"seed": 3}
//   parse_json("{").is_discarded();                      // true: it is no JSON
//   why_no_json("{\n1e400}");                            // "line 2 at '1e400'"
//
// A text of brackets alone parses and then ends the program where it is copied or printed, because
// both call themselves for each level. What lies deeper than 100 objects and lists is taken for no
// JSON: a format of this project has fewer than ten levels.
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace sixpoint {

bool nests_too_deep(std::string_view json);

// Discarded where the text is no JSON or nests too deep.
template <class Json = nlohmann::ordered_json>
Json parse_json(std::string_view text) {
  return nests_too_deep(text) ? Json(Json::value_t::discarded)
                              : Json::parse(text.begin(), text.end(), nullptr, false);
}

// Where a text that parse_json() discarded ceases to be JSON, as words for an error; empty for JSON.
std::string why_no_json(std::string_view text);

}  // namespace sixpoint

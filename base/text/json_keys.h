// A key that stands twice in one object of a JSON text. A parser keeps one of the two values and drops
// the other without a word, so a reader of files that people write asks first.
//
//   doubled_json_key(R"({"faults": [{"at_s": 1, "at_s": 2}]})");  // "/faults/0/at_s"
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace sixpoint {

// The first such key, as a path from the top; none where every key stands once. Of a text that is no
// JSON, and of what lies deeper than 100 objects and lists, it says nothing: that is the parser's work.
std::optional<std::string> doubled_json_key(std::string_view json);

}  // namespace sixpoint

#include "base/text/json_text.h"

namespace sixpoint {

bool nests_too_deep(std::string_view json) {
  constexpr int kMostLevels = 100;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (c == '"') {
      in_string = !in_string;
    } else if (in_string) {
      i += c == '\\' ? 1 : 0;  // the character behind it ends nothing
    } else if (c == '[' || c == '{') {
      if (++depth > kMostLevels) {
        return true;
      }
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

}  // namespace sixpoint

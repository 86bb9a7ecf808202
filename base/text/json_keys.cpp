#include "base/text/json_keys.h"

#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace sixpoint {

namespace {

using Json = nlohmann::json;

constexpr std::size_t kDeepest = 100;  // a text of brackets alone must not fill the memory

// Walks through the text and keeps the keys of those objects alone in which it is.
class KeyWatch : public nlohmann::json_sax<Json> {
 public:
  std::optional<std::string> take_doubled() { return std::move(doubled_); }

  bool null() override { return value(); }
  bool boolean(bool /*given*/) override { return value(); }
  bool number_integer(number_integer_t /*given*/) override { return value(); }
  bool number_unsigned(number_unsigned_t /*given*/) override { return value(); }
  bool number_float(number_float_t /*given*/, const string_t& /*text*/) override { return value(); }
  bool string(string_t& /*given*/) override { return value(); }
  bool binary(binary_t& /*given*/) override { return value(); }
  bool start_object(std::size_t /*size*/) override { return begin(); }
  bool end_object() override { return end(); }
  bool start_array(std::size_t /*size*/) override { return begin(); }
  bool end_array() override { return end(); }
  bool key(string_t& name) override {
    Level& here = levels_.back();
    const bool is_new = here.keys.insert(name).second;
    here.key = name;
    if (!is_new) {
      doubled_ = path();
    }
    return is_new;
  }
  bool parse_error(std::size_t /*at*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& /*error*/) override {
    return false;
  }

 private:
  struct Level {
    std::set<std::string> keys;
    std::optional<std::string> key;  // of an object: the last one
    std::size_t values = 0;          // of a list: so many are behind
  };

  bool value() {
    if (!levels_.empty()) {
      ++levels_.back().values;
    }
    return true;
  }
  bool begin() {
    levels_.emplace_back();
    return levels_.size() <= kDeepest;
  }
  bool end() {
    levels_.pop_back();
    return value();
  }
  std::string path() const {
    std::string text;
    for (const Level& level : levels_) {
      text += '/';
      text += level.key ? *level.key : std::to_string(level.values);
    }
    return text;
  }

  std::vector<Level> levels_;
  std::optional<std::string> doubled_;
};

}  // namespace

std::optional<std::string> doubled_json_key(std::string_view json) {
  KeyWatch watch;
  // What is no JSON is told by the parser that reads the text behind this.
  static_cast<void>(Json::sax_parse(json, &watch));
  return watch.take_doubled();
}

}  // namespace sixpoint

#include "gap/benchmark/answers.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "gap/benchmark/json_lines.h"
#include "sim/effects/effect.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;
using Named = std::vector<std::pair<std::string, double>>;

tl::unexpected<Error> bad_answer(const std::string& source, std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), source,
              "docs/gap-benchmark.md says what an answer holds");
}

std::string shortened(const std::string& text) { return text.substr(0, 40); }

// The member `key` of an object, or null.
const Json* member(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  return json.is_object() && found != json.end() ? &*found : nullptr;
}

Result<double> probability_of(const Json& json, const std::string& source) {
  const Json* value = member(json, "probability");
  if (value == nullptr || !value->is_number() || !(value->get<double>() >= 0) ||
      !(value->get<double>() <= 1)) {
    return bad_answer(source, "a probability between 0 and 1 is missing");
  }
  return value->get<double>();
}

Result<Named> names_of(const Json& list, const std::string& source) {
  Named named;
  std::set<std::string> seen;
  if (!list.is_array()) {
    return bad_answer(source, "effects and candidates are lists");
  }
  for (const Json& entry : list) {
    const Json* name = member(entry, "name");
    if (name == nullptr || !name->is_string()) {
      return bad_answer(source, "an effect needs a name");
    }
    const auto text = name->get<std::string>();
    if (!sim::find_effect(text)) {
      return bad_answer(source, fmt::format("the catalogue has no effect \"{}\"", shortened(text)));
    }
    if (!seen.insert(text).second) {
      return bad_answer(source, fmt::format("the effect {} is there twice", text));
    }
    SIXPOINT_ASSIGN(const double probability, probability_of(entry, source));
    named.emplace_back(text, probability);
  }
  return named;
}

Result<Place> place_of(const Json& json, const std::string& source) {
  const Json* axis = member(json, "axis");
  const Json* segment = member(json, "segment");
  const int index = axis != nullptr && axis->is_string() ? axis_of(axis->get<std::string>()) : -1;
  if (index < 0 || segment == nullptr || !segment->is_string()) {
    return bad_answer(source, "a place needs axis (X, Y, Z) and segment");
  }
  return Place{index, segment->get<std::string>()};
}

// Where the unknown is.
Status read_where(const Json& unknown, const std::string& source, Answer& answer) {
  const Json* places = member(unknown, "where");
  if (places == nullptr) {
    return {};
  }
  if (!places->is_array()) {
    return bad_answer(source, "unknown.where is a list");
  }
  answer.where.emplace();
  for (const Json& entry : *places) {
    SIXPOINT_ASSIGN(Place place, place_of(entry, source));
    answer.where->insert(std::move(place));
  }
  return {};
}

Status add_lines(std::string_view text, const std::string& path, std::vector<Answer>& answers) {
  for (const auto& [line, row] : rows_of(text)) {
    const std::string source = fmt::format("{}, line {}", path, line);
    const Json json = parse_json(row);
    const Json* bundle = member(json, "bundle");
    if (bundle == nullptr || !bundle->is_string()) {
      return bad_answer(source, "a line is one JSON object with the member bundle");
    }
    SIXPOINT_ASSIGN(Answer answer, parse_answer(json, bundle->get<std::string>(), source));
    answers.push_back(std::move(answer));
  }
  return {};
}

}  // namespace

Result<Answer> parse_answer(const Json& json, const std::string& bundle,
                            const std::string& source) {
  const Json* effects = member(json, "effects");
  const Json* unknown = member(json, "unknown");
  const Json* present = unknown == nullptr ? nullptr : member(*unknown, "present");
  if (effects == nullptr || present == nullptr || !present->is_boolean()) {
    return bad_answer(source, "an answer needs effects, and unknown with present and probability");
  }
  Answer answer;
  answer.bundle = bundle;
  answer.unknown = present->get<bool>();
  SIXPOINT_ASSIGN(answer.unknown_probability, probability_of(*unknown, source));
  SIXPOINT_ASSIGN(answer.effects, names_of(*effects, source));
  if (const Json* candidates = member(json, "candidates"); candidates != nullptr) {
    SIXPOINT_ASSIGN(answer.candidates, names_of(*candidates, source));
  }
  SIXPOINT_CHECK(read_where(*unknown, source, answer));
  return answer;
}

Result<std::vector<Answer>> read_answers(FileSystem& files, const std::string& path) {
  std::vector<Answer> answers;
  SIXPOINT_ASSIGN(const FileInfo info, files.info(path));
  if (!info.is_folder) {
    SIXPOINT_ASSIGN(const Bytes text, read_file(files, path));
    SIXPOINT_CHECK(add_lines(as_text(text), path, answers));
  } else {
    SIXPOINT_ASSIGN(const std::vector<std::string> names, files.list(path));
    constexpr std::string_view kEnding = ".json";
    for (const std::string& name : names) {
      if (name.ends_with(kEnding)) {
        const std::string file = fmt::format("{}/{}", path, name);
        SIXPOINT_ASSIGN(const Bytes text, read_file(files, file));
        const Json json = parse_json(as_text(text));
        SIXPOINT_ASSIGN(Answer answer,
                        parse_answer(json, name.substr(0, name.size() - kEnding.size()), file));
        answers.push_back(std::move(answer));
      }
    }
  }
  std::set<std::string> seen;
  for (const Answer& answer : answers) {
    if (!seen.insert(answer.bundle).second) {
      return bad_answer(path,
                        fmt::format("the bundle {} has two answers", shortened(answer.bundle)));
    }
  }
  return answers;
}

std::string answer_line(const Answer& answer) {
  const auto list = [](const Named& named) {
    Json entries = Json::array();
    for (const auto& [name, probability] : named) {
      entries.push_back({{"name", name}, {"probability", probability}});
    }
    return entries;
  };
  Json json;
  json["bundle"] = answer.bundle;
  json["effects"] = list(answer.effects);
  json["unknown"] = {{"present", answer.unknown}, {"probability", answer.unknown_probability}};
  if (answer.where) {
    Json& where = json["unknown"]["where"] = Json::array();
    for (const auto& [axis, segment] : *answer.where) {
      where.push_back({{"axis", axis_name(axis)}, {"segment", segment}});
    }
  }
  json["candidates"] = list(answer.candidates);
  // A folder's name may hold bytes that are no UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace sixpoint::gap

// Answers of any program to the bundles of a benchmark, in the smallest form that can be scored.
//
//   SIXPOINT_ASSIGN(const std::vector<Answer> answers, read_answers(env.files, "answers.jsonl"));
//   std::cout << answer_line(answers.front()) << '\n';
//
// One JSON object a bundle (docs/gap-benchmark.md):
//
//     {"bundle": "b1c2d3e4",
//      "effects": [{"name": "tilt", "probability": 0.97}],              strongest first
//      "unknown": {"present": true, "probability": 0.9,
//                  "where": [{"axis": "X", "segment": "ramp_up"}]},    `where` may be left out
//      "candidates": [{"name": "drift", "probability": 0.02}]}         may be left out
//
// Other members are not read, so that documents of `gap diagnose --json` are answers, too. Answers
// are not trusted: what is not of this form is bad_data, with the file and the line.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "base/result.h"
#include "gap/benchmark/labels.h"

namespace sixpoint::gap {

struct Answer {
  std::string bundle;
  std::vector<std::pair<std::string, double>> effects;     // named, strongest first
  std::vector<std::pair<std::string, double>> candidates;  // those with a probability, named or not
  bool unknown = false;
  double unknown_probability = 0;
  std::optional<std::set<Place>> where;  // of what is unknown; none: not said
};

// `source` is for the message. bad_data where a member is missing or of another type, a probability
// is not between 0 and 1, a name is not in the catalogue or twice, or a place is none.
Result<Answer> parse_answer(const nlohmann::ordered_json& json, const std::string& bundle,
                            const std::string& source);

// JSON Lines (a file), or a folder whose files NAME.json answer for the bundles NAME. bad_data also
// for two answers to one bundle, a file above 64 MB, a line that is no JSON (NaN is none).
Result<std::vector<Answer>> read_answers(FileSystem& files, const std::string& path);

// One line of JSON Lines, without the line's end.
std::string answer_line(const Answer& answer);

}  // namespace sixpoint::gap

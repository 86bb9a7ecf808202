// The sealed labels of a benchmark: what was put into each bundle, and how much of it shows.
//
//   SIXPOINT_ASSIGN(const TrialLabel label, label_of(trial, "b1c2d3e4"));
//   Labels labels;
//   labels.seed = 7;
//   labels.trials.push_back(label);
//   const std::string text = labels_text(labels);  // JSON Lines: a header, then one bundle a line
//   SIXPOINT_ASSIGN(const Labels again, parse_labels(text));
//
// Plain data. The same trial gives the same label.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"
#include "gap/challenge/trials.h"

namespace sixpoint::gap {

// An axis, 0 to 2, and a segment's name.
using Place = std::pair<int, std::string>;

struct LabelledEffect {
  std::string name;
  std::string family;          // family_of(name)
  double severity = 1;         // as a multiple of a typical size
  double size_over_bound = 0;  // shown.h: at 1 the recording shows it half of the time, at best
  // A method is asked to name it: twice the bound and more.
  bool must() const { return size_over_bound >= 2; }
};

struct TrialLabel {
  std::string bundle;
  TrialKind kind = TrialKind::none;
  std::vector<LabelledEffect> effects;  // the dominant one of a realistic unit first
  // Of a kind outside the catalogue: where it shows by 3 standard deviations and more.
  std::set<Place> where;
};

struct Labels {
  std::uint64_t seed = 0;
  std::string protocol;
  std::vector<TrialLabel> trials;  // sorted by bundle; no two of one name
};

// Simulates the trial with and without each effect. Gradual effects are simulated at ten times a
// typical size, where rounding hides nothing, and scaled back; others as they are.
Result<TrialLabel> label_of(const GapTrial& trial, const std::string& bundle);

// A name that says nothing of what is in the bundle: "b" and 16 hex digits, from seed and index.
std::string bundle_name(std::uint64_t seed, std::uint64_t index);

std::string labels_text(const Labels& labels);

// bad_data, with the line, where a line is no JSON of the form, a name is twice, a number is not
// finite, or there are no bundles.
Result<Labels> parse_labels(std::string_view text);

// "X", "Y", "Z"; -1 for anything else.
int axis_of(std::string_view name);
std::string axis_name(int axis);

}  // namespace sixpoint::gap

// What `gap challenge` says of its trials: JSON, lines and a page.
//
//   const gap::Scores scores = gap::score(outcomes, setting.strip);
//   print_json(context, scores_json(setting, scores, outcomes));
//   for (const auto& [what, value] : scores_lines(scores)) {
//     context.text() << what << ' ' << value << '\n';
//   }
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cli/context.h"
#include "gap/challenge/score.h"
#include "gap/challenge/suggestion.h"

namespace sixpoint::cli {

struct ChallengeSetting {
  std::uint64_t seed = 1;
  std::string protocol = "engineering";
  bool strip = false;
  std::string recording;  // a bundle or a .gt3x file to which effects are added
  // What the diagnosis says of that bundle as it is.
  std::set<std::string> own_effects;
  bool own_unknown = false;
};

Json scores_json(const ChallengeSetting& setting, const gap::Scores& scores,
                 const std::vector<gap::Outcome>& outcomes);

// What people read: the same lines on the terminal and in the page.
std::vector<std::pair<std::string, std::string>> scores_lines(const gap::Scores& scores);
std::string scores_page(const ChallengeSetting& setting, const gap::Scores& scores,
                        const std::vector<gap::Outcome>& outcomes);

// What the segment suggested first is worth.
Json gain_json(const gap::Gain& gain);
std::vector<std::pair<std::string, std::string>> gain_lines(const gap::Gain& gain);

// {right, of, share, interval}, and the same for people.
Json to_json(const gap::Share& share);
std::string text_of(const gap::Share& share);

}  // namespace sixpoint::cli

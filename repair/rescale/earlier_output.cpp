#include "repair/rescale/earlier_output.h"

#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "repair/rescale/sources.h"

namespace sixpoint::repair {

std::string recipe_digest(const Recipe& recipe) {
  nlohmann::ordered_json content = {
      {"rules", recipe.rules},
      {"constants", recipe.constants ? digest_of(*recipe.constants) : std::string()},
      {"rotation_undone", recipe.rotation_undone},
      {"wide", recipe.wide},
      {"store_only", recipe.store_only}};
  if (recipe.salvaged) {
    content["salvaged"] = true;
  }
  return text_sha256(content.dump());
}

EarlierOutput judge_earlier_output(const std::optional<FoundOutput>& found,
                                   const std::optional<KnownOutput>& known,
                                   const std::string& input_sha256, const std::string& recipe) {
  if (!found) {
    return EarlierOutput::none;
  }
  if (found->input_sha256.empty() || found->input_sha256 != input_sha256) {
    return EarlierOutput::foreign;
  }
  const bool is_known = known && known->input_sha256 == input_sha256 &&
                        !(found->made_at && *found->made_at > known->as_of);
  if (is_known && known->sha256 != found->sha256) {
    return EarlierOutput::changed;
  }
  return found->recipe == recipe ? EarlierOutput::done : EarlierOutput::outdated;
}

}  // namespace sixpoint::repair

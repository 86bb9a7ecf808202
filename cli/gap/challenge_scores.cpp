#include "cli/gap/challenge_scores.h"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text/counted.h"
#include "base/text/html.h"

namespace sixpoint::cli {

using gap::Outcome;
using gap::Scores;
using gap::Share;

Json to_json(const Share& share) {
  Json json;
  json["right"] = static_cast<std::uint64_t>(share.right);
  json["of"] = static_cast<std::uint64_t>(share.of);
  json["share"] = share.of > 0 ? Json(share.right / share.of) : Json(nullptr);
  json["interval"] = share.interval();
  return json;
}

std::string text_of(const Share& share) {
  const auto [low, high] = share.interval();
  return share.of == 0
             ? "-"
             : fmt::format("{:.0f} of {:.0f} = {:.1f} % ({:.1f} to {:.1f} %)", share.right,
                           share.of, 100 * share.right / share.of, 100 * low, 100 * high);
}

namespace {

Json mean_json(const gap::MeanOfEffects& mean) {
  return {{"mean", number(mean.mean)},
          {"interval", {number(mean.interval[0]), number(mean.interval[1])}}};
}

std::string mean_text(const gap::MeanOfEffects& mean) {
  return fmt::format("{:.3f} ({:.3f} to {:.3f})", mean.mean, mean.interval[0], mean.interval[1]);
}

Json outcome_json(const Outcome& outcome, std::size_t index) {
  Json entry;
  entry["trial"] = index;
  entry["kind"] = gap::to_string(outcome.kind);
  entry["truth"] = Json::array();
  for (const gap::TrialEffect& effect : outcome.truth) {
    entry["truth"].push_back({{"name", effect.name}, {"severity", effect.severity}});
  }
  entry["verdict"] = outcome.verdict;
  entry["named"] = Json::array();
  for (const auto& [name, probability] : outcome.named) {
    entry["named"].push_back({{"name", name}, {"probability", number(probability)}});
  }
  entry["unknown"] = outcome.unknown;
  entry["unknown_probability"] = number(outcome.unknown_probability);
  entry["honest"] = outcome.honest();
  entry["confidently_wrong"] = outcome.confidently_wrong();
  entry["seconds"] = outcome.seconds;
  if (!outcome.failure.empty()) {
    entry["failure"] = outcome.failure;
  }
  return entry;
}

}  // namespace

Json gain_json(const gap::Gain& gain) {
  Json json;
  json["trials"] = static_cast<std::uint64_t>(gain.followed);
  json["without_suggestion"] = static_cast<std::uint64_t>(gain.nothing_to_do);
  json["minutes"] = number(gain.minutes);
  json["expected_nats"] = number(gain.expected_nats);
  json["named"] = {{"before", to_json(gain.named_before)}, {"after", to_json(gain.named_after)}};
  json["named_gain"] = mean_json(gain.named_gain);
  json["probability"] = {{"before", mean_json(gain.probability_before)},
                         {"after", mean_json(gain.probability_after)}};
  json["probability_gain"] = mean_json(gain.probability_gain);
  json["false_names"] = {{"before", to_json(gain.false_before)},
                         {"after", to_json(gain.false_after)}};
  json["by_segment"] = Json::array();
  for (const auto& [segment, own] : gain.by_segment) {
    json["by_segment"].push_back({{"segment", segment},
                                  {"trials", static_cast<std::uint64_t>(own.trials)},
                                  {"named_before", to_json(own.before)},
                                  {"named_after", to_json(own.after)}});
  }
  return json;
}

std::vector<std::pair<std::string, std::string>> gain_lines(const gap::Gain& gain) {
  std::vector<std::pair<std::string, std::string>> lines = {
      {"with the segment suggested first: trials",
       fmt::format("{:.0f} ({:.0f} without a suggestion), {:.1f} minutes more each", gain.followed,
                   gain.nothing_to_do, gain.minutes)},
      {"  ... effects there and named, before", text_of(gain.named_before)},
      {"  ... after", text_of(gain.named_after)},
      {"  ... gain (95 %)", mean_text(gain.named_gain)},
      {"  ... probability of what is there, before", mean_text(gain.probability_before)},
      {"  ... after", mean_text(gain.probability_after)},
      {"  ... gain (95 %)", mean_text(gain.probability_gain)},
      {"  ... names of what is not there, before", text_of(gain.false_before)},
      {"  ... after", text_of(gain.false_after)}};
  for (const auto& [segment, own] : gain.by_segment) {
    lines.emplace_back("  ... " + segment,
                       fmt::format("{:.0f} trials: {:.0f} -> {:.0f} of {:.0f} effects named",
                                   own.trials, own.before.right, own.after.right, own.after.of));
  }
  return lines;
}

Json scores_json(const ChallengeSetting& options, const Scores& scores,
                 const std::vector<Outcome>& outcomes) {
  Json json = document("gap-challenge");
  json["trials"] = outcomes.size();
  json["seed"] = options.seed;
  json["protocol"] = options.protocol;
  json["strip"] = options.strip;
  if (!options.recording.empty()) {
    json["recording"] = options.recording;
    json["own_effects"] = options.own_effects;
    json["own_unknown"] = options.own_unknown;
  }
  Json& result = json["scores"];
  for (const auto& [name, value] :
       {std::pair("single_first_right", to_json(scores.first)),
        {"single_alone_and_right", to_json(scores.exact)},
        {"single_first_right_observable", to_json(scores.first_observable)},
        {"single_first_right_observable_severity_1", to_json(scores.first_large)},
        {"single_family_right", to_json(scores.family)},
        {"none_alarms", to_json(scores.alarms)},
        {"pair_f1", number(scores.f1())},
        {"realistic_dominant_first", to_json(scores.dominant)},
        {"realistic_recall", to_json(scores.recall)},
        {"realistic_precision", to_json(scores.precise)},
        {"realistic_exact_set", to_json(scores.exact_set)},
        {"realistic_needless_unknown", to_json(scores.needless)},
        {"withheld_honest", to_json(scores.withheld_honest)},
        {"withheld_confidently_wrong", to_json(scores.withheld_wrong)},
        {"expected_calibration_error", number(scores.calibration_error())},
        {"unknown_calibration_error", number(scores.unknown_calibration_error())},
        {"failures", to_json(scores.failures)}}) {
    result[name] = value;
  }
  json["calibration"] = Json::array();
  for (const Scores::Bin& bin : scores.bins) {
    json["calibration"].push_back({{"probability", bin.of > 0 ? Json(bin.sum_p / bin.of) : Json()},
                                   {"right", bin.of > 0 ? Json(bin.right / bin.of) : Json()},
                                   {"candidates", static_cast<std::uint64_t>(bin.of)}});
  }
  json["by_effect"] = Json::array();
  for (const auto& [name, effect] : scores.by_effect) {
    json["by_effect"].push_back({{"name", name},
                                 {"first_right", to_json(effect.first)},
                                 {"family_right", to_json(effect.family)},
                                 {"missed", static_cast<std::uint64_t>(effect.missed)},
                                 {"not_observable", static_cast<std::uint64_t>(effect.blind)}});
  }
  json["outcomes"] = Json::array();
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    json["outcomes"].push_back(outcome_json(outcomes[i], i));
  }
  const double answered = scores.failures.of - scores.failures.right;
  json["seconds"]["mean"] = number(answered > 0 ? scores.seconds_sum / answered : 0);
  json["seconds"]["max"] = scores.seconds_max;
  return json;
}

std::vector<std::pair<std::string, std::string>> scores_lines(const Scores& scores) {
  return {{"one effect: first-named right", text_of(scores.first)},
          {"  ... and nothing else named", text_of(scores.exact)},
          {"  ... where this protocol can show it", text_of(scores.first_observable)},
          {"  ... and at least of typical size", text_of(scores.first_large)},
          {"  ... right family", text_of(scores.family)},
          {"two effects: F1 of the set",
           std::isnan(scores.f1()) ? "-" : fmt::format("{:.3f}", scores.f1())},
          {"nothing missing: alarms", text_of(scores.alarms)},
          {"realistic: dominant effect first", text_of(scores.dominant)},
          {"  ... effects named (recall)", text_of(scores.recall)},
          {"  ... names that are right (precision)", text_of(scores.precise)},
          {"  ... exactly the effects that are there", text_of(scores.exact_set)},
          {"  ... needless unknown", text_of(scores.needless)},
          {"withheld: unknown, or right family", text_of(scores.withheld_honest)},
          {"withheld: confidently wrong", text_of(scores.withheld_wrong)},
          {"expected calibration error", fmt::format("{:.3f}", scores.calibration_error())},
          {"  ... of unknown", fmt::format("{:.3f}", scores.unknown_calibration_error())},
          {"failures of the program", text_of(scores.failures)}};
}

std::string scores_page(const ChallengeSetting& options, const Scores& scores,
                        const std::vector<Outcome>& outcomes) {
  std::string html =
      html_head("Blind check of the gap diagnosis", "td.n{text-align:right}.bad{color:#b00020}");
  html += fmt::format("<p>{}, {} protocol, seed {}{}. Shares with 95 % intervals.</p><table>",
                      counted(outcomes.size(), "trial"), options.protocol, options.seed,
                      options.strip ? ", true effects taken out of the catalogue" : "");
  for (const auto& [what, value] : scores_lines(scores)) {
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>", what, value);
  }
  html +=
      "</table><h2>By effect</h2><table><tr><th>effect<th>first-named right<th>family right"
      "<th>missed<th>not observable</tr>";
  for (const auto& [name, effect] : scores.by_effect) {
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{:.0f}</td><td class=\"n\">{:.0f}"
        "</td></tr>",
        name, text_of(effect.first), text_of(effect.family), effect.missed, effect.blind);
  }
  html += "</table><h2>Calibration</h2><table><tr><th>said<th>was<th>candidates</tr>";
  for (const Scores::Bin& bin : scores.bins) {
    if (bin.of > 0) {
      html += fmt::format("<tr><td>{:.2f}</td><td>{:.2f}</td><td class=\"n\">{:.0f}</td></tr>",
                          bin.sum_p / bin.of, bin.right / bin.of, bin.of);
    }
  }
  html +=
      "</table><h2>Trials</h2><table><tr><th>#<th>truth (severity)<th>named (probability)"
      "<th>verdict</tr>";
  const auto escaped = [](const std::string& text) { return html_escaped(printable(text, 200)); };
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    std::vector<std::string> truth;
    for (const gap::TrialEffect& effect : outcome.truth) {
      truth.push_back(fmt::format("{} ({:.2f})", effect.name, effect.severity));
    }
    std::vector<std::string> named;
    for (const auto& [name, probability] : outcome.named) {
      named.push_back(fmt::format("{} ({:.2f})", name, probability));
    }
    if (outcome.unknown) {
      named.emplace_back("unknown");
    }
    html += fmt::format("<tr{}><td class=\"n\">{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                        outcome.confidently_wrong() ? " class=\"bad\"" : "", i,
                        fmt::join(truth, ", "), escaped(fmt::format("{}", fmt::join(named, ", "))),
                        escaped(outcome.failure.empty() ? outcome.verdict : outcome.failure));
  }
  html += "</table>";
  return html.append(kHtmlEnd);
}

}  // namespace sixpoint::cli

// sixpoint gap score ANSWERS --labels FILE: any program's answers against sealed labels.
#include <cmath>

#include <fmt/format.h>

#include "base/sha256.h"
#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/gap/challenge_scores.h"
#include "cli/gap/gap_commands.h"
#include "gap/benchmark/benchmark_score.h"

namespace sixpoint::cli {
namespace {

struct GapScoreCommandOptions {
  std::string answers;
  std::string labels;
  std::uint64_t seed = gap::BenchmarkOptions{}.seed;
  bool json = false;
};

Json benchmark_json(const gap::BenchmarkScores& scores) {
  Json json;
  json["bundles"] = scores.bundles;
  json["missing"] = scores.missing;
  json["kinds"] = scores.kinds;
  json["measures"] = Json::array();
  for (const gap::Measure& measure : scores.measures) {
    json["measures"].push_back(
        {{"name", measure.name},
         {"value", number(measure.value)},
         {"interval", {number(measure.interval[0]), number(measure.interval[1])}},
         {"interval_by", measure.interval_by},
         {"of", static_cast<std::uint64_t>(measure.of)}});
  }
  json["power"] = Json::array();
  for (const gap::PowerStep& step : scores.power) {
    const bool last = step.high > 1e6;
    json["power"].push_back({{"size_over_bound_from", step.low},
                             {"to", last ? Json(nullptr) : Json(step.high)},
                             {"named", to_json(step.named)}});
  }
  return json;
}

void print_gap_score(const gap::BenchmarkScores& scores, Context& context) {
  context.text() << fmt::format("{}, {} without an answer\n", counted(scores.bundles, "bundle"),
                                scores.missing);
  for (const gap::Measure& measure : scores.measures) {
    const std::string text =
        std::isfinite(measure.value)
            ? fmt::format("{:6.3f}  [{:.3f}, {:.3f}]  of {:.0f} ({})", measure.value,
                          measure.interval[0], measure.interval[1], measure.of, measure.interval_by)
            : "     -";
    context.text() << fmt::format("{:<26} {}\n", measure.name, text);
  }
  context.text() << "named, by size over the bound:\n";
  for (const gap::PowerStep& step : scores.power) {
    context.text() << fmt::format("  {:<12} {}\n",
                                  step.high > 1e6 ? fmt::format("{} and more", step.low)
                                                  : fmt::format("{} to {}", step.low, step.high),
                                  text_of(step.named));
  }
}

Status run_gap_score(const GapScoreCommandOptions& options, Context& context) {
  if (options.answers.empty()) {
    return fail(ErrorCode::usage, "ANSWERS is required", {}, "name the file or folder of answers");
  }
  FileSystem& files = context.env.files;
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, options.labels));
  SIXPOINT_ASSIGN(const gap::Labels labels, gap::parse_labels(as_text(text)));
  SIXPOINT_ASSIGN(const auto answers, gap::read_answers(files, options.answers));
  gap::BenchmarkOptions how;
  how.seed = options.seed;
  SIXPOINT_ASSIGN(const gap::BenchmarkScores scores, gap::score_answers(labels, answers, how));
  if (!options.json) {
    print_gap_score(scores, context);
    return {};
  }
  Json json = document("gap-score");
  json["labels_sha256"] = text_sha256(as_text(text));
  json["protocol"] = labels.protocol;
  json["challenge_seed"] = labels.seed;
  json["bootstrap_seed"] = options.seed;
  json.update(benchmark_json(scores));
  return print_json(context, json);
}

}  // namespace

void add_gap_score(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapScoreCommandOptions>(
      gap_command, context, "gap-score", "score",
      "scores any program's answers to an exported challenge", run_gap_score);
  command.add_option(
      "ANSWERS,--answers", options.answers,
      "a JSON Lines file, or a folder with NAME.json for each bundle NAME; needed, in "
      "one of the two ways");
  command.add_option("--labels", options.labels, "the labels that gap challenge --export wrote")
      ->required();
  command.add_option("--seed", options.seed, "of the bootstrap");
}

}  // namespace sixpoint::cli

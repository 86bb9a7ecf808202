// sixpoint gap answers FOLDER --method NAME: what a method of this project answers to the bundles
// of gap challenge --export.
#include <algorithm>
#include <cmath>

#include <CLI/App.hpp>
#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "base/text/json_text.h"
#include "cli/command.h"
#include "cli/gap/gap_commands.h"
#include "cli/output.h"
#include "cli/workers.h"
#include "gap/benchmark/answers.h"
#include "gap/benchmark/sequential.h"
#include "gap/explain/decisions.h"
#include "gap/judge/diagnose.h"
#include "gap/recording/bundle.h"

namespace sixpoint::cli {
namespace {

struct GapAnswersCommandOptions {
  std::string folder;
  std::string method = "diagnose";
  std::string output;
  unsigned jobs = 1;
  bool dry_run = false;
  OutputOptions outputs;
  bool json = false;
};

// The same evidence for a world where the catalogue holds everything: effects whose nats are
// accepted, whatever speaks for unknown causes, and nothing is unknown.
gap::Answer closed_world(const gap::Diagnosis& diagnosis, const std::string& name) {
  gap::Answer answer;
  answer.bundle = name;
  std::vector<const gap::EffectFinding*> accepted;
  for (const gap::EffectFinding& candidate : diagnosis.candidates) {
    answer.candidates.emplace_back(candidate.name, 1 / (1 + std::exp(-candidate.nats)));
    if (candidate.nats >= gap::kAccept_nats) {
      accepted.push_back(&candidate);
    }
  }
  std::ranges::stable_sort(accepted, [](const auto* a, const auto* b) {
    return std::pair(a->gap_mg2, a->nats) > std::pair(b->gap_mg2, b->nats);
  });
  for (const gap::EffectFinding* finding : accepted) {
    answer.effects.emplace_back(finding->name, 1 / (1 + std::exp(-finding->nats)));
  }
  return answer;
}

Result<gap::Answer> answer_of(FileSystem& files, const GapAnswersCommandOptions& options,
                              const std::string& name) {
  SIXPOINT_ASSIGN(const gap::Bundle bundle, gap::read_bundle(files, options.folder + "/" + name));
  if (options.method == "sequential") {
    return gap::answer_by_regression(bundle, name);
  }
  SIXPOINT_ASSIGN(const gap::Diagnosis diagnosis, gap::diagnose(bundle));
  return options.method == "closed-world"
             ? closed_world(diagnosis, name)
             : gap::parse_answer(diagnosis.to_json(), name, options.folder + "/" + name);
}

// The names that challenge.json lists; each is a plain name below the folder.
Result<std::vector<std::string>> bundles_of(FileSystem& files, const std::string& folder) {
  const std::string file = folder + "/challenge.json";
  const auto bad = [&](const char* what) {
    return fail(ErrorCode::bad_data, what, file, "give the folder that --export wrote");
  };
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, file));
  const Json json = parse_json(as_text(text));
  if (!json.is_object() || !json.contains("bundles") || !json["bundles"].is_array()) {
    return bad("this is no list of bundles");
  }
  std::vector<std::string> names;
  for (const Json& name : json["bundles"]) {
    if (!name.is_string() || name.get<std::string>().find('/') != std::string::npos ||
        name.get<std::string>().starts_with('.')) {
      return bad("the name of a bundle is none");
    }
    names.push_back(name.get<std::string>());
  }
  return names;
}

Status run_gap_answers(const GapAnswersCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(options.folder));
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  SIXPOINT_ASSIGN(const auto names, bundles_of(context.env.files, options.folder));
  std::vector<Result<gap::Answer>> answers(names.size(), gap::Answer{});
  if (!options.dry_run) {
    Progress progress(context, "answers", names.size());
    for_each_job(
        names.size(), options.jobs,
        [&](std::size_t i) { answers[i] = answer_of(context.env.files, options, names[i]); },
        [&](std::size_t done) { progress.at(done); });
  }
  std::string text;
  std::size_t failed = 0;
  for (std::size_t i = 0; i < names.size() && !options.dry_run; ++i) {
    if (!answers[i]) {  // no answer is an answer, too: gap score counts it
      report_error(context, answers[i].error());
      failed += 1;
      continue;
    }
    text += gap::answer_line(*answers[i]) + "\n";
  }
  if (!options.dry_run) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.output, text));
  }
  Json json = document("gap-answers");
  json["folder"] = options.folder;
  json["method"] = options.method;
  json["output"] = options.output;
  json["bundles"] = names.size();
  json["failed"] = failed;
  json["dry_run"] = options.dry_run;
  return print_answer(
      context, options.json, json,
      fmt::format("{}: {} by {}, {} without an answer{}\n", printable(options.output),
                  counted(names.size(), "bundle"), options.method, failed,
                  options.dry_run ? " (dry run: nothing was written)" : ""));
}

}  // namespace

void add_gap_answers(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapAnswersCommandOptions>(
      gap_command, context, "gap-answers", "answers",
      "what a method of this project answers to an exported challenge", run_gap_answers);
  command.add_option("FOLDER", options.folder, "the folder that gap challenge --export wrote")
      ->required();
  command
      .add_option("--method", options.method,
                  "diagnose, or a baseline: closed-world (without unknown), sequential (residual "
                  "regression)")
      ->check(CLI::IsMember({"diagnose", "closed-world", "sequential"}));
  command.add_option("-o,--output", options.output, "the JSON Lines file to make")->required();
  add_jobs_option(command, options.jobs);
  command.add_flag("--dry-run", options.dry_run, "read the list of bundles, write nothing");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli

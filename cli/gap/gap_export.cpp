#include "cli/gap/gap_export.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/counted.h"
#include "cli/workers.h"
#include "gap/benchmark/labels.h"
#include "sim/bundle_writer.h"

namespace sixpoint::cli {
namespace {

// How long a bundle took to make would tell how much is in it.
void set_one_time(const std::string& folder) {
  const auto time = std::chrono::file_clock::from_sys(from_unix_seconds(1'428'588'240));
  std::error_code ignored;
  for (const auto& file : std::filesystem::directory_iterator(folder, ignored)) {
    std::filesystem::last_write_time(file.path(), time, ignored);
  }
  std::filesystem::last_write_time(folder, time, ignored);
}

Result<gap::TrialLabel> write_trial(FileSystem& files, const ExportOptions& options,
                                    std::size_t index) {
  SIXPOINT_ASSIGN(const gap::GapTrial trial, gap::draw_trial(options.seed, index, options.protocol,
                                                             options.shares, options.only));
  const std::string name = gap::bundle_name(options.seed, index);
  const std::string folder = options.folder + "/" + name;
  SIXPOINT_CHECK(sim::write_bundle(files, folder, trial.scenario));
  set_one_time(folder);
  return gap::label_of(trial, name);
}

Result<std::vector<gap::TrialLabel>> write_trials(const ExportOptions& options, Outputs& outputs,
                                                  Context& context) {
  std::vector<Result<gap::TrialLabel>> results(options.trials, gap::TrialLabel{});
  {
    Progress progress(context, "bundles", options.trials);
    for_each_job(
        options.trials, options.jobs,
        [&](std::size_t i) { results[i] = write_trial(outputs.files(), options, i); },
        [&](std::size_t done) { progress.at(done); });
  }
  std::vector<gap::TrialLabel> labels;
  for (Result<gap::TrialLabel>& result : results) {
    if (!result) {
      return tl::unexpected(result.error());
    }
    labels.push_back(std::move(*result));
  }
  std::ranges::sort(labels, {}, &gap::TrialLabel::bundle);
  return labels;
}

Result<std::map<std::string, std::size_t>> count_kinds(const ExportOptions& options) {
  std::map<std::string, std::size_t> kinds;
  for (std::size_t i = 0; i < options.trials; ++i) {
    SIXPOINT_ASSIGN(const gap::GapTrial trial, gap::draw_trial(options.seed, i, options.protocol,
                                                               options.shares, options.only));
    kinds[std::string(gap::to_string(trial.kind))] += 1;
  }
  return kinds;
}

std::string challenge_text(const ExportOptions& options, const std::string& sha256,
                           const std::vector<gap::TrialLabel>& labels) {
  Json json = document("gap-challenge-bundles");
  json["protocol"] = to_string(options.protocol);
  json["labels_sha256"] = sha256;
  json["bundles"] = Json::array();
  for (const gap::TrialLabel& label : labels) {
    json["bundles"].push_back(label.bundle);
  }
  return json.dump(1) + "\n";
}

}  // namespace

Status export_challenge(const ExportOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.folder("--export", options.folder));
  SIXPOINT_CHECK(outputs.file_to_keep("--labels", options.labels));
  SIXPOINT_CHECK(
      allow_folder(look_at_folder(context.env.files, options.folder), false, options.folder));
  const std::string labels_file =
      options.labels.empty() ? options.folder + "/labels.jsonl" : options.labels;
  SIXPOINT_ASSIGN(const auto kinds, count_kinds(options));
  std::string sha256;
  if (!options.dry_run) {
    SIXPOINT_CHECK(context.env.files.make_folders(options.folder));
    gap::Labels labels;
    labels.seed = options.seed;
    labels.protocol = to_string(options.protocol);
    SIXPOINT_ASSIGN(labels.trials, write_trials(options, outputs, context));
    const std::string text = gap::labels_text(labels);
    sha256 = text_sha256(text);
    SIXPOINT_CHECK(write_private_file(outputs.files(), labels_file, text));
    SIXPOINT_CHECK(write_file(outputs.files(), options.folder + "/challenge.json",
                              challenge_text(options, sha256, labels.trials)));
  }
  Json json = document("gap-challenge-export");
  json["folder"] = options.folder;
  json["labels"] = labels_file;
  json["labels_sha256"] = text_or_null(sha256);
  json["bundles"] = options.trials;
  json["kinds"] = kinds;
  json["dry_run"] = options.dry_run;
  return print_answer(
      context, options.json, json,
      fmt::format("{}: {}{}, labels in {}\n", printable(options.folder),
                  counted(options.trials, "bundle"),
                  options.dry_run ? " would be written (dry run)" : "", printable(labels_file)));
}

}  // namespace sixpoint::cli

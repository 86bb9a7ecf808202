// sixpoint impact BEFORE [AFTER]: what a repair changes in what a study computes; of one recording,
// of two folders, or of an archive's plan.
#include "repair/impact/impact.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "cli/command.h"
#include "cli/files/archive_options.h"
#include "cli/output.h"
#include "cli/workers.h"
#include "repair/archive/archive_merge.h"
#include "repair/archive/plan_folder.h"
#include "repair/impact/study_impact.h"
#include "repair/rescale/repair_mark.h"
#include "repair/triage/file_tree.h"

namespace sixpoint::cli {
namespace {

struct ImpactCommandOptions {
  std::vector<std::string> paths;
  int epoch_s = repair::EpochOptions{}.epoch_s;
  bool low_frequency_extension = false;
  std::vector<std::string> cuts;
  std::string csv;
  std::string html;
  unsigned jobs = 0;
  OutputOptions outputs;
  bool json = false;
};

Result<repair::EpochSeries> series_of(const ImpactCommandOptions& options, const std::string& path,
                                      Context& context) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, path));
  repair::EpochOptions how;
  how.epoch_s = options.epoch_s;
  how.filter = options.low_frequency_extension ? repair::CountFilter::low_frequency_extension
                                               : repair::CountFilter::normal;
  return repair::epochs_of(recording, how);
}

Result<std::vector<repair::CutPoint>> cut_points(const ImpactCommandOptions& options) {
  std::vector<repair::CutPoint> cuts;
  for (const std::string& text : options.cuts) {
    SIXPOINT_ASSIGN(auto cut, repair::parse_cut_point(text));
    if (std::ranges::find(cuts, cut.name, &repair::CutPoint::name) != cuts.end()) {
      return fail(ErrorCode::usage, "two cut points have this name", printable(cut.name, 40),
                  "give each --cut a name of its own: the answer names it so");
    }
    cuts.push_back(std::move(cut));
  }
  return cuts;
}

// Whether the two are a recording and its copy, as far as the marks of a repair say:
//
//   first one             copy                           answer
//   has a mark            any                            bad_data: it is a repaired copy itself
//   has none              its mark names another input   bad_data
//   has none              its mark names the first one   yes
//   has none              has none                       yes: other programs leave no mark
Status check_pair(FileSystem& files, const std::string& before, const std::string& after) {
  const auto first = repair::mark_in(files, before);
  if (first && repair::text_in(*first, "method") != repair::kSalvageMethod) {
    return fail(ErrorCode::bad_data, "this is a repaired copy", before,
                "name the recording as it was first, then its copy");
  }
  const auto mark = repair::mark_in(files, after);
  const std::string made_of = mark ? repair::text_in(*mark, "input_sha256") : "";
  if (made_of.empty()) {
    return {};
  }
  SIXPOINT_ASSIGN(const std::string sha256, file_sha256(files, before));
  if (sha256 != made_of) {
    return fail(ErrorCode::bad_data, "by its mark this copy was made of another recording", after,
                "name the recording that it was made of: " + printable(before) + " is another");
  }
  return {};
}

// The repaired copy's epochs, and what its mark says of their uncertainty.
Status read_copy(const ImpactCommandOptions& options, const std::string& before,
                 const std::string& path, Context& context, repair::Impact& impact) {
  SIXPOINT_CHECK(check_pair(context.env.files, before, path));
  SIXPOINT_ASSIGN(impact.after, series_of(options, path, context));
  if (const auto mark = repair::mark_in(context.env.files, path)) {
    impact.after_uncertainty_mg = repair::three_in(*mark, "sample_uncertainty_mg");
  }
  return {};
}

Status run_recording(const ImpactCommandOptions& options, const repair::Impact& asked,
                     Outputs& outputs, Context& context) {
  repair::Impact impact = asked;
  SIXPOINT_ASSIGN(impact.before, series_of(options, options.paths[0], context));
  if (options.paths.size() > 1) {
    SIXPOINT_CHECK(read_copy(options, options.paths[0], options.paths[1], context, impact));
  }
  SIXPOINT_CHECK(repair::check(impact));
  if (!options.csv.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.csv, repair::impact_csv(impact)));
  }
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.html, repair::impact_html(impact)));
  }
  Json json = document("impact");
  json.update(impact.to_json());
  return print_answer(context, options.json, json, impact.brief());
}

// --- a study

bool is_folder(Context& context, const std::string& path) {
  const auto info = context.env.files.info(path);
  return info && info->is_folder;
}

// What cannot be read, such as a link that leads nowhere: a line and an exit code like a recording's.
void add_refused(const std::vector<repair::RefusedPath>& refused, repair::StudyImpact& study) {
  for (const repair::RefusedPath& path : refused) {
    study.files.push_back({path.path, {}, {}, {}, path.error});
  }
}

// Recordings below the first folder, and those of the same names below the second.
Status pair_folders(const ImpactCommandOptions& options, Context& context,
                    repair::StudyImpact& study) {
  repair::FileTreeOptions how;
  how.endings = {".gt3x"};
  SIXPOINT_ASSIGN(const auto before, repair::find_files(context.env.files, options.paths[0], how));
  for (const repair::FoundFile& file : before.files) {
    const std::string copy = options.paths[1] + "/" + file.relative;
    if (const auto info = context.env.files.info(copy)) {
      study.files.push_back({file.path, copy, {}, {}, {}});
    } else if (info.error().code != ErrorCode::no_input) {
      study.files.push_back({file.path, copy, {}, {}, info.error()});
    } else {
      ++study.without_copy;
    }
  }
  add_refused(before.refused, study);
  return {};
}

Status pair_plan(const ImpactCommandOptions& options, Context& context,
                 repair::StudyImpact& study) {
  const std::string folder = absolute(options.paths[0]);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  repair::MergeOptions how;
  how.visit = [&](const repair::ShardResult& result) -> Status {
    for (const repair::RepairReport& report : result.files) {
      if (report.status == repair::RepairStatus::repaired && !report.output.empty()) {
        study.files.push_back({report.input, report.output, {}, {}, {}});
      } else {
        ++study.without_copy;
      }
    }
    return {};
  };
  SIXPOINT_ASSIGN(const auto merged, repair::merge_archive(context.env.files, folder, plan, how));
  context.worsen(merged.complete() ? kExitPassed : kExitInconclusive);
  study.without_copy += merged.files_missing();
  add_refused(plan.refused, study);
  return {};
}

Status measure(const ImpactCommandOptions& options, Context& context,
               const repair::StudyImpact& study, repair::FileImpact& file) {
  repair::Impact impact;
  impact.cuts = study.cuts;
  SIXPOINT_ASSIGN(impact.before, series_of(options, file.before, context));
  SIXPOINT_CHECK(read_copy(options, file.before, file.after, context, impact));
  SIXPOINT_CHECK(repair::check(impact));
  file.was = repair::summary_of(*impact.before, std::nullopt, study.cuts);
  file.is = repair::summary_of(*impact.after, impact.after_uncertainty_mg, study.cuts);
  return {};
}

Status run_study(const ImpactCommandOptions& options, repair::StudyImpact study, Outputs& outputs,
                 Context& context) {
  if (!options.html.empty()) {
    return fail(ErrorCode::usage, "a page is made of one recording and its copy", "--html",
                "name the two files, or give --csv");
  }
  SIXPOINT_CHECK(options.paths.size() > 1 ? pair_folders(options, context, study)
                                          : pair_plan(options, context, study));
  Progress progress(context, "computing", study.files.size());
  for_each_job(
      study.files.size(), options.jobs,
      [&](std::size_t i) {
        repair::FileImpact& file = study.files[i];
        if (file.error) {
          return;
        }
        if (Status done = measure(options, context, study, file); !done) {
          file.error = std::move(done.error());
        }
      },
      [&](std::size_t done) { progress.at(done); });
  for (const repair::FileImpact& file : study.files) {
    if (file.error) {
      context.worsen(file.error->code);
    }
  }
  if (!study.usable()) {
    context.worsen(kExitInconclusive);
  }
  if (!options.csv.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.csv, repair::study_csv(study)));
  }
  Json json = document("impact");
  json.update(study.to_json());
  return print_answer(context, options.json, json, study.brief());
}

Status run_impact(const ImpactCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_ASSIGN(const auto cuts, cut_points(options));
  const auto folders = std::ranges::count_if(
      options.paths, [&](const std::string& path) { return is_folder(context, path); });
  if (folders == 0) {
    for (const std::string& path : options.paths) {
      SIXPOINT_CHECK(outputs.input(path));
    }
  }
  SIXPOINT_CHECK(outputs.file("--csv", options.csv));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  if (folders == 0) {
    repair::Impact impact;
    impact.cuts = cuts;
    return run_recording(options, impact, outputs, context);
  }
  if (folders != static_cast<std::ptrdiff_t>(options.paths.size())) {
    for (const std::string& path : options.paths) {
      SIXPOINT_CHECK(context.env.files.info(path));  // what is not there is neither
    }
    return fail(ErrorCode::usage, "one of the two is a folder, the other is not", options.paths[0],
                "give two recordings, two folders, or an archive's plan");
  }
  repair::StudyImpact study;
  study.epoch_s = options.epoch_s;
  study.cuts = cuts;
  return run_study(options, std::move(study), outputs, context);
}

}  // namespace

void add_impact(CLI::App& app, Context& context) {
  auto [command, options] = add_command<ImpactCommandOptions>(
      app, context, "impact", "what a repair changes in a study's results", run_impact);
  command
      .add_option("BEFORE", options.paths,
                  "a recording and its repaired copy; a folder and that of its repaired copies; or "
                  "the plan of an archive")
      ->required()
      ->expected(1, 2);
  command.add_option("--epoch", options.epoch_s, "length of an epoch, whole seconds")
      ->check(CLI::Range(1, 3600));
  command.add_flag("--lfe", options.low_frequency_extension,
                   "counts with the low frequency extension");
  command.add_option(
      "--cut", options.cuts,
      "minutes above a value: NAME=MG of ENMO, such as moderate=100; may be given again");
  command.add_option("--csv", options.csv, "a line per epoch; of folders, a line per file");
  command.add_option("--html", options.html, "a page with the table and the curves");
  add_jobs_option(command, options.jobs);
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli

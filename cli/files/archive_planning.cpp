// sixpoint archive plan: what is repaired, in how many shards, with which constants.
#include <filesystem>

#include <fmt/format.h>
#include <spdlog/logger.h>

#include "base/sha256.h"
#include "base/text/counted.h"
#include "cli/files/archive_options.h"
#include "cli/files/file_stream.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/archive/plan_folder.h"
#include "repair/archive/shard_results.h"
#include "repair/triage/file_tree.h"
#include "station/records/software.h"

namespace sixpoint::cli {

std::string absolute(const std::string& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path, error);
  if (error) {
    return path;
  }
  std::string text = repair::plain_path(whole.string());
  while (text.size() > 1 && text.ends_with('/')) {
    text.pop_back();
  }
  return text;
}

std::function<void(std::size_t, std::size_t)> show_in(std::optional<Progress>& progress,
                                                      Context& context, std::string doing) {
  return [&progress, &context, doing = std::move(doing)](std::size_t done, std::size_t files) {
    if (!progress) {
      progress.emplace(context, doing, files);
    }
    progress->at(done);
  };
}

namespace {

using repair::ArchiveDraft;
using repair::ArchivePlan;
using repair::PlannedArchive;
constexpr std::size_t kLinksShown = 10;

Status gather_constants(const RepairSources& sources, Context& context, ArchiveDraft& draft,
                        std::optional<repair::ConstantsSnapshot>& snapshot) {
  if (!sources.constants.empty()) {
    SIXPOINT_ASSIGN(draft.repair.given, read_constants(context.env.files, sources.constants));
  }
  draft.repair.scan = sources.scan;
  draft.repair.or_scan = sources.or_scan;
  draft.repair.no_pool = sources.no_pool;
  draft.repair.store_named = !sources.store.empty();
  SIXPOINT_ASSIGN(auto store, store_of(context, sources));
  if (store) {
    const std::string place = sources.store.empty() ? default_store() : sources.store;
    draft.store = store_file(place).empty() ? without_password(place) : absolute(place);
    const auto order = order_of(sources, true);
    if (std::ranges::find(order, repair::SourceKind::store) != order.end()) {
      SIXPOINT_ASSIGN(snapshot, repair::ConstantsSnapshot::of_store(*store));
      draft.snapshot = &*snapshot;
    }
  }
  if (!sources.calibration_file.empty()) {
    SIXPOINT_CHECK(
        repair::check_calibration_recording(context.env.files, sources.calibration_file));
    const std::string path = absolute(sources.calibration_file);
    SIXPOINT_ASSIGN(std::string digest, file_sha256(context.env.files, path));
    draft.repair.calibration_file = {path, std::move(digest)};
  }
  return {};
}

std::vector<repair::UnitNeeds> units_of(const PlannedArchive& planned) {
  repair::UnitTable table;
  if (planned.units) {
    for (const auto& [serial, answer] : planned.units->all()) {
      table.add(serial, answer);
    }
  }
  return table.rows();
}

void print_plan(const ArchiveOptions& options, const PlannedArchive& planned, Context& context) {
  const ArchivePlan& plan = planned.plan;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    context.out << fmt::format("shard {:05}  {}  {:.1f} MB\n", k,
                               counted(plan.shards[k].files, "file"),
                               static_cast<double>(plan.shards[k].bytes) / 1e6);
  }
  print_units(context, units_of(planned));
  context.people << fmt::format("{}, {:.1f} MB, in {}\n", counted(plan.files(), "file"),
                                static_cast<double>(plan.bytes()) / 1e6,
                                counted(plan.shards.size(), "shard"));
  if (options.dry_run) {
    context.people << "dry run: nothing was written\n";
    return;
  }
  const std::string folder = bash_word(options.output);
  context.people << fmt::format(
      "with Slurm:     sixpoint archive submit {0} -o OUTDIR\n"
      "on one machine: bash {0}/run_all.sh OUTDIR\n",
      folder);
}

void warn_about_plan(const PlannedArchive& planned, Context& context) {
  for (std::size_t i = 0; i < planned.not_followed.size(); ++i) {
    if (i == kLinksShown) {
      context.log().warn("... and {} links more", planned.not_followed.size() - i);
      break;
    }
    context.log().warn("{}: this link leads out of the tree and is not followed",
                       printable(planned.not_followed[i]));
  }
  const std::size_t shards = planned.plan.shards.size();
  if (shards > repair::kUsualMostShards) {
    context.log().warn("{} shards: Slurm's MaxArraySize is 1001 unless your cluster says otherwise",
                       shards);
  }
}

void end_json_of_plan(const PlannedArchive& planned, bool dry_run, FileStream& files) {
  const ArchivePlan& plan = planned.plan;
  Json shards = Json::array();
  std::size_t at = 0;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    for (std::size_t i = 0; i < plan.shards[k].files; ++i, ++at) {
      const repair::ArchiveFile& file = planned.files[at];
      files.add(Json{{"input", plan.input_of(file)},
                     {"status", "planned"},
                     {"shard", k},
                     {"bytes", file.size}});
    }
    shards.push_back({{"shard", k},
                      {"state", repair::to_string(repair::ShardState::missing)},
                      {"files", plan.shards[k].files},
                      {"bytes", plan.shards[k].bytes}});
  }
  files.end({{"shards", shards},
             {"summary",
              {{"files", plan.files()},
               {"bytes", plan.bytes()},
               {"shards", plan.shards.size()},
               {"refused", plan.refused.size()},
               {"links_not_followed", planned.not_followed.size()},
               {"dry_run", dry_run}}},
             {"units", repair::units_json(units_of(planned))},
             {"plan", text_or_null(plan.id)}});
}

// The folder of a plan is new. One that a killed program left half made is gone on with.
Status take_plan_folder(const std::string& folder, FileSystem& files, Outputs& outputs) {
  return files.info(folder + "/plan.lock") ? outputs.working_folder("--output", folder)
                                           : outputs.folder("--output", folder);
}

// The still periods of the units' files together: one pass over the affected files.
void ask_units(const ArchiveOptions& options, const ArchiveDraft& draft, Context& context,
               PlannedArchive& planned) {
  if (!repair::asks_units(planned.plan.repair, draft.snapshot)) {
    return;
  }
  repair::ask_units(
      context.env, draft.snapshot,
      [&](std::size_t count, const std::function<void(std::size_t)>& work) {
        Progress progress(context, "reading still periods", count);
        for_each_job(count, options.jobs, work, [&](std::size_t done) { progress.at(done); });
      },
      planned);
}

}  // namespace

Status run_archive_plan(const ArchiveOptions& options, Context& context) {
  // --force is about files that repair refuses; a plan's folder is new in any case.
  Outputs outputs(context, {}, options.json);
  if (!options.dry_run) {
    SIXPOINT_CHECK(take_plan_folder(absolute(options.output), context.env.files, outputs));
  }
  ArchiveDraft draft = options.draft;
  std::optional<repair::ConstantsSnapshot> snapshot;
  SIXPOINT_CHECK(gather_constants(options.sources, context, draft, snapshot));
  for (const std::string& path : options.paths) {
    draft.paths.push_back(absolute(path));
  }
  draft.software = station::software_and_build();
  draft.program = this_program();
  std::optional<Progress> progress;
  draft.progress = show_in(progress, context, "hashing");
  auto planned = repair::plan_archive(context.env, draft);
  progress.reset();
  if (!planned) {
    return fail(planned.error());
  }
  ask_units(options, draft, context, *planned);
  if (!options.dry_run) {
    SIXPOINT_CHECK(repair::write_plan(context.env, absolute(options.output), draft, *planned));
  }
  warn_about_plan(*planned, context);
  FileStream files(context, options.json);
  for (const repair::RefusedPath& refused : planned->plan.refused) {
    files.add(failed_report(refused.path, refused.error));
    context.worsen(refused.error.code);
  }
  if (options.json) {
    end_json_of_plan(*planned, options.dry_run, files);
  } else {
    print_plan(options, *planned, context);
  }
  return {};
}

}  // namespace sixpoint::cli

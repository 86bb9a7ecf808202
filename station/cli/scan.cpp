// sixpoint scan PATH...: which files are affected by 16CPAN03, and how the data themselves look.
#include <fmt/format.h>

#include "repair/agd.h"
#include "repair/file_tree.h"
#include "repair/survey.h"
#include "repair/triage.h"
#include "station/cli/command.h"
#include "station/cli/workers.h"

namespace sixpoint::cli {
namespace {

// Paper, Step 2: still points further than this from 1 g show that a file needs mending.
constexpr double kEvidenceLimit_mg = 64;

struct Options {
  std::vector<std::string> paths;
  unsigned jobs = 0;
  bool json = false;
};

struct Answer {
  std::string path;
  std::string verdict;
  std::vector<std::string> reasons;
  repair::FileFacts facts;
  std::optional<double> evidence_mg;
  bool axes_rotated = false;
  int exit_code = kExitPassed;
};

Answer unreadable(const std::string& path, const Error& error) {
  Answer answer;
  answer.path = path;
  answer.verdict = "unreadable";
  Error short_error = error;
  short_error.where.clear();  // the line names the file already
  answer.reasons.push_back(short_error.brief());
  answer.exit_code = static_cast<int>(error.code);
  return answer;
}

void judge(Answer& answer, bool repaired) {
  if (repaired) {
    answer.verdict = to_string(repair::Verdict::not_affected);
    answer.reasons.insert(answer.reasons.begin(), "already repaired by sixpoint");
    return;
  }
  repair::Triage triage = repair::triage(answer.facts);
  answer.verdict = to_string(triage.verdict);
  answer.axes_rotated = triage.axes_rotated;
  answer.reasons.insert(answer.reasons.begin(), triage.reasons.begin(), triage.reasons.end());
  if (triage.verdict == repair::Verdict::affected) {
    answer.exit_code = kExitFailed;
  } else if (triage.verdict == repair::Verdict::cannot_tell) {
    answer.exit_code = kExitInconclusive;
  }
}

Answer scan_agd(const std::string& path) {
  const auto facts = repair::read_agd_facts(path);
  if (!facts) {
    return unreadable(path, facts.error());
  }
  Answer answer;
  answer.path = path;
  answer.facts = *facts;
  answer.reasons.push_back("an .agd cannot be repaired: make it anew from the repaired raw data");
  judge(answer, false);
  return answer;
}

Answer scan_recording(FileSystem& files, const std::string& path) {
  Answer answer;
  answer.path = path;
  auto survey = repair::survey(files, path);
  if (!survey) {
    return unreadable(path, survey.error());
  }
  answer.facts = survey->facts;
  if (survey->magnitude.blocks > 0) {
    answer.evidence_mg = survey->magnitude.p95_mg;
    if (survey->magnitude.p95_mg > kEvidenceLimit_mg) {
      answer.reasons.push_back(
          fmt::format("still periods are up to {:.0f} mg from 1 g (95th percentile of {}): the "
                      "constants do not "
                      "fit the data",
                      survey->magnitude.p95_mg, survey->magnitude.blocks));
    }
  } else {
    answer.reasons.push_back("no still periods, so the data themselves give no evidence");
  }
  if (survey->log.checksum_failures + survey->log.damaged_stretches > 0) {
    answer.reasons.push_back(fmt::format("damage: {} wrong checksums, {} damaged stretches",
                                         survey->log.checksum_failures,
                                         survey->log.damaged_stretches));
  }
  judge(answer, survey->already_repaired);
  return answer;
}

Json to_json(const Answer& answer) {
  Json json;
  json["path"] = answer.path;
  json["verdict"] = answer.verdict;
  json["reasons"] = answer.reasons;
  json["serial"] = answer.facts.serial;
  json["firmware"] = answer.facts.firmware;
  json["calibration_time"] = answer.facts.calibration_time
                                 ? Json(to_iso8601(*answer.facts.calibration_time))
                                 : Json(nullptr);
  json["evidence_mg"] = answer.evidence_mg ? number(*answer.evidence_mg) : Json(nullptr);
  json["axes_rotated"] = answer.axes_rotated;
  return json;
}

void run(const Options& options, Context& context) {
  std::vector<Answer> answers;
  std::vector<std::string> paths;
  std::vector<std::size_t> places;
  for (const std::string& path : options.paths) {
    const auto found = repair::find_files(context.env.files, path, {{".gt3x", ".agd", ".agdc"}});
    if (!found) {
      answers.push_back(unreadable(path, found.error()));
      continue;
    }
    for (const repair::RefusedPath& refused : found->refused) {
      answers.push_back(unreadable(refused.path, refused.error));
    }
    if (found->files.empty()) {
      context.log().warn("{}: no .gt3x, .agdc or .agd file below this folder", printable(path));
    }
    for (const repair::FoundFile& file : found->files) {
      places.push_back(answers.size());
      paths.push_back(file.path);
      answers.emplace_back();
    }
  }
  {
    Progress progress(context, "scanning", paths.size());
    for_each_job(
        paths.size(), options.jobs,
        [&](std::size_t i) {
          answers[places[i]] = repair::has_ending(paths[i], ".agd")
                                   ? scan_agd(paths[i])
                                   : scan_recording(context.env.files, paths[i]);
        },
        [&](std::size_t done) { progress.at(done); });
  }

  Json summary = {{"files", answers.size()}, {"affected", 0},   {"not_affected", 0},
                  {"cannot_tell", 0},        {"unreadable", 0}, {"axes_rotated", 0}};
  for (const Answer& answer : answers) {
    context.worsen(answer.exit_code);
    summary[answer.verdict] = summary[answer.verdict].get<int>() + 1;
    summary["axes_rotated"] = summary["axes_rotated"].get<int>() + (answer.axes_rotated ? 1 : 0);
  }
  if (options.json) {
    Json json = document("scan");
    json["files"] = Json::array();
    for (const Answer& answer : answers) {
      json["files"].push_back(to_json(answer));
    }
    json["summary"] = summary;
    return print_json(context, json);
  }
  for (const Answer& answer : answers) {
    context.out << fmt::format("{:<13} {}", answer.verdict, printable(answer.path));
    for (const std::string& reason : answer.reasons) {
      context.out << "\n              " << printable(reason);
    }
    context.out << '\n';
  }
  context.people << fmt::format(
      "{} files: {} affected, {} not, {} cannot be told, {} unreadable\n", answers.size(),
      summary["affected"].get<int>(), summary["not_affected"].get<int>(),
      summary["cannot_tell"].get<int>(), summary["unreadable"].get<int>());
}

}  // namespace

void add_scan(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("scan", "Find the files that 16CPAN03 affects");
  auto options = std::make_shared<Options>();
  command->add_option("path", options->paths, "Recordings (.gt3x, .agdc, .agd) or folders of them")
      ->required();
  command->add_option("--jobs", options->jobs, "Files at a time (default: one per core)");
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli

// sixpoint gap adopt INPUT... -o SCENARIO: effects that several units have become a population.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "base/text/json_text.h"
#include "cli/command.h"
#include "cli/gap/gap_commands.h"
#include "cli/gap/gap_sources.h"
#include "cli/output.h"
#include "gap/adopt/adopted_scenario.h"

namespace sixpoint::cli {
namespace {

struct GapAdoptCommandOptions {
  SourceOptions sources;
  std::string scenario;
  std::string output;
  gap::AdoptionOptions rule;
  OutputOptions outputs;
  bool dry_run = false;
  bool json = false;
};

bool is_json_object(std::string_view text) {
  const Json json = parse_json(text);
  return json.is_object();
}

bool is_plain_file(FileSystem& files, const std::string& path) {
  const auto info = files.info(path);
  return info && info->kind == FileKind::file && !info->is_folder;
}

// The output is read, changed and replaced: no other adoption may do so meanwhile. Held on the file
// itself, so that none stays beside it. Null where there is no file yet, where it has no locks, or
// where it may not be written (a rename still replaces it).
Result<std::unique_ptr<FileLock>> lock_output(const GapAdoptCommandOptions& options,
                                              FileSystem& files) {
  if (options.dry_run || !is_plain_file(files, options.output)) {
    return nullptr;
  }
  auto lock = files.lock(options.output);
  if (!lock) {
    return nullptr;
  }
  if (*lock == nullptr) {
    return fail(ErrorCode::cannot_create, "another command is writing this scenario",
                options.output, "begin again when it has ended: nothing was changed");
  }
  return lock;
}

// The scenario that is extended: --scenario, or what the output's name has already. Empty: a new
// one.
Result<std::string> base_of(const GapAdoptCommandOptions& options, FileSystem& files) {
  if (!options.scenario.empty()) {
    SIXPOINT_ASSIGN(const Bytes text, read_file(files, options.scenario));
    return std::string(as_text(text));
  }
  if (!is_plain_file(files, options.output)) {
    return std::string();
  }
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, options.output));
  return is_json_object(as_text(text)) ? std::string(as_text(text)) : std::string();
}

Json numbers_json(const std::vector<gap::MeanAndSpread>& numbers) {
  Json json = {{"mean", Json::array()},
               {"spread", Json::array()},
               {"standard_uncertainty", Json::array()},
               {"units", numbers.front().units}};
  for (const gap::MeanAndSpread& n : numbers) {
    json["mean"].push_back(number(n.mean));
    json["spread"].push_back(value_or_null(n.spread));
    json["standard_uncertainty"].push_back(
        n.standard_uncertainty > 0 ? number(n.standard_uncertainty) : Json(nullptr));
  }
  return json;
}

Json effect_json(const gap::AdoptedEffect& effect) {
  const gap::AdoptionDecision& decision = effect.decision;
  Json json = {{"name", decision.name},
               {"outcome", gap::to_string(decision.outcome)},
               {"change", gap::to_string(effect.change)},
               {"units_naming", decision.units_naming},
               {"units_able", decision.units_able},
               {"bundles", decision.bundles},
               {"share_of_units", decision.share_of_units},
               {"parameters", Json::object()}};
  for (const gap::AdoptedNumber& parameter : decision.parameters) {
    json["parameters"][parameter.parameter] = numbers_json(parameter.numbers);
  }
  return json;
}

std::string why_not(const gap::DocumentEvidence& document) {
  return document.inconclusive ? "inconclusive" : document.unknown ? "unknown" : "";
}

void print_gap_adopt(const gap::AdoptedScenario& learnt, const GapAdoptCommandOptions& options,
                     Context& context) {
  for (const gap::AdoptedEffect& effect : learnt.effects) {
    if (!effect.decision.adopted() && effect.decision.units_naming == 0 &&
        effect.decision.outcome != gap::AdoptionOutcome::unknown_beside &&
        effect.change == gap::AdoptionChange::none) {
      continue;
    }
    context.text() << fmt::format("{:<20} {:<10} {}\n", printable(effect.decision.name, 60),
                                  gap::to_string(effect.change), effect.decision.brief());
    for (const gap::AdoptedNumber& parameter : effect.decision.parameters) {
      const bool per_axis = parameter.numbers.size() == 3;
      for (std::size_t i = 0; i < parameter.numbers.size(); ++i) {
        const gap::MeanAndSpread& n = parameter.numbers[i];
        const bool known = n.standard_uncertainty > 0;
        context.text() << fmt::format(
            "  {:<24} {:>10.4g} {:<12} spread {} ({})\n",
            parameter.parameter + (per_axis ? fmt::format(" {}", "xyz"[i]) : ""), n.mean,
            known ? fmt::format("+- {:.2g}", n.standard_uncertainty) : "(not shown)",
            n.spread ? fmt::format("{:.3g}", *n.spread) : "not known", counted(n.units, "unit"));
      }
    }
  }
  for (const gap::DocumentEvidence& document : learnt.documents) {
    if (!why_not(document).empty()) {
      context.people << fmt::format("sixpoint: {}: {}: its sizes are not taken\n",
                                    printable(document.source), why_not(document));
    }
  }
  context.text() << (learnt.changed
                         ? fmt::format("{}: adoption {} with {} new documents{}\n", options.output,
                                       learnt.adoption, learnt.new_documents,
                                       options.dry_run ? " (not written: --dry-run)" : "")
                         : fmt::format("{}: nothing new, unchanged\n", options.output));
}

Json learnt_json(const gap::AdoptedScenario& learnt, const GapAdoptCommandOptions& options) {
  Json json = document("gap-adopt");
  json["scenario"] = options.output;
  json["written"] = learnt.changed && !options.dry_run;
  json["adoption"] = learnt.adoption;
  json["new_documents"] = learnt.new_documents;
  json["documents"] = Json::array();
  for (const gap::DocumentEvidence& document : learnt.documents) {
    json["documents"].push_back({{"source", document.source},
                                 {"serial", document.serial},
                                 {"sha256", document.id},
                                 {"adoption", document.adoption},
                                 {"left_out", text_or_null(why_not(document))}});
  }
  json["effects"] = Json::array();
  for (const gap::AdoptedEffect& effect : learnt.effects) {
    json["effects"].push_back(effect_json(effect));
  }
  return json;
}

Status run_gap_adopt(const GapAdoptCommandOptions& options, Context& context) {
  OutputOptions how = options.outputs;
  // Where nothing has the name now, what comes to it meanwhile was not read: it stays.
  how.force = how.force && context.env.files.link_info(options.output).has_value();
  Outputs outputs(context, how, options.json);
  SIXPOINT_CHECK(guard_sources(outputs, options.sources));
  SIXPOINT_CHECK(outputs.input(options.scenario));
  if (!options.dry_run) {
    SIXPOINT_CHECK(outputs.file("--output", options.output));
  }
  SIXPOINT_ASSIGN(const auto lock, lock_output(options, context.env.files));
  SIXPOINT_ASSIGN(const std::string base, base_of(options, context.env.files));
  SIXPOINT_ASSIGN(const auto sources, find_sources(context, options.sources));
  std::vector<gap::DocumentEvidence> documents;
  bool any = false;
  for (const GapSource& source : sources) {
    SIXPOINT_ASSIGN(gap::DocumentEvidence evidence, evidence_of_source(context, source));
    any = any || why_not(evidence).empty();
    documents.push_back(std::move(evidence));
  }
  SIXPOINT_ASSIGN(const gap::AdoptedScenario learnt,
                  gap::adopt(base, documents, context.env.clock.now(), options.rule));
  // A new scenario is written also where it has learnt nothing; a copy of --scenario as well.
  if (!options.dry_run) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.output, learnt.text));
  }
  context.worsen(any ? kExitPassed : kExitInconclusive);
  if (options.json) {
    return print_json(context, learnt_json(learnt, options));
  }
  print_gap_adopt(learnt, options, context);
  return {};
}

}  // namespace

void add_gap_adopt(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapAdoptCommandOptions>(
      gap_command, context, "gap-adopt", "adopt",
      "effects that several units have go into a scenario, as means and "
      "spreads that `simulate` and `virtual` use",
      run_gap_adopt);
  add_source_options(command, options.sources, "INPUT",
                     "answers of `gap diagnose --json`, bundles, folders of bundles, stores");
  command.add_option("--scenario", options.scenario,
                     "the scenario that is extended; else the one that -o names, or a new one");
  command
      .add_option("-o,--output,--scenario-out", options.output, "write the scenario to this file")
      ->required();
  command
      .add_option("--least-units", options.rule.least_units,
                  "units that must name an effect, where there are several")
      ->check(CLI::Range(1, 1000));
  command.add_flag("--dry-run", options.dry_run, "say what would change, and write nothing");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli

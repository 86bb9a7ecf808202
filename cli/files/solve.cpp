// sixpoint solve FILE...: constants from the still periods of a recording, with a verdict.
#include "calib/solve.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "calib/poses/efficiency.h"
#include "cli/command.h"
#include "cli/gravity_option.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/store_option.h"
#include "db/records.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/gate.h"
#include "repair/triage/survey.h"

namespace sixpoint::cli {
namespace {

struct SolveCommandOptions {
  std::vector<std::string> files;
  std::string method = "ls";
  std::optional<std::uint64_t> seed;
  bool strict_nonzero = false;
  bool save = false;
  std::string store;
  std::string output;
  std::string prior;
  GravityOptions gravity;
  OutputOptions outputs;
  bool json = false;
};

Result<calib::SolveOptions> solve_options(const SolveCommandOptions& options) {
  calib::SolveOptions solve;
  SIXPOINT_ASSIGN(solve.method, calib::parse_solve_method(options.method));
  solve.seed = options.seed.value_or(solve.seed);
  SIXPOINT_ASSIGN(const auto gravity, local_gravity(options.gravity));
  if (gravity) {
    solve.gravity_g = gravity->g();
    solve.gravity_sd_g = gravity->sd_g();
  }
  if (!options.prior.empty() && options.prior != "population") {
    return fail(ErrorCode::usage, fmt::format("unknown prior '{}'", options.prior), "--prior",
                "use 'population'");
  }
  return solve;
}

// The constants of one recording, and where they were saved.
struct Outcome {
  calib::SolveReport report;
  std::optional<SavedConstants> saved;
  std::optional<Error> not_kept = std::nullopt;  // why not, where it was asked for
  bool is_lent = true;                           // why_not_lent() (repair/rescale/gate.h)
  bool repairs_files = true;                     // why_legacy_repairs_none(), in the same header
};

// Writes the constants to the file and the store that the options name:
//
//   constants                                     file        store
//   not to be lent (repair/rescale/gate.h)        -o          refused
//   verified                                      -o          --save
//   rest on a prior                               -o          never
//   not verified                                  never       never
Status keep(const std::string& path, const SolveCommandOptions& options,
            const repair::Survey& survey, Outcome& outcome, Context& context, Outputs& outputs) {
  const bool to_file =
      !options.output.empty() && (outcome.report.usable() || outcome.report.from_prior);
  const bool to_store = options.save && outcome.report.usable();
  if (!to_file && !to_store) {
    return {};
  }
  calib::ConstantsOrigin origin;
  SIXPOINT_ASSIGN(origin.sha256, file_sha256(context.env.files, path));
  origin.file = db::storable_path(file_name_of(path));
  origin.kind = repair::recording_kind(survey);
  SIXPOINT_ASSIGN(const auto record,
                  calib::record_of(outcome.report, context.env.clock.now(), origin));
  const std::string file = to_file ? options.output : "";
  if (to_store && outcome.is_lent) {
    auto store = open_store(context, options.store);
    SIXPOINT_ASSIGN(outcome.saved, save_constants(context, outputs.files(), options.store, store,
                                                  record, survey.model, file));
    return outcome.saved->file_problem ? Status(fail(*outcome.saved->file_problem)) : Status();
  }
  SIXPOINT_CHECK(write_constants(outputs.files(), file, record));
  return to_store ? Status(fail(ErrorCode::bad_data,
                                "nothing is stored: the constants are for this recording alone",
                                path, "see the notes of the answer; name the original recording"))
                  : Status();
}

Result<Outcome> solve_one(const std::string& path, const SolveCommandOptions& options,
                          calib::SolveOptions solve, Context& context, Outputs& outputs) {
  calib::StillBlockOptions still;
  still.strict_nonzero = options.strict_nonzero;
  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(context.env.files, path, still));
  if (!options.prior.empty()) {
    const auto filter =
        repair::filter_in_force(survey.facts).value_or(calib::FilterConfiguration::current);
    SIXPOINT_ASSIGN(solve.prior, calib::population_prior(survey.facts.serial, filter));
  }
  Outcome outcome;
  const auto start = context.env.clock.elapsed();
  SIXPOINT_ASSIGN(outcome.report, repair::solve_survey(path, survey, solve));
  outcome.report.seconds =
      std::chrono::duration<double>(context.env.clock.elapsed() - start).count();
  outcome.is_lent = repair::why_not_lent(survey).empty();
  outcome.repairs_files = repair::why_legacy_repairs_none(survey.facts).empty();
  if (const Status kept = keep(path, options, survey, outcome, context, outputs); !kept) {
    outcome.not_kept = kept.error();
  }
  return outcome;
}

// Which directions the unit lay in, beside the best that there are.
std::string efficiency_text(const calib::BlockFit& fit) {
  const calib::DesignEfficiency six = calib::efficiency_of(fit, 6);
  const calib::DesignEfficiency nine = calib::efficiency_of(fit, 9);
  std::string text = fmt::format(
      "{} directions; efficiency (D, G; 1 is the best) for six parameters {:.2f}, {:.2f}",
      fit.directions, six.d, six.g);
  return text + (nine.d > 0 ? fmt::format("; with cross-axis terms {:.2f}, {:.2f}", nine.d, nine.g)
                            : "; too few for cross-axis terms");
}

void print_solve(const std::string& path, const SolveCommandOptions& options,
                 const Outcome& outcome, Context& context) {
  const calib::SolveReport& report = outcome.report;
  context.text() << fmt::format("{}: {}\n", printable(path), printable(report.brief(), 2000));
  if (report.calibration) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      context.text() << fmt::format(
          "  {}  {:.3f} LSB/g (+- {:.2f} %)  zero {:.2f} LSB (+- {:.1f} mg)\n", kAxisNames[a],
          1 / report.calibration->sensitivity_g_per_lsb[a],
          100 * report.uncertainty.sensitivity_relative[a], report.calibration->zero_lsb[a],
          report.uncertainty.zero_mg[a]);
    }
  }
  if (!report.verification.missing_directions.empty()) {
    context.text() << fmt::format(
        "  missing: lay the unit still for a minute with these axes up: {}\n",
        fmt::join(report.verification.missing_directions, " "));
  }
  if (report.partial) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      context.text() << fmt::format(
          "  {}  zero known to {:.0f} mg ({}), sensitivity to {:.1f} % ({})\n", kAxisNames[a],
          report.partial->zero_mg[a],
          report.partial->zero_determined[a] ? "determined" : "not determined",
          100 * report.partial->sensitivity_relative[a],
          report.partial->sensitivity_determined[a] ? "determined" : "not determined");
    }
  }
  if (report.fit) {
    context.text() << "  " << efficiency_text(*report.fit) << '\n';
  }
  for (const std::string& note : report.notes) {
    context.text() << "  note: " << printable(note, 1000) << '\n';
  }
  if (outcome.saved) {
    context.text() << "  " << kept_as(outcome.saved->place, outcome.saved->id) << '\n';
  } else if (options.save && !report.usable()) {
    context.log().warn("nothing stored: only verified constants are kept");
  } else if (report.usable() && report.filter && !report.serial.empty() &&  // record_of()
             outcome.is_lent && outcome.repairs_files && !outcome.not_kept) {
    next_step(context, options.json, {"solve", path_word(path), "--save"});
  }
}

Json to_json(Json json, const std::string& path, const Outcome& outcome) {
  json["file"] = path;
  json.update(calib::solve_json(outcome.report));
  json["stored_id"] = outcome.saved ? Json(outcome.saved->id) : Json(nullptr);
  if (outcome.saved) {
    json["kept"] = kept_to_json(outcome.saved->place);
  }
  if (outcome.not_kept) {
    json["error"] = error_to_json(*outcome.not_kept);
  }
  return json;
}

// With one recording the document is its answer; with several it lists one answer per recording.
Status run_solve(const SolveCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const auto solve, solve_options(options));
  const bool single = options.files.size() == 1;
  if (!options.output.empty() && !single) {
    return fail(ErrorCode::usage, "one output for several recordings", options.output,
                "solve them one by one, or use --save");
  }
  Outputs outputs(context, options.outputs, options.json);
  for (const std::string& path : options.files) {
    SIXPOINT_CHECK(outputs.input(path));
  }
  SIXPOINT_CHECK(outputs.input(options.save ? store_file(options.store) : ""));
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  if (options.save) {
    warn_without_store(context, open_store(context, options.store));
  }
  Json json = document("solve");
  Json list = Json::array();
  for (const std::string& path : options.files) {
    const auto outcome = solve_one(path, options, solve, context, outputs);
    if (!outcome && single) {
      return fail(outcome.error());
    }
    if (!outcome) {
      report_error(context, outcome.error());
      list.push_back({{"file", path}, {"error", error_to_json(outcome.error())}});
      continue;
    }
    context.worsen(outcome->report.usable() ? kExitPassed : kExitFailed);
    if (outcome->not_kept) {
      report_error(context, *outcome->not_kept);  // the answer below is then the only copy
    }
    if (!options.json) {
      print_solve(path, options, *outcome, context);
    } else if (single) {
      json = to_json(std::move(json), path, *outcome);
    } else {
      list.push_back(to_json({}, path, *outcome));
    }
  }
  if (!single) {
    json["files"] = std::move(list);
  }
  if (options.json) {
    print_json(context, json);
  }
  return {};
}

}  // namespace

void add_solve(CLI::App& app, Context& context) {
  auto [command, options] = add_command<SolveCommandOptions>(
      app, context, "solve",
      "constants from the still periods of a calibration file or any recording", run_solve);
  command.add_option("files", options.files, "recordings (.gt3x)")->required();
  command.add_option("--method", options.method,
                     "ls: least squares (default); ga: the paper's genetic algorithm");
  command.add_option("--seed", options.seed, "seed of the genetic algorithm");
  command.add_flag("--strict-nonzero", options.strict_nonzero,
                   "reject still periods in which any axis reads exactly zero, as the paper's "
                   "formula says");
  add_gravity_options(command, options.gravity);
  command.add_option("--prior", options.prior,
                     "'population': where sides are missing, use what units of this model are "
                     "like; the result is marked and never verified");
  command.add_option("-o,--output", options.output,
                     "write verified constants into this constants.json; with --prior also those "
                     "that rest on it, which are marked (from_prior) and not verified");
  add_output_options(command, options.outputs);
  command.add_flag("--save", options.save, "keep verified constants in the store");
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli

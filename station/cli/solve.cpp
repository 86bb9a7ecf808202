// sixpoint solve FILE...: constants from the still periods of a recording, with a verdict.
#include "calib/solve.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "calib/gravity.h"
#include "repair/constants_finder.h"
#include "repair/survey.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::vector<std::string> files;
  std::string method = "ls";
  std::uint64_t seed = 0;
  bool seed_given = false;
  bool strict_nonzero = false;
  bool save = false;
  std::string store;
  std::string output;
  std::string prior;
  std::optional<double> gravity_m_per_s2;
  std::optional<double> latitude_deg;
  double altitude_m = 0;
  bool json = false;
};

Result<std::string> hash_of_file(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto file, files.open(path));
  Sha256 hash;
  Bytes piece(1U << 20);
  for (std::uint64_t offset = 0; offset < file->size();) {
    SIXPOINT_ASSIGN(const std::size_t size, file->read_at(offset, piece));
    if (size == 0) {
      break;
    }
    hash.update(std::span<const std::uint8_t>(piece).first(size));
    offset += size;
  }
  return to_hex(hash.finish());
}

Result<calib::SolveOptions> solve_options(const Options& options) {
  calib::SolveOptions solve;
  SIXPOINT_ASSIGN(solve.method, calib::parse_solve_method(options.method));
  if (options.seed_given) {
    solve.seed = options.seed;
  }
  if (options.gravity_m_per_s2 || options.latitude_deg) {
    SIXPOINT_ASSIGN(const calib::LocalGravity gravity,
                    options.gravity_m_per_s2
                        ? calib::gravity_entered(*options.gravity_m_per_s2)
                        : calib::gravity_at(*options.latitude_deg, options.altitude_m));
    solve.gravity_g = gravity.g();
    solve.gravity_sd_g = gravity.sd_g();
  }
  if (!options.prior.empty() && options.prior != "population") {
    return fail(ErrorCode::usage, fmt::format("unknown prior '{}'", options.prior), "--prior",
                "use 'population'");
  }
  return solve;
}

// What one file gave, and what was done with it.
struct Outcome {
  calib::SolveReport report;
  std::optional<std::string> stored_id;
  std::optional<db::Kept> kept;
};

Result<Outcome> solve_one(const std::string& path, const Options& options,
                          calib::SolveOptions solve, Context& context) {
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
  const bool wanted = options.save || !options.output.empty();
  // What rests on a prior may be written to a file, where it says so, and never into the store.
  const bool may_write = outcome.report.usable() || outcome.report.from_prior;
  if (!wanted || !may_write) {
    return outcome;
  }
  calib::ConstantsOrigin origin;
  SIXPOINT_ASSIGN(origin.sha256, hash_of_file(context.env.files, path));
  origin.file = file_name_of(path);
  SIXPOINT_ASSIGN(const calib::ConstantsRecord record,
                  calib::record_of(outcome.report, context.env.clock.now(), origin));
  if (!options.output.empty()) {
    SIXPOINT_CHECK(
        write_file(context.env.files, options.output, calib::to_json(record).dump(2) + "\n"));
  }
  if (options.save && outcome.report.usable()) {
    db::ConstantsRecord row;
    row.made_at = record.made_at;
    row.serial = record.serial;
    row.filter = calib::to_string(record.filter);
    row.method = record.method;
    row.document = calib::to_json(record).dump();
    auto store = open_store(context, options.store);
    SIXPOINT_ASSIGN(outcome.kept,
                    keep_records(context, options.store, store, [&](db::Keeper& keeper) -> Status {
                      SIXPOINT_ASSIGN(outcome.stored_id, keeper.add_constants(row, survey.model));
                      return {};
                    }));
  }
  return outcome;
}

void tell(const std::string& path, const Options& options, const Outcome& outcome,
          Context& context) {
  const calib::SolveReport& report = outcome.report;
  context.out << fmt::format("{}: {}\n", printable(path), printable(report.brief(), 2000));
  if (report.calibration) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      context.out << fmt::format(
          "  {}  {:.3f} LSB/g (+- {:.2f} %)  zero {:.2f} LSB (+- {:.1f} mg)\n", kAxisNames[a],
          1 / report.calibration->sensitivity_g_per_lsb[a],
          100 * report.uncertainty.sensitivity_relative[a], report.calibration->zero_lsb[a],
          report.uncertainty.zero_mg[a]);
    }
  }
  if (!report.verification.missing_directions.empty()) {
    context.out << fmt::format(
        "  missing: lay the unit still for a minute with these axes up: {}\n",
        fmt::join(report.verification.missing_directions, " "));
  }
  if (report.partial) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      context.out << fmt::format(
          "  {}  zero known to {:.0f} mg ({}), sensitivity to {:.1f} % ({})\n", kAxisNames[a],
          report.partial->zero_mg[a],
          report.partial->zero_determined[a] ? "determined" : "not determined",
          100 * report.partial->sensitivity_relative[a],
          report.partial->sensitivity_determined[a] ? "determined" : "not determined");
    }
  }
  for (const std::string& note : report.notes) {
    context.out << "  note: " << printable(note, 1000) << '\n';
  }
  if (outcome.stored_id) {
    context.out << "  stored as " << *outcome.stored_id << '\n';
  } else if (options.save && !report.usable()) {
    context.log().warn("nothing stored: only verified constants are kept");
  }
}

void run(const Options& options, Context& context) {
  auto solve = solve_options(options);
  if (!solve) {
    return report_error(context, "solve", solve.error(), options.json);
  }
  if (!options.output.empty() && options.files.size() > 1) {
    return report_error(context, "solve",
                        Error{ErrorCode::usage, "one output for several recordings", options.output,
                              "solve them one by one, or use --save"},
                        options.json);
  }
  Json all = Json::array();
  for (const std::string& path : options.files) {
    const auto outcome = solve_one(path, options, *solve, context);
    if (!outcome) {
      if (options.files.size() == 1) {
        return report_error(context, "solve", outcome.error(), options.json);
      }
      context.log().error(outcome.error().brief());
      context.worsen(static_cast<int>(outcome.error().code));
      all.push_back({{"file", path}, {"error", error_to_json(outcome.error())}});
      continue;
    }
    context.worsen(outcome->report.usable() ? kExitPassed : kExitFailed);
    if (!options.json) {
      tell(path, options, *outcome, context);
      continue;
    }
    Json answer = options.files.size() == 1 ? document("solve") : Json();
    answer["file"] = path;
    answer.update(calib::to_json(outcome->report));
    answer["stored_id"] = outcome->stored_id ? Json(*outcome->stored_id) : Json(nullptr);
    if (outcome->kept) {
      answer["kept"] = kept_to_json(*outcome->kept);
    }
    if (options.files.size() == 1) {
      return print_json(context, answer);
    }
    all.push_back(std::move(answer));
  }
  if (options.json) {
    Json answer = document("solve");
    answer["files"] = std::move(all);
    print_json(context, answer);
  }
}

}  // namespace

void add_solve(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "solve", "Constants from the still periods of a calibration file or any recording");
  auto options = std::make_shared<Options>();
  command->add_option("files", options->files, "Recordings (.gt3x)")->required();
  command->add_option("--method", options->method,
                      "ls: least squares (default); ga: the paper's genetic algorithm");
  auto* seed = command->add_option("--seed", options->seed, "Seed of the genetic algorithm");
  command->add_flag("--strict-nonzero", options->strict_nonzero,
                    "Reject still periods in which any axis reads exactly zero (the letter of the "
                    "paper's formula)");
  command->add_option("--gravity", options->gravity_m_per_s2,
                      "Local gravity where the recording was made, m/s2");
  command->add_option("--latitude", options->latitude_deg,
                      "... or computed from the latitude in degrees");
  command->add_option("--altitude", options->altitude_m, "... and metres above sea level");
  command->add_option("--prior", options->prior,
                      "'population': where directions are missing, lean on what units of this "
                      "model are like; the result is marked and never verified");
  command->add_option("-o,--output", options->output,
                      "Write verified constants into this constants.json");
  command->add_flag("--save", options->save, "Keep verified constants in the store");
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, seed, &context] {
    options->seed_given = seed->count() > 0;
    run(*options, context);
  });
}

}  // namespace sixpoint::cli

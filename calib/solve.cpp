#include "calib/solve.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace sixpoint::calib {

namespace {

using Json = nlohmann::ordered_json;

PartialKnowledge know_partially(std::span<const StillBlock> blocks,
                                const Calibration& file_constants, const SolveOptions& options) {
  PartialKnowledge out;
  BlockFitOptions fit_options;
  fit_options.gravity_g = options.gravity_g;
  fit_options.try_richer_models = false;
  // As wide as the verification's range of a real sensor.
  fit_options.prior = CalibrationPrior{file_constants, {0.15, 0.15, 0.15}, {0.2, 0.2, 0.2}};
  out.zero_mg.fill(kMgPerG * 0.2);
  out.sensitivity_relative.fill(0.15);
  if (const auto fit = fit_blocks(blocks, file_constants, fit_options)) {
    const ConstantsUncertainty uncertainty = fit->fit.standard_uncertainty();
    out.zero_mg = uncertainty.zero_mg;
    out.sensitivity_relative = uncertainty.sensitivity_relative;
  }
  for (std::size_t a = 0; a < kAxes; ++a) {
    out.zero_determined[a] = out.zero_mg[a] < 5;
    out.sensitivity_determined[a] = out.sensitivity_relative[a] < 0.005;
  }
  return out;
}

// The blocks as a sensor would have measured them that has the six constants of the richer model
// and nothing of its other terms.
std::vector<StillBlock> without_richer_terms(std::span<const StillBlock> blocks,
                                             const BlockFit& fit) {
  const LeastSquaresFit& more = fit.richer->fit;
  const PerAxis<double>& s = more.calibration.sensitivity_g_per_lsb;
  std::vector<StillBlock> out(blocks.begin(), blocks.end());
  for (StillBlock& block : out) {
    const double above_c =
        block.temperature_c ? *block.temperature_c - fit.reference_temperature_c : 0;
    PerAxis<double> u{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      block.mean_lsb[a] -= more.zero_lsb_per_c[a] * above_c;
      u[a] = more.calibration.to_g(a, block.mean_lsb[a]);
    }
    const auto& [xy, xz, yz] = more.cross_axis;
    block.mean_lsb[0] += (xy * u[1] + xz * u[2]) / s[0];
    block.mean_lsb[1] += (xy * u[0] + yz * u[2]) / s[1];
    block.mean_lsb[2] += (xz * u[0] + yz * u[1]) / s[2];
  }
  return out;
}

Status finish_constants(SolveReport& report, const BlockFit& fit, const SolveOptions& options) {
  report.statistical = fit.best().standard_uncertainty();
  if (options.method == SolveMethod::genetic && report.search) {
    // Its members wander about the answer, and it may lie beside the minimum; least squares'
    // covariance knows nothing of that.
    const double apart_mg =
        difference_over_sphere(fit.best().calibration, *report.calibration).rms_mg;
    const double wander_mg = std::hypot(report.search->wander_mg, apart_mg);
    for (std::size_t a = 0; a < kAxes; ++a) {
      report.statistical.zero_mg[a] = std::hypot(report.statistical.zero_mg[a], wander_mg);
      report.statistical.sensitivity_relative[a] = std::hypot(
          report.statistical.sensitivity_relative[a], report.search->wander_mg / kMgPerG);
    }
  }
  if (fit.drift) {
    const PerAxis<double> zero_mg = fit.drift->zero_mg();
    const PerAxis<double> relative = fit.drift->sensitivity_relative();
    for (std::size_t a = 0; a < kAxes; ++a) {
      report.statistical.zero_mg[a] = std::hypot(report.statistical.zero_mg[a], zero_mg[a]);
      report.statistical.sensitivity_relative[a] =
          std::hypot(report.statistical.sensitivity_relative[a], relative[a]);
    }
  }
  report.uncertainty = report.statistical;
  for (double& relative : report.uncertainty.sensitivity_relative) {
    relative = std::hypot(relative, options.gravity_sd_g / options.gravity_g);
  }
  report.residual_after_mg = cells_rms_mg(fit.cells, *report.calibration, options.gravity_g);
  auto rounded =
      round_constants(*report.calibration, fit.cells, fit.cell_sigma_mg, options.gravity_g);
  if (rounded) {
    report.stored = *rounded;
    SIXPOINT_ASSIGN(const Calibration applied, calibration_from(*rounded));
    report.residual_rounded_mg = cells_rms_mg(fit.cells, applied, options.gravity_g);
  } else {
    report.notes.push_back("the constants do not fit into a unit's memory: " +
                           rounded.error().what);
  }
  return {};
}

// The posterior of a documented prior, where the data alone do not determine the constants.
Status lean_on_prior(SolveReport& report, std::span<const StillBlock> chosen,
                     const SolveOptions& options) {
  BlockFitOptions fit_options;
  fit_options.gravity_g = options.gravity_g;
  fit_options.prior = options.prior;
  fit_options.try_richer_models = false;
  SIXPOINT_ASSIGN(report.fit, fit_blocks(chosen, options.prior->mean, fit_options));
  report.calibration = report.fit->fit.calibration;
  report.iterations = report.fit->fit.iterations;
  report.search.reset();
  report.from_prior = true;
  report.verification.verified = false;
  report.verification.verdict = Verdict::rests_on_prior;
  report.verification.reasons.emplace_back(
      "the constants rest on a population prior where the data are silent");
  return finish_constants(report, *report.fit, options);
}

// From a fit to the verdict: the genetic algorithm beside it, rounding, verification, notes.
Result<SolveReport> solve_fitted(SolveReport report, BlockFit fit,
                                 std::span<const StillBlock> chosen,
                                 const Calibration& file_constants, const SolveOptions& options) {
  BlockFitOptions fit_options;
  fit_options.gravity_g = options.gravity_g;
  report.fit = std::move(fit);
  // Its rounded means are a check on each other: the same minimum by another way.
  GeneticOptions genetic_options;
  genetic_options.seed = options.seed;
  genetic_options.gravity_g = options.gravity_g;
  // Where cross-axis or temperature terms are admitted, it is given the blocks without them: its
  // six constants would make up for them in the directions that were met, and be off in the others.
  std::vector<StillBlock> plain;
  if (report.fit->richer) {
    plain = without_richer_terms(chosen, *report.fit);
  }
  SIXPOINT_ASSIGN(report.search,
                  genetic(plain.empty() ? chosen : std::span<const StillBlock>(plain),
                          file_constants, genetic_options));
  report.calibration = options.method == SolveMethod::genetic ? report.search->calibration
                                                              : report.fit->best().calibration;
  report.iterations = options.method == SolveMethod::genetic
                          ? static_cast<int>(report.search->fitness_mg.size())
                          : report.fit->fit.iterations;
  SIXPOINT_CHECK(finish_constants(report, *report.fit, options));
  report.residual_before_mg = cells_rms_mg(report.fit->cells, file_constants, options.gravity_g);
  report.verification = verify(chosen, file_constants, *report.calibration, *report.fit,
                               report.search, fit_options, options.limits);
  std::vector<std::string> doubts;
  if (options.method == SolveMethod::genetic) {
    doubts = report.search->reasons;
    // Where it is not the same as least squares it must at least be within what is promised.
    const double apart_mg =
        difference_over_sphere(report.fit->best().calibration, *report.calibration).worst_mg;
    if (!(apart_mg <= options.limits.worst_direction_mg)) {
      doubts.push_back(fmt::format(
          "the genetic algorithm's answer is {:.1f} mg from least squares' in the worst direction "
          "(limit {:.1f} mg)",
          apart_mg, options.limits.worst_direction_mg));
    }
  }
  if (!doubts.empty()) {
    if (report.verification.verified) {
      report.verification.reasons.clear();
    }
    report.verification.verified = false;
    report.verification.verdict = Verdict::not_verified;
    report.verification.reasons.insert(report.verification.reasons.end(), doubts.begin(),
                                       doubts.end());
  }
  if (!(report.verification.worst_direction_mg <= options.limits.worst_direction_mg)) {
    report.partial = know_partially(chosen, file_constants, options);
    if (options.prior && !report.verification.verified) {
      // Enough directions by the 0.3 g rule, and still too little in them.
      SIXPOINT_CHECK(lean_on_prior(report, chosen, options));
      return report;
    }
  }
  if (options.prior) {
    report.notes.emplace_back(
        "the data determine the constants without the prior, which was not used");
  }
  if (!report.fit->left_out_reason.empty()) {
    report.notes.push_back(report.fit->left_out_reason);
  }
  if (report.fit->richer && report.fit->richer->fit.model.cross_axis) {
    const auto& c = report.fit->richer->fit.cross_axis;
    report.notes.push_back(fmt::format(
        "the data show cross-axis terms of {:+.2f} % (xy) {:+.2f} % (xz) {:+.2f} % (yz), which six "
        "constants cannot correct: unseen directions are predicted to {:.1f} mg with them, {:.1f} "
        "mg without",
        100 * c[0], 100 * c[1], 100 * c[2], report.fit->richer->held_out_rms_mg,
        report.fit->held_out_rms_mg.value_or(0)));
  }
  if (report.fit->richer && report.fit->richer->fit.model.temperature) {
    const LeastSquaresFit& more = report.fit->richer->fit;
    report.notes.push_back(
        fmt::format("the data show zeros that drift by {:+.2f} {:+.2f} {:+.2f} mg/C (X Y Z), which "
                    "six constants "
                    "cannot follow: they hold at {:.1f} C; unseen directions are predicted to "
                    "{:.1f} mg with the "
                    "drift, {:.1f} mg without",
                    kMgPerG * more.calibration.sensitivity_g_per_lsb[0] * more.zero_lsb_per_c[0],
                    kMgPerG * more.calibration.sensitivity_g_per_lsb[1] * more.zero_lsb_per_c[1],
                    kMgPerG * more.calibration.sensitivity_g_per_lsb[2] * more.zero_lsb_per_c[2],
                    report.fit->reference_temperature_c, report.fit->richer->held_out_rms_mg,
                    report.fit->held_out_rms_mg.value_or(0)));
  }
  if (report.fit->temperature_range_c >= 10 &&
      !(report.fit->richer && report.fit->richer->fit.model.temperature)) {
    report.notes.push_back(
        fmt::format("the temperature changed by {:.0f} C; the constants hold for its mean",
                    report.fit->temperature_range_c));
  }
  if (report.residual_rounded_mg && *report.residual_rounded_mg > options.limits.applied_mg &&
      report.verification.verified) {
    report.verification.verified = false;
    report.verification.verdict = Verdict::not_verified;
    report.verification.reasons = {
        fmt::format("rounded to a unit's nine integers the constants leave still blocks {:.1f} mg "
                    "from 1 g (limit {:.1f} mg)",
                    *report.residual_rounded_mg, options.limits.applied_mg)};
  }
  return report;
}

// The paper's rule is about what the sensor was exposed to, and reads it off the file's own
// constants. Where these are the wrong ones, by 0.2 g and more, a side that was reached may not
// look like it. So the rule is asked of the new constants as well, and they are believed where
// directions that the fit has not seen bear them out.
Result<std::optional<SolveReport>> solve_exposed(const SolveReport& begun,
                                                 std::span<const StillBlock> chosen,
                                                 const Calibration& file_constants,
                                                 const SolveOptions& options) {
  BlockFitOptions fit_options;
  fit_options.gravity_g = options.gravity_g;
  auto fit = fit_blocks(chosen, file_constants, fit_options);
  if (!fit || fit->redundancy < options.limits.held_out_directions ||
      !coverage_of(chosen, fit->best().calibration).complete()) {
    return std::optional<SolveReport>();
  }
  SIXPOINT_ASSIGN(SolveReport report,
                  solve_fitted(begun, std::move(*fit), chosen, file_constants, options));
  if (report.verification.verdict != Verdict::verified) {
    return std::optional<SolveReport>();
  }
  report.notes.push_back(
      fmt::format("towards {} no still block reaches beyond 0.3 g by the file's own constants; by "
                  "the new ones, "
                  "which unseen directions confirm, all six sides do",
                  fmt::join(begun.coverage.missing_directions(), ", ")));
  return std::optional(std::move(report));
}

Result<SolveReport> solve_chosen(std::span<const StillBlock> chosen,
                                 const Calibration& file_constants, const SolveOptions& options) {
  SolveReport report;
  report.method = options.method;
  report.gravity_g = options.gravity_g;
  report.points = chosen.size();
  report.coverage = coverage_of(chosen);
  report.verification.missing_directions = report.coverage.missing_directions();

  if (chosen.empty()) {
    report.verification.verdict = Verdict::incomplete;
    report.verification.reasons.emplace_back(
        "no still block of 4 s was found; lay the unit on each of its six sides for a minute");
    return report;
  }
  BlockFitOptions fit_options;
  fit_options.gravity_g = options.gravity_g;
  const auto cells = cells_of(chosen);
  report.residual_before_mg = cells_rms_mg(cells, file_constants, options.gravity_g);

  if (!report.coverage.complete()) {
    SIXPOINT_ASSIGN(auto exposed, solve_exposed(report, chosen, file_constants, options));
    if (exposed) {
      return std::move(*exposed);
    }
    report.verification.verdict = Verdict::incomplete;
    report.verification.reasons.push_back(
        fmt::format("no still block reaches beyond 0.3 g towards {}",
                    fmt::join(report.verification.missing_directions, ", ")));
    report.partial = know_partially(chosen, file_constants, options);
    if (options.prior) {
      SIXPOINT_CHECK(lean_on_prior(report, chosen, options));
    }
    return report;
  }

  auto fit = fit_blocks(chosen, file_constants, fit_options);
  if (!fit) {
    // Directions that pass the 0.3 g rule and are still fewer than six: not a damaged file.
    report.verification.verdict = Verdict::not_verified;
    report.verification.reasons.push_back(fit.error().what + "; " + fit.error().hint);
    report.partial = know_partially(chosen, file_constants, options);
    if (options.prior) {
      SIXPOINT_CHECK(lean_on_prior(report, chosen, options));
    }
    return report;
  }
  return solve_fitted(std::move(report), std::move(*fit), chosen, file_constants, options);
}

}  // namespace

std::string_view to_string(SolveMethod method) {
  return method == SolveMethod::genetic ? "ga" : "ls";
}

Result<SolveMethod> parse_solve_method(std::string_view text) {
  if (text == "ls") {
    return SolveMethod::least_squares;
  }
  if (text == "ga") {
    return SolveMethod::genetic;
  }
  return fail(ErrorCode::usage, fmt::format("unknown method '{}'", text), "", "use 'ls' or 'ga'");
}

Result<SolveReport> solve_from_still_blocks(std::span<const StillBlock> blocks,
                                            const Calibration& file_constants,
                                            const SolveOptions& options) {
  SIXPOINT_CHECK(validate(file_constants));
  if (!(options.gravity_g > 0.99 && options.gravity_g < 1.01) || !(options.gravity_sd_g >= 0)) {
    return fail(ErrorCode::usage,
                fmt::format("{} g is no gravity of this planet's surface", options.gravity_g),
                "solve", "give local gravity in m/s2, or latitude and altitude");
  }
  for (const StillBlock& block : blocks) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (!std::isfinite(block.mean_g[a]) || !std::isfinite(block.mean_lsb[a]) ||
          !std::isfinite(block.sd_lsb[a]) || !std::isfinite(block.ramp_variance_lsb2[a])) {
        return fail(ErrorCode::bad_data, "a still block is not a finite number", "solve",
                    "the recording is damaged");
      }
    }
  }
  // By the paper's letter first; with the blocks that only sensor noise keeps from it where those
  // do not suffice.
  std::vector<StillBlock> paper;
  for (const StillBlock& block : blocks) {
    if (!block.noisy) {
      paper.push_back(block);
    }
  }
  SIXPOINT_ASSIGN(SolveReport report, solve_chosen(paper, file_constants, options));
  if (!report.usable() && paper.size() < blocks.size()) {
    SIXPOINT_ASSIGN(report, solve_chosen(blocks, file_constants, options));
    report.noisy_points = blocks.size() - paper.size();
    report.notes.push_back(fmt::format(
        "{} of {} still blocks exceed the paper's residual limit of 0.015 g by sensor noise alone "
        "and are used because the others do not suffice",
        report.noisy_points, blocks.size()));
  }
  report.points_found = blocks.size();
  return report;
}

std::string SolveReport::brief() const {
  std::string line = fmt::format("{} still blocks: {}", points, verification.brief());
  if (calibration && residual_after_mg) {
    line +=
        fmt::format("; {:.1f} mg before, {:.1f} mg after", residual_before_mg, *residual_after_mg);
  }
  return line;
}

Json to_json(const SolveReport& report) {
  const auto maybe = [](const std::optional<double>& value) {
    return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
  };
  Json json;
  json["serial"] = report.serial;
  json["filter"] = report.filter ? Json(to_string(*report.filter)) : Json(nullptr);
  json["method"] = to_string(report.method);
  if (report.calibration && report.stored) {
    json["constants"] = to_json(*report.calibration, *report.stored);
  } else if (report.calibration) {
    json["constants"]["sensitivity_g_per_lsb"] = report.calibration->sensitivity_g_per_lsb;
    json["constants"]["zero_lsb"] = report.calibration->zero_lsb;
  } else {
    json["constants"] = nullptr;
  }
  if (report.calibration) {
    json["standard_uncertainty"] = to_json(report.uncertainty);
    json["standard_uncertainty"]["of_the_data_alone"] = to_json(report.statistical);
  } else {
    json["standard_uncertainty"] = nullptr;
  }
  json["points"] = report.points;
  json["points_found"] = report.points_found;
  json["noisy_points"] = report.noisy_points;
  if (report.points > 0) {
    json["coverage_g"]["min"] = report.coverage.min_g;
    json["coverage_g"]["max"] = report.coverage.max_g;
    // Blocks at -1.3 .. -0.7, -0.7 .. 0.7 and 0.7 .. 1.3 g of each axis.
    Json& subsets = json["coverage_g"]["value_subsets"];
    for (const auto& [name, subset] :
         {std::pair{"low", ValueSubset::low}, std::pair{"middle", ValueSubset::middle},
          std::pair{"high", ValueSubset::high}}) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        subsets[name].push_back(report.coverage.subset_blocks[a][static_cast<std::size_t>(subset)]);
      }
    }
  } else {
    json["coverage_g"]["min"] = nullptr;
    json["coverage_g"]["max"] = nullptr;
  }
  json["residual_mg"]["before"] =
      report.points > 0 ? Json(report.residual_before_mg) : Json(nullptr);
  json["residual_mg"]["after"] = maybe(report.residual_after_mg);
  json["residual_mg"]["rounded"] = maybe(report.residual_rounded_mg);
  json["verified"] = report.verification.verified;
  json["verdict"] = to_string(report.verification.verdict);
  json["reasons"] = report.verification.reasons;
  json["missing_directions"] = report.verification.missing_directions;
  json["notes"] = report.notes;
  json["iterations"] = report.iterations;
  json["seconds"] = report.seconds;
  json["gravity_m_per_s2"] = report.gravity_g * kStandardGravity_m_per_s2;
  json["from_prior"] = report.from_prior;
  json["verification"] = to_json(report.verification);
  if (report.fit) {
    const BlockFit& fit = *report.fit;
    Json& least = json["least_squares"];
    least["converged"] = fit.fit.converged;
    least["condition"] = fit.fit.condition;
    least["degrees_of_freedom"] = fit.fit.degrees_of_freedom;
    least["blocks_left_out"] = fit.blocks_left_out;
    least["block_sd_mg"] = fit.block_sd_mg;
    least["structural_mg"] = fit.structural_mg;
    if (fit.richer) {
      Json& richer = json["richer_model"];
      const LeastSquaresFit& more = fit.richer->fit;
      richer["sensitivity_g_per_lsb"] = more.calibration.sensitivity_g_per_lsb;
      richer["zero_lsb"] = more.calibration.zero_lsb;
      richer["cross_axis"] = more.model.cross_axis ? Json(more.cross_axis) : Json(nullptr);
      richer["zero_lsb_per_c"] = more.model.temperature ? Json(more.zero_lsb_per_c) : Json(nullptr);
      richer["reference_temperature_c"] =
          more.model.temperature ? Json(fit.reference_temperature_c) : Json(nullptr);
      richer["held_out_rms_mg"] = fit.richer->held_out_rms_mg;
    }
  }
  if (report.search) {
    Json& search = json["genetic"];
    search["settled"] = report.search->settled;
    search["fitness_mg"] = report.search->fitness_mg;
    search["level_mg"] = report.search->level_mg;
    search["spread_mg"] = report.search->spread_mg;
    search["trend_mg"] = report.search->trend_mg;
    search["constants"]["sensitivity_g_per_lsb"] = report.search->calibration.sensitivity_g_per_lsb;
    search["constants"]["zero_lsb"] = report.search->calibration.zero_lsb;
  }
  if (report.temperature) {
    const TemperatureDrift& drift = *report.temperature;
    Json& temperature = json["temperature"];
    temperature["low_c"] = drift.low_c;
    temperature["high_c"] = drift.high_c;
    temperature["zero_mg_per_c"] = drift.zero_mg_per_c;
    temperature["standard_uncertainty_mg_per_c"] = drift.standard_uncertainty_mg_per_c;
    temperature["blocks"] = drift.blocks;
  }
  if (report.partial) {
    Json& partial = json["partial"];
    partial["zero_mg"] = report.partial->zero_mg;
    partial["sensitivity_relative"] = report.partial->sensitivity_relative;
    partial["zero_determined"] = report.partial->zero_determined;
    partial["sensitivity_determined"] = report.partial->sensitivity_determined;
  }
  return json;
}

Result<ConstantsRecord> record_of(const SolveReport& report, UtcTime made_at,
                                  ConstantsOrigin made_from) {
  if (!report.calibration || !report.stored) {
    return fail(ErrorCode::bad_data, "the data did not determine constants", report.serial,
                "see missing_directions and reasons of 'sixpoint solve'");
  }
  if (report.serial.empty() || !report.filter) {
    return fail(ErrorCode::bad_data, "the recording names no serial number or filter configuration",
                report.serial, "constants belong to both and cannot be kept without");
  }
  ConstantsRecord record;
  record.serial = report.serial;
  record.filter = *report.filter;
  record.calibration = *report.calibration;
  record.stored = *report.stored;
  record.uncertainty = report.uncertainty;
  record.method = to_string(report.method);
  record.made_at = made_at;
  record.made_from = std::move(made_from);
  record.gravity_m_per_s2 = report.gravity_g * kStandardGravity_m_per_s2;
  record.from_prior = report.from_prior;
  return record;
}

Result<CalibrationPrior> population_prior(std::string_view serial, FilterConfiguration filter) {
  if (!serial.starts_with("MOS") && !serial.starts_with("TAS")) {
    return fail(ErrorCode::bad_data,
                fmt::format("nothing is known about the constants of units like '{}'", serial),
                "population prior", "record a calibration file of the six sides");
  }
  CalibrationPrior prior;
  // current: MOS2E39180594, TAS1E31150129, TAS1H30182785; legacy: MOS2A45130450 and
  // MOS2A45130451. Means of (positive - negative) / 2 and of zero.
  const PerAxis<double> half = filter == FilterConfiguration::current
                                   ? PerAxis<double>{233.3, 247.5, 229.5}
                                   : PerAxis<double>{263.3, 275.8, 247.3};
  prior.mean.zero_lsb = filter == FilterConfiguration::current ? PerAxis<double>{71.3, 42.7, 77.3}
                                                               : PerAxis<double>{58.5, 7.0, 52.0};
  for (std::size_t a = 0; a < kAxes; ++a) {
    prior.mean.sensitivity_g_per_lsb[a] = 1 / half[a];
    prior.sensitivity_relative_sd[a] = 0.05;
    prior.zero_g_sd[a] = 15 / half[a];
  }
  return prior;
}

}  // namespace sixpoint::calib

#include "calib/solve.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint::calib {

namespace {

// What one solution is made from.
struct Input {
  std::span<const StillBlock> blocks;
  const Calibration& file_constants;
  const SolveOptions& options;

  BlockFitOptions fit_options() const {
    BlockFitOptions out;
    out.gravity_g = options.gravity_g;
    return out;
  }
  Result<BlockFit> fit_with_prior(const CalibrationPrior& prior, const Calibration& start) const {
    BlockFitOptions with_prior = fit_options();
    with_prior.prior = prior;
    with_prior.try_richer_models = false;
    return fit_blocks(blocks, start, with_prior);
  }
};

PartialKnowledge partial_knowledge(const Input& in) {
  // As wide as the verification's range of a real sensor.
  constexpr double kSensitivityRange = 0.15;
  constexpr double kZeroRange_g = 0.2;
  PartialKnowledge out;
  out.zero_mg.fill(kMgPerG * kZeroRange_g);
  out.sensitivity_relative.fill(kSensitivityRange);
  CalibrationPrior range{in.file_constants, {}, {}};
  range.sensitivity_relative_sd.fill(kSensitivityRange);
  range.zero_g_sd.fill(kZeroRange_g);
  if (const auto fit = in.fit_with_prior(range, in.file_constants)) {
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
        block.temperature_c ? *block.temperature_c - fit.reference_temperature_c.value_or(0) : 0;
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

void add_uncertainty(ConstantsUncertainty& to, const PerAxis<double>& sensitivity_relative,
                     const PerAxis<double>& zero_mg) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    to.zero_mg[a] = std::hypot(to.zero_mg[a], zero_mg[a]);
    to.sensitivity_relative[a] = std::hypot(to.sensitivity_relative[a], sensitivity_relative[a]);
  }
}

// Six constants that are not the sensor's own are that far from them.
void add_distance(ConstantsUncertainty& to, const Calibration& own, const Calibration& six) {
  PerAxis<double> relative{};
  PerAxis<double> zero_mg{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    relative[a] = six.sensitivity_g_per_lsb[a] / own.sensitivity_g_per_lsb[a] - 1;
    zero_mg[a] = kMgPerG * own.sensitivity_g_per_lsb[a] * (six.zero_lsb[a] - own.zero_lsb[a]);
  }
  add_uncertainty(to, relative, zero_mg);
}

// Uncertainty, residuals and the nine integers of report.calibration.
Status finish_constants(SolveReport& report, const SolveOptions& options) {
  const BlockFit& fit = *report.fit;
  report.statistical = fit.best().standard_uncertainty();
  if (options.method == SolveMethod::genetic && report.search) {
    // Its best members scatter about the answer, and the answer may lie beside the minimum. Neither
    // is in least squares' covariance.
    const double scatter_mg = report.search->scatter_mg;
    const double apart_mg =
        difference_over_sphere(fit.best().calibration, *report.calibration).rms_mg;
    const double zero_mg = std::hypot(scatter_mg, apart_mg);
    const double relative = scatter_mg / kMgPerG;
    add_uncertainty(report.statistical, {relative, relative, relative},
                    {zero_mg, zero_mg, zero_mg});
  }
  if (fit.drift) {
    add_uncertainty(report.statistical, fit.drift->sensitivity_relative(), fit.drift->zero_mg());
  }
  if (report.six && options.method == SolveMethod::least_squares) {
    add_distance(report.statistical, fit.best().calibration, report.six->calibration);
  }
  report.uncertainty = report.statistical;
  const double gravity = options.gravity_sd_g / options.gravity_g;
  add_uncertainty(report.uncertainty, {gravity, gravity, gravity}, {});
  report.residual_after_mg = cells_rms_mg(fit.cells, *report.calibration, options.gravity_g);
  auto rounded = round_constants(*report.calibration, fit.cells,
                                 report.six ? report.six->cell_sigma_mg : fit.cell_sigma_mg,
                                 options.gravity_g);
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
Status solve_with_prior(SolveReport& report, const Input& in) {
  const CalibrationPrior& prior = *in.options.prior;
  SIXPOINT_ASSIGN(report.fit, in.fit_with_prior(prior, prior.mean));
  report.calibration = report.fit->fit.calibration;
  report.iterations = report.fit->fit.iterations;
  report.search.reset();
  report.from_prior = true;
  report.verification.verified = false;
  report.verification.verdict = Verdict::rests_on_prior;
  report.verification.reasons.emplace_back(
      "the constants rest on a population prior where the data are silent");
  return finish_constants(report, in.options);
}

double residual_before_mg(std::span<const DirectionCell> cells, const Input& in) {
  if (!in.options.file_g) {
    return cells_rms_mg(cells, in.file_constants, in.options.gravity_g);
  }
  std::vector<DirectionCell> in_g(cells.begin(), cells.end());
  for (DirectionCell& cell : in_g) {
    cell.mean_lsb = in.options.file_g(cell.mean_lsb);
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double g_per_lsb = in.file_constants.sensitivity_g_per_lsb[a];
      cell.variance_lsb2[a] *= g_per_lsb * g_per_lsb;
    }
  }
  return cells_rms_mg(in_g, Calibration{{1, 1, 1}, {}}, in.options.gravity_g);
}

// A report without verified constants: what the data determine nevertheless.
Result<SolveReport> undetermined(SolveReport report, Verdict verdict, std::string reason,
                                 const Input& in) {
  report.verification.verdict = verdict;
  report.verification.reasons.push_back(std::move(reason));
  report.partial = partial_knowledge(in);
  if (in.options.prior) {
    SIXPOINT_CHECK(solve_with_prior(report, in));
  }
  return report;
}

// The same minimum by another way. Where cross-axis or temperature terms are admitted, the genetic
// algorithm is given the blocks without them: its six constants would make up for them in the
// directions that were met, and be off in the others.
Result<GeneticResult> search_beside(const BlockFit& fit, const Input& in) {
  GeneticOptions options;
  options.seed = in.options.seed;
  options.gravity_g = in.options.gravity_g;
  if (fit.richer) {
    return genetic(without_richer_terms(in.blocks, fit), in.file_constants, options);
  }
  return genetic(in.blocks, in.file_constants, options);
}

void refuse(Verification& verification, std::vector<std::string> reasons) {
  if (verification.verified) {
    verification.reasons.clear();
  }
  verification.verified = false;
  verification.verdict = Verdict::not_verified;
  verification.reasons.insert(verification.reasons.end(), reasons.begin(), reasons.end());
}

// Why the genetic algorithm's answer is not to be used.
std::vector<std::string> genetic_doubts(const SolveReport& report) {
  std::vector<std::string> doubts = report.search->reasons;
  // Where it is not the same as least squares it must at least be within what is promised.
  const double apart_mg =
      difference_over_sphere(report.fit->best().calibration, *report.calibration).worst_mg;
  if (!(apart_mg <= VerificationLimits::worst_direction_mg)) {
    doubts.push_back(fmt::format(
        "the genetic algorithm's answer is {:.1f} mg from least squares' in the worst direction "
        "(limit {:.1f} mg)",
        apart_mg, VerificationLimits::worst_direction_mg));
  }
  return doubts;
}

// What a person should know of the fit besides the verdict.
void add_notes(std::vector<std::string>& notes, const BlockFit& fit, const BestSix& six) {
  if (!fit.left_out_reason.empty()) {
    notes.push_back(fit.left_out_reason);
  }
  const FitModel model = fit.richer ? fit.richer->fit.model : FitModel();
  if (model.cross_axis) {
    const auto& c = fit.richer->fit.cross_axis;
    notes.push_back(fmt::format(
        "the data show cross-axis terms of {:+.2f} % (xy) {:+.2f} % (xz) {:+.2f} % (yz), which six "
        "constants cannot correct: unseen directions are predicted to {:.1f} mg with them, {:.1f} "
        "mg without",
        100 * c[0], 100 * c[1], 100 * c[2], fit.richer->held_out_rms_mg,
        fit.held_out_rms_mg.value_or(0)));
    if (six.from != SixFrom::of_sensor) {
      notes.push_back(fmt::format(
          "the six constants are those that suit the {} best: over the time at rest they leave "
          "{:.1f} mg in unseen directions (the sensor's own six {:.1f} mg, the cross-axis terms "
          "{:.1f} mg); towards directions that the unit hardly took they may be wrong by up to "
          "{:.0f} mg",
          six.from == SixFrom::of_time ? "time at rest" : "directions at rest",
          six.unseen_chosen_mg(), six.unseen_mg->of_sensor, six.unseen_mg->matrix,
          six.elsewhere_mg));
    }
  }
  if (model.temperature) {
    const LeastSquaresFit& more = fit.richer->fit;
    const auto mg_per_c = [&](std::size_t a) {
      return kMgPerG * more.calibration.sensitivity_g_per_lsb[a] * more.zero_lsb_per_c[a];
    };
    notes.push_back(fmt::format(
        "the data show zeros that drift by {:+.2f} {:+.2f} {:+.2f} mg/C (X Y Z), which six "
        "constants cannot follow: they hold at {:.1f} C; unseen directions are predicted to "
        "{:.1f} mg with the drift, {:.1f} mg without",
        mg_per_c(0), mg_per_c(1), mg_per_c(2), fit.reference_temperature_c.value_or(0),
        fit.richer->held_out_rms_mg, fit.held_out_rms_mg.value_or(0)));
  } else if (fit.temperature_range_c >= 10) {
    notes.push_back(
        fmt::format("the temperature changed by {:.0f} C; the constants hold for its mean",
                    fit.temperature_range_c));
  }
}

// The still blocks by constants of either method, with the terms that were admitted.
double error_with_terms_mg(const BlockFit& fit, const Calibration& constants, double gravity_g) {
  LeastSquaresFit terms = fit.best();
  terms.calibration = constants;
  const auto sizes = neighbourhood_sizes(fit.cells, fit.directions);
  double square = 0;
  double weights = 0;
  for (std::size_t k = 0; k < fit.cells.size(); ++k) {
    const double off = magnitude_g(terms, point_of(fit.cells[k], 1)) - gravity_g;
    square += off * off / sizes[k];
    weights += 1 / sizes[k];
  }
  return kMgPerG * std::sqrt(square / weights);
}

void compare_methods(SolveReport& report, double gravity_g) {
  const BlockFit& fit = *report.fit;
  const Calibration& least = fit.best().calibration;
  const Calibration& genetic = report.search->calibration;
  report.trust = whom_to_trust(
      {fit.best().converged, report.search->settled, difference_over_sphere(least, genetic).rms_mg,
       error_with_terms_mg(fit, least, gravity_g), error_with_terms_mg(fit, genetic, gravity_g)});
  if (report.trust->trusted != Trusted::both) {
    report.notes.push_back(report.trust->why);
  }
}

// The map with cross-axis terms, of the same blocks, verified when the constants are and its own
// worst direction is within the limit.
void add_cross_axis(SolveReport& report, const SolveOptions& options) {
  const BlockFit& fit = *report.fit;
  report.cross_axis = cross_axis_map(fit, *report.six, options.gravity_sd_g / options.gravity_g);
  if (!report.cross_axis) {
    return;
  }
  if (fit.drift) {
    add_uncertainty(report.cross_axis->uncertainty, fit.drift->sensitivity_relative(),
                    fit.drift->zero_mg());
  }
  report.cross_axis->verified =
      report.verification.verified &&
      worst_direction_with_terms_mg(fit.best()) <= VerificationLimits::worst_direction_mg;
}

// From a fit to the verdict: the genetic algorithm beside it, rounding, verification, notes.
Result<SolveReport> solve_fitted(SolveReport report, BlockFit fit, const Input& in) {
  const SolveOptions& options = in.options;
  const bool by_search = options.method == SolveMethod::genetic;
  report.fit = std::move(fit);
  SIXPOINT_ASSIGN(report.search, search_beside(*report.fit, in));
  report.six = best_six(*report.fit, options.gravity_g);
  const Calibration sensors =
      by_search ? report.search->calibration : report.fit->best().calibration;
  report.calibration = by_search ? sensors : report.six->calibration;
  report.iterations =
      by_search ? static_cast<int>(report.search->fitness_mg.size()) : report.fit->fit.iterations;
  SIXPOINT_CHECK(finish_constants(report, options));
  report.residual_before_mg = residual_before_mg(report.fit->cells, in);
  report.verification = verify(in.blocks, in.file_constants, sensors, *report.fit, report.search,
                               in.fit_options(), report.calibration);
  if (by_search) {
    if (auto doubts = genetic_doubts(report); !doubts.empty()) {
      refuse(report.verification, std::move(doubts));
    }
  }
  if (!(report.verification.worst_direction_mg <= VerificationLimits::worst_direction_mg)) {
    report.partial = partial_knowledge(in);
    if (options.prior && !report.verification.verified) {
      // Enough directions by the 0.3 g rule, and still too little in them.
      SIXPOINT_CHECK(solve_with_prior(report, in));
      return report;
    }
  }
  if (options.prior) {
    report.notes.emplace_back(
        "the data determine the constants without the prior, which was not used");
  }
  add_notes(report.notes, *report.fit, *report.six);
  compare_methods(report, options.gravity_g);
  if (report.residual_rounded_mg && *report.residual_rounded_mg > VerificationLimits::applied_mg &&
      report.verification.verified) {
    refuse(report.verification,
           {fmt::format("rounded to a unit's nine integers the constants leave still blocks "
                        "{:.1f} mg from 1 g (limit {:.1f} mg)",
                        *report.residual_rounded_mg, VerificationLimits::applied_mg)});
  }
  add_cross_axis(report, options);
  return report;
}

// The paper's 0.3 g rule uses the file's own constants. Where these are wrong by 0.2 g and more, a
// side that was reached may seem not to be. So the rule is applied to the new constants as well,
// which count where directions that the fit has not seen confirm them.
Result<std::optional<SolveReport>> solve_exposed(const SolveReport& begun, const Input& in) {
  auto fit = fit_blocks(in.blocks, in.file_constants, in.fit_options());
  if (!fit || fit->redundancy < VerificationLimits::held_out_directions ||
      !coverage_of(in.blocks, fit->best().calibration).complete()) {
    return std::optional<SolveReport>();
  }
  SIXPOINT_ASSIGN(SolveReport report, solve_fitted(begun, std::move(*fit), in));
  if (report.verification.verdict != Verdict::verified) {
    return std::optional<SolveReport>();
  }
  report.notes.push_back(
      fmt::format("towards {} no still block reaches beyond 0.3 g by the file's own constants; by "
                  "the new ones, which unseen directions confirm, all six sides do",
                  fmt::join(begun.coverage.missing_directions(), ", ")));
  return std::optional(std::move(report));
}

Result<SolveReport> solve_input(const Input& in) {
  SolveReport report;
  report.method = in.options.method;
  report.gravity_g = in.options.gravity_g;
  report.points = in.blocks.size();
  report.coverage = coverage_of(in.blocks);
  report.verification.missing_directions = report.coverage.missing_directions();
  if (in.blocks.empty()) {
    report.verification.verdict = Verdict::incomplete;
    report.verification.reasons.emplace_back(
        "no still block of 4 s was found; lay the unit on each of its six sides for a minute");
    return report;
  }
  report.residual_before_mg = residual_before_mg(cells_of(in.blocks), in);
  if (!report.coverage.complete()) {
    SIXPOINT_ASSIGN(auto exposed, solve_exposed(report, in));
    if (exposed) {
      return std::move(*exposed);
    }
    const auto reason = fmt::format("no still block reaches beyond 0.3 g towards {}",
                                    fmt::join(report.verification.missing_directions, ", "));
    return undetermined(std::move(report), Verdict::incomplete, reason, in);
  }
  auto fit = fit_blocks(in.blocks, in.file_constants, in.fit_options());
  if (!fit) {
    // Directions that pass the 0.3 g rule and are still fewer than six: not a damaged file.
    return undetermined(std::move(report), Verdict::not_verified,
                        fit.error().what + "; " + fit.error().hint, in);
  }
  return solve_fitted(std::move(report), std::move(*fit), in);
}

}  // namespace

std::string_view to_string(SolveMethod method) {
  return method == SolveMethod::genetic ? "ga" : "ls";
}

Result<SolveMethod> parse_solve_method(std::string_view text) {
  if (text == "ls" || text == "ga") {
    return text == "ga" ? SolveMethod::genetic : SolveMethod::least_squares;
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
    if (!all_finite(block.mean_g, block.mean_lsb, block.sd_lsb, block.ramp_variance_lsb2)) {
      return fail(ErrorCode::bad_data, "a still block is not a finite number", "solve",
                  "the recording is damaged");
    }
  }
  // The paper's criteria first. Where they leave too few blocks or directions, also those that fail
  // only by sensor noise. Where the data contradict the constants, or drift, more are no remedy.
  std::vector<StillBlock> paper;
  for (const StillBlock& block : blocks) {
    if (!block.noisy) {
      paper.push_back(block);
    }
  }
  SIXPOINT_ASSIGN(SolveReport report, solve_input({paper, file_constants, options}));
  if (!report.usable() && !report.verification.contradicted && paper.size() < blocks.size()) {
    SIXPOINT_ASSIGN(report, solve_input({blocks, file_constants, options}));
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

Result<ConstantsRecord> record_of(const SolveReport& report, UtcTime made_at,
                                  ConstantsOrigin made_from) {
  if (!report.calibration || !report.stored) {
    return fail(ErrorCode::bad_data, "the data did not determine constants", report.serial,
                "see missing_directions and reasons of 'sixpoint solve'");
  }
  if (report.serial.empty()) {
    return fail(ErrorCode::bad_data, "the recording names no serial number", {},
                "constants belong to a unit and cannot be stored without it");
  }
  if (!report.filter) {
    return fail(
        ErrorCode::bad_data,
        "it cannot be told under which filter configuration the recording was made", report.serial,
        "constants belong to a configuration and cannot be stored without; 'sixpoint solve' "
        "of the recording, without --save, prints them");
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
  record.cross_axis = report.cross_axis;
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

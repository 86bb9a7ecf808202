#include "calib/verify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace sixpoint::calib {

namespace {

using Limits = VerificationLimits;

using Json = nlohmann::ordered_json;

// Earlier and later half of every direction, each solved by itself.
std::optional<double> halves_apart_mg(std::span<const StillBlock> blocks, const BlockFit& fit,
                                      const BlockFitOptions& options) {
  std::vector<int> cell_of_block;
  const auto cells = cells_of(blocks, {}, &cell_of_block);
  std::vector<std::size_t> total(cells.size(), 0);
  for (const int cell : cell_of_block) {
    ++total[static_cast<std::size_t>(cell)];
  }
  std::vector<std::size_t> seen(cells.size(), 0);
  std::array<std::vector<StillBlock>, 2> halves;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const auto k = static_cast<std::size_t>(cell_of_block[i]);
    if (total[k] < 2) {
      // A single block belongs to both halves, so that both have their six directions.
      halves[0].push_back(blocks[i]);
      halves[1].push_back(blocks[i]);
      continue;
    }
    halves[seen[k]++ * 2 < total[k] ? 0 : 1].push_back(blocks[i]);
  }
  BlockFitOptions plain = options;
  plain.try_richer_models = false;
  const auto first = fit_blocks(halves[0], fit.fit.calibration, plain);
  const auto second = fit_blocks(halves[1], fit.fit.calibration, plain);
  if (!first || !second || !first->fit.converged || !second->fit.converged) {
    return std::nullopt;
  }
  return difference_over_sphere(first->fit.calibration, second->fit.calibration).rms_mg;
}

// The least number of blocks that any of the six sides has.
int fewest_blocks_per_side(std::span<const StillBlock> blocks) {
  std::array<int, 6> count{};
  for (const StillBlock& block : blocks) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      count[2 * a] += block.mean_g[a] > kCoverageLimit_g ? 1 : 0;
      count[2 * a + 1] += block.mean_g[a] < -kCoverageLimit_g ? 1 : 0;
    }
  }
  return *std::min_element(count.begin(), count.end());
}

// The sides that were reached neither by the file's constants nor by the new ones. The first may be
// wrong, and the second are checked by everything else here.
std::vector<std::string> missing_in_both(const Coverage& by_file, const Coverage& by_chosen) {
  std::vector<std::string> missing = by_file.missing_directions();
  const std::vector<std::string> still_missing = by_chosen.missing_directions();
  std::erase_if(missing, [&](const std::string& side) {
    return std::find(still_missing.begin(), still_missing.end(), side) == still_missing.end();
  });
  return missing;
}

void check_range(const Calibration& file_constants, const Calibration& chosen,
                 std::vector<std::string>& reasons) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double gain = chosen.sensitivity_g_per_lsb[a] / file_constants.sensitivity_g_per_lsb[a];
    const double shift_g =
        file_constants.sensitivity_g_per_lsb[a] * (chosen.zero_lsb[a] - file_constants.zero_lsb[a]);
    if (!(gain >= kLeastGain && gain <= kMostGain)) {
      reasons.push_back(fmt::format(
          "{}: a sensitivity of {:.3f} times the stored one is not that of a working sensor",
          kAxisNames[a], gain));
    }
    if (!(std::abs(shift_g) <= kMostZeroChange_g)) {
      reasons.push_back(
          fmt::format("{}: a zero {:.2f} g from the stored one is not that of a "
                      "working sensor",
                      kAxisNames[a], shift_g));
    }
  }
}

// The numbers that the verdict rests on.
Verification measure(std::span<const StillBlock> used, const Calibration& chosen,
                     const BlockFit& fit, const BlockFitOptions& options) {
  Verification out;
  out.missing_directions = missing_in_both(coverage_of(used), coverage_of(used, chosen));
  // The best model shows whether the blocks are gravity; applied_rms_mg shows what the six
  // constants leave of it.
  out.held_out_rms_mg =
      fit.richer ? std::optional(fit.richer->held_out_rms_mg) : fit.held_out_rms_mg;
  out.held_out_directions = fit.richer ? fit.richer->held_out_directions : fit.held_out_directions;
  out.directions = fit.directions;
  out.redundancy = fit.redundancy;
  out.applied_rms_mg = cells_rms_mg(fit.cells, chosen, options.gravity_g);
  out.repeatability_mg = fit.block_sd_mg;
  // Where the constants are not least squares' own, how far they are from these is error as well.
  out.undrifted_mg = std::hypot(fit.best().worst_direction_mg(),
                                difference_over_sphere(fit.best().calibration, chosen).worst_mg);
  out.worst_direction_mg = out.undrifted_mg;
  if (fit.drift) {
    out.drift_mg = fit.drift->shown_mg();
    out.hidden_drift_mg = fit.drift->hidden_mg();
    out.worst_direction_mg =
        std::hypot(out.undrifted_mg, std::max(*out.drift_mg, fit.drift->allowance_mg()));
  }
  return out;
}

// The worst direction, and what a drift has to do with it. The data alone are judged first, since
// recording longer does not help against a drift.
void check_uncertainty(const BlockFit& fit, Verification& out) {
  const bool drifts = out.drift_mg && !(*out.drift_mg <= Limits::drift_mg);
  if (drifts) {
    out.contradicted = true;
    out.reasons.push_back(fmt::format(
        "the zeros drift while the unit lies still, by up to {:.1f} mg to either end of the file "
        "(limit {:.1f} mg), as when it warms up; let it take the room's temperature for half an "
        "hour, then lay it on its sides again",
        *out.drift_mg, Limits::drift_mg));
  }
  const bool wide = !(out.worst_direction_mg <= Limits::worst_direction_mg);
  // Not where something else is wrong.
  const bool hides = fit.drift && !drifts && out.undrifted_mg <= Limits::worst_direction_mg &&
                     out.repeatability_mg <= Limits::repeatability_mg &&
                     (!(*out.hidden_drift_mg <= Limits::hidden_drift_mg) ||
                      (wide && fit.drift->allowance_mg() > out.undrifted_mg));
  if (hides) {
    out.reasons.push_back(fmt::format(
        "the unit lay still for {:.1f} min in all, spread over {:.1f} min by the recording's "
        "clock, which does not rule out that its zeros drifted meanwhile: {:.1f} mg in the worst "
        "direction could not be told from "
        "constants (limit {:.1f} mg); lay it on its six sides one right after another for two "
        "minutes each, or lay it on the first side again at the end and go round all six a second "
        "time",
        fit.drift->at_rest_s / 60, fit.drift->within_s / 60,
        std::max(*out.hidden_drift_mg, fit.drift->allowance_mg()), Limits::hidden_drift_mg));
  }
  if (!(out.undrifted_mg <= Limits::worst_direction_mg) || (wide && !drifts && !hides)) {
    // Tilted sides hide cross-axis terms.
    out.reasons.push_back(fmt::format(
        "the data determine the constants only to {:.1f} mg in the worst direction (limit {:.1f} "
        "mg); {}",
        out.worst_direction_mg, Limits::worst_direction_mg,
        out.redundancy < Limits::held_out_directions
            ? "lay the unit flat on each side, or on its edges and corners as well"
            : "record longer, and on more sides"));
  }
}

// What the blocks themselves say against the constants.
void check_scatter(const BlockFit& fit, std::size_t blocks, Verification& out) {
  if (!(out.repeatability_mg <= Limits::repeatability_mg)) {
    out.reasons.push_back(fmt::format(
        "the magnitude scatters by {:.1f} mg within one direction (limit {:.1f} mg): vibration, a "
        "change of temperature, or more than one unit's data",
        out.repeatability_mg, Limits::repeatability_mg));
  }
  if (!(out.applied_rms_mg <= Limits::applied_mg)) {
    out.reasons.push_back(
        fmt::format("with these constants still blocks are {:.1f} mg from 1 g (limit {:.1f} mg)",
                    out.applied_rms_mg, Limits::applied_mg));
  }
  const double left_out = static_cast<double>(fit.blocks_left_out) /
                          static_cast<double>(std::max<std::size_t>(1, blocks));
  if (left_out > Limits::left_out_share) {
    out.reasons.push_back(
        fmt::format("{:.0f} % of the still blocks contradict the rest (limit {:.0f} %)",
                    100 * left_out, 100 * Limits::left_out_share));
  }
}

void check_agreement(const BlockFit& fit, const GeneticResult& search, Verification& out) {
  out.agreement_mg = difference_over_sphere(fit.best().calibration, search.calibration).rms_mg;
  // Two error measures on data that the model does not describe differ by about the misfit.
  const double misfit_mg = fit.richer ? 0.8 * fit.richer->structural_mg : 0;
  const double uncertainty_mg = 2 * std::hypot(fit.best().worst_direction_mg(), search.scatter_mg);
  out.agreement_limit_mg = std::min(Limits::most_disagreement_mg,
                                    std::max({Limits::agreement_mg, uncertainty_mg, misfit_mg}));
  if (!(*out.agreement_mg <= out.agreement_limit_mg)) {
    out.reasons.push_back(
        fmt::format("least squares and the genetic algorithm differ by {:.1f} mg (limit {:.1f} mg)",
                    *out.agreement_mg, out.agreement_limit_mg));
  }
}

// The verdict on six directions: several blocks per side, and halves that agree.
void check_repeatability(std::span<const StillBlock> used, const BlockFit& fit,
                         const BlockFitOptions& options, Verification& out) {
  const int fewest = fewest_blocks_per_side(used);
  if (fewest < Limits::blocks_per_side) {
    out.reasons.push_back(fmt::format(
        "{} directions for six constants leave nothing to test them with, and a side with {} still "
        "block(s) cannot show that it repeats (needed: {}); lay the unit on each side for a minute",
        out.directions, fewest, Limits::blocks_per_side));
  } else {
    out.halves_mg = halves_apart_mg(used, fit, options);
    // By the samples' noise and not by the blocks' scatter, which a side that does not repeat
    // increases itself.
    const double limit = std::max(Limits::halves_mg, 4 * fit.noise_sd_mg);
    if (!out.halves_mg || !(*out.halves_mg <= limit)) {
      out.contradicted = true;
      out.reasons.push_back(fmt::format(
          "the earlier and the later half of the data give constants {:.1f} mg apart (limit {:.1f} "
          "mg)",
          out.halves_mg.value_or(HUGE_VAL), limit));
    }
  }
  out.verified = out.reasons.empty();
  out.verdict = out.verified ? Verdict::verified_by_repeatability : Verdict::not_verified;
  if (out.verified) {
    out.reasons.push_back(fmt::format(
        "{} directions for six constants: the residual cannot test them; they rest on "
        "repeatability within each side (halves {:.2f} mg apart) and on the range of a real sensor",
        out.directions, *out.halves_mg));
  }
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  constexpr std::array<std::string_view, 5> kNames = {
      "verified", "verified_by_repeatability", "incomplete", "not_verified", "rests_on_prior"};
  return kNames[static_cast<std::size_t>(verdict)];
}

Verification verify(std::span<const StillBlock> used, const Calibration& file_constants,
                    const Calibration& chosen, const BlockFit& fit,
                    const std::optional<GeneticResult>& search, const BlockFitOptions& options,
                    const std::optional<Calibration>& applied) {
  Verification out = measure(used, chosen, fit, options);
  if (applied) {
    out.applied_rms_mg = cells_rms_mg(fit.cells, *applied, options.gravity_g);
  }
  if (!out.missing_directions.empty()) {
    out.verdict = Verdict::incomplete;
    out.reasons.push_back(fmt::format("no still block reaches beyond 0.3 g towards {}",
                                      fmt::join(out.missing_directions, ", ")));
    return out;
  }
  if (!fit.fit.converged) {
    out.reasons.emplace_back("least squares did not converge");
  }
  check_uncertainty(fit, out);
  const std::size_t not_against = out.reasons.size();
  check_range(file_constants, chosen, out.reasons);
  check_scatter(fit, used.size(), out);
  if (search) {
    check_agreement(fit, *search, out);
  }
  out.contradicted = out.contradicted || out.reasons.size() > not_against;
  const bool tested = out.held_out_rms_mg.has_value() &&
                      out.held_out_directions >= Limits::held_out_directions &&
                      out.redundancy >= Limits::held_out_directions;
  if (!tested) {
    check_repeatability(used, fit, options, out);
    return out;
  }
  if (!(*out.held_out_rms_mg <= Limits::held_out_mg)) {
    out.contradicted = true;
    out.reasons.push_back(
        fmt::format("directions that the fit had not seen are predicted to {:.1f} mg only (limit "
                    "{:.1f} mg)",
                    *out.held_out_rms_mg, Limits::held_out_mg));
  }
  out.verified = out.reasons.empty();
  out.verdict = out.verified ? Verdict::verified : Verdict::not_verified;
  return out;
}

std::string Verification::brief() const {
  std::string line = std::string(to_string(verdict));
  if (held_out_rms_mg) {
    line +=
        fmt::format(", {} unseen directions to {:.1f} mg", held_out_directions, *held_out_rms_mg);
  }
  if (directions > 0 && verdict != Verdict::incomplete) {
    line += fmt::format(", still blocks within {:.1f} mg", applied_rms_mg);
  }
  if (!reasons.empty()) {
    line += fmt::format(": {}", fmt::join(reasons, "; "));
  }
  return line;
}

Json to_json(const Verification& v) {
  return {{"verified", v.verified},
          {"verdict", to_string(v.verdict)},
          {"directions", v.directions},
          {"redundancy", v.redundancy},
          {"held_out_rms_mg", number_or_null(v.held_out_rms_mg)},
          {"held_out_directions", v.held_out_directions},
          {"applied_rms_mg", number_or_null(v.applied_rms_mg)},
          {"repeatability_mg", number_or_null(v.repeatability_mg)},
          {"halves_mg", number_or_null(v.halves_mg)},
          {"worst_direction_mg", number_or_null(v.worst_direction_mg)},
          {"drift_mg", number_or_null(v.drift_mg)},
          {"hidden_drift_mg", number_or_null(v.hidden_drift_mg)},
          {"agreement_mg", number_or_null(v.agreement_mg)},
          {"agreement_limit_mg", number_or_null(v.agreement_limit_mg)}};
}

}  // namespace sixpoint::calib

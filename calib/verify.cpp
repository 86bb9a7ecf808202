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
      // A lone block helps both halves to their six directions and tells them nothing apart.
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

// The sides that neither the file's constants nor the new ones see reached: the first may be the
// wrong ones, and the second have to stand up to all else that is asked here.
std::vector<std::string> missing_in_both(const Coverage& by_file, const Coverage& by_chosen) {
  std::vector<std::string> missing = by_file.missing_directions();
  const std::vector<std::string> still_missing = by_chosen.missing_directions();
  std::erase_if(missing, [&](const std::string& side) {
    return std::find(still_missing.begin(), still_missing.end(), side) == still_missing.end();
  });
  return missing;
}

void check_range(const Calibration& file_constants, const Calibration& chosen,
                 const VerificationLimits& limits, std::vector<std::string>& reasons) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double gain = chosen.sensitivity_g_per_lsb[a] / file_constants.sensitivity_g_per_lsb[a];
    const double shift_g =
        file_constants.sensitivity_g_per_lsb[a] * (chosen.zero_lsb[a] - file_constants.zero_lsb[a]);
    if (!(gain >= limits.gain_low && gain <= limits.gain_high)) {
      reasons.push_back(fmt::format(
          "{}: a sensitivity of {:.3f} times the stored one is not that of a working sensor",
          kAxisNames[a], gain));
    }
    if (!(std::abs(shift_g) <= limits.zero_change_g)) {
      reasons.push_back(
          fmt::format("{}: a zero {:.2f} g from the stored one is not that of a "
                      "working sensor",
                      kAxisNames[a], shift_g));
    }
  }
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::verified:
      return "verified";
    case Verdict::verified_by_repeatability:
      return "verified_by_repeatability";
    case Verdict::incomplete:
      return "incomplete";
    case Verdict::not_verified:
      return "not_verified";
    case Verdict::rests_on_prior:
      return "rests_on_prior";
  }
  return "not_verified";
}

Verification verify(std::span<const StillBlock> used, const Calibration& file_constants,
                    const Calibration& chosen, const BlockFit& fit,
                    const std::optional<GeneticResult>& search, const BlockFitOptions& options,
                    const VerificationLimits& limits) {
  Verification out;
  std::vector<std::string>& reasons = out.reasons;
  out.missing_directions = missing_in_both(coverage_of(used), coverage_of(used, chosen));
  // Whether the blocks are gravity is asked of the best model; what the six constants leave of it
  // is asked by applied_rms_mg.
  out.held_out_rms_mg =
      fit.richer ? std::optional(fit.richer->held_out_rms_mg) : fit.held_out_rms_mg;
  out.held_out_directions = fit.richer ? fit.richer->held_out_directions : fit.held_out_directions;
  out.directions = fit.directions;
  out.redundancy = fit.redundancy;
  out.applied_rms_mg = cells_rms_mg(fit.cells, chosen, options.gravity_g);
  out.repeatability_mg = fit.block_sd_mg;
  // Where the constants are not least squares' own, how far they are from these is error as well.
  out.worst_direction_mg =
      std::hypot(fit.best().worst_direction_mg(),
                 difference_over_sphere(fit.best().calibration, chosen).worst_mg);
  // Asked of the data alone first: "record longer" is no help against a drift.
  const double undrifted_mg = out.worst_direction_mg;
  if (fit.drift) {
    out.drift_mg = fit.drift->shown_mg();
    out.hidden_drift_mg = fit.drift->hidden_mg();
    out.worst_direction_mg =
        std::hypot(undrifted_mg, std::max(*out.drift_mg, fit.drift->allowance_mg()));
  }
  if (!out.missing_directions.empty()) {
    out.verdict = Verdict::incomplete;
    reasons.push_back(fmt::format("no still block reaches beyond 0.3 g towards {}",
                                  fmt::join(out.missing_directions, ", ")));
    return out;
  }

  if (!fit.fit.converged) {
    reasons.emplace_back("least squares did not converge");
  }
  check_range(file_constants, chosen, limits, reasons);
  const bool drifts = out.drift_mg && !(*out.drift_mg <= limits.drift_mg);
  if (drifts) {
    reasons.push_back(fmt::format(
        "the zeros drift while the unit lies still, by up to {:.1f} mg to either end of the file "
        "(limit {:.1f} mg), as when it warms up; let it take the room's temperature for half an "
        "hour, then lay it on its sides again",
        *out.drift_mg, limits.drift_mg));
  }
  const bool wide = !(out.worst_direction_mg <= limits.worst_direction_mg);
  // Not where other things are what is wrong.
  const bool hides = fit.drift && !drifts && undrifted_mg <= limits.worst_direction_mg &&
                     out.repeatability_mg <= limits.repeatability_mg &&
                     (!(*out.hidden_drift_mg <= limits.hidden_drift_mg) ||
                      (wide && fit.drift->allowance_mg() > undrifted_mg));
  if (hides) {
    reasons.push_back(fmt::format(
        "the unit lay still for {:.1f} of the file's {:.0f} min, which does not rule out that its "
        "zeros drifted meanwhile: {:.1f} mg in the worst direction could not be told from "
        "constants "
        "(limit {:.1f} mg); lay it on its six sides one right after another for two minutes each, "
        "or "
        "lay it on the first side again at the end and go round all six a second time",
        fit.drift->at_rest_s / 60, fit.drift->span_s / 60,
        std::max(*out.hidden_drift_mg, fit.drift->allowance_mg()), limits.hidden_drift_mg));
  }
  if (!(undrifted_mg <= limits.worst_direction_mg) || (wide && !drifts && !hides)) {
    // Cross-axis is what tilted sides hide.
    reasons.push_back(fmt::format(
        "the data determine the constants only to {:.1f} mg in the worst direction (limit {:.1f} "
        "mg); {}",
        out.worst_direction_mg, limits.worst_direction_mg,
        out.redundancy < limits.held_out_directions
            ? "lay the unit flat on each side, or on its edges and corners as well"
            : "record longer, and on more sides"));
  }
  if (!(out.repeatability_mg <= limits.repeatability_mg)) {
    reasons.push_back(fmt::format(
        "the magnitude scatters by {:.1f} mg within one direction (limit {:.1f} mg): vibration, a "
        "change of temperature, or more than one unit's data",
        out.repeatability_mg, limits.repeatability_mg));
  }
  if (!(out.applied_rms_mg <= limits.applied_mg)) {
    reasons.push_back(
        fmt::format("with these constants still blocks are {:.1f} mg from 1 g (limit "
                    "{:.1f} mg)",
                    out.applied_rms_mg, limits.applied_mg));
  }
  const double left_out = static_cast<double>(fit.blocks_left_out) /
                          static_cast<double>(std::max<std::size_t>(1, used.size()));
  if (left_out > limits.left_out_share) {
    reasons.push_back(
        fmt::format("{:.0f} % of the still blocks contradict the rest (limit {:.0f} "
                    "%)",
                    100 * left_out, 100 * limits.left_out_share));
  }
  if (search) {
    out.agreement_mg = difference_over_sphere(fit.best().calibration, search->calibration).rms_mg;
    // Two error measures on data that the model does not describe differ by about the misfit.
    const double misfit_mg = fit.richer ? 0.8 * fit.richer->structural_mg : 0;
    const double uncertainty_mg =
        2 * std::hypot(fit.best().worst_direction_mg(), search->wander_mg);
    out.agreement_limit_mg = std::min(limits.most_disagreement_mg,
                                      std::max({limits.agreement_mg, uncertainty_mg, misfit_mg}));
    if (!(*out.agreement_mg <= out.agreement_limit_mg)) {
      reasons.push_back(fmt::format(
          "least squares and the genetic algorithm differ by {:.1f} mg (limit {:.1f} mg)",
          *out.agreement_mg, out.agreement_limit_mg));
    }
  }

  const bool tested = out.held_out_rms_mg.has_value() &&
                      out.held_out_directions >= limits.held_out_directions &&
                      out.redundancy >= limits.held_out_directions;
  if (tested) {
    if (!(*out.held_out_rms_mg <= limits.held_out_mg)) {
      reasons.push_back(
          fmt::format("directions that the fit had not seen are predicted to {:.1f} mg only (limit "
                      "{:.1f} mg)",
                      *out.held_out_rms_mg, limits.held_out_mg));
    }
    out.verified = reasons.empty();
    out.verdict = out.verified ? Verdict::verified : Verdict::not_verified;
    return out;
  }

  const int fewest = fewest_blocks_per_side(used);
  if (fewest < limits.blocks_per_side) {
    reasons.push_back(fmt::format(
        "{} directions for six constants leave nothing to test them with, and a side with {} still "
        "block(s) cannot show that it repeats (needed: {}); lay the unit on each side for a minute",
        out.directions, fewest, limits.blocks_per_side));
  } else {
    out.halves_mg = halves_apart_mg(used, fit, options);
    // By the samples' noise and not by the blocks' scatter, which a side that does not repeat
    // widens itself.
    const double limit = std::max(limits.halves_mg, 4 * fit.noise_sd_mg);
    if (!out.halves_mg || !(*out.halves_mg <= limit)) {
      reasons.push_back(fmt::format(
          "the earlier and the later half of the data give constants {:.1f} mg apart (limit {:.1f} "
          "mg)",
          out.halves_mg.value_or(HUGE_VAL), limit));
    }
  }
  out.verified = reasons.empty();
  out.verdict = out.verified ? Verdict::verified_by_repeatability : Verdict::not_verified;
  if (out.verified) {
    reasons.push_back(
        fmt::format("{} directions for six constants: the residual cannot test them; they rest on "
                    "repeatability "
                    "within each side (halves {:.2f} mg apart) and on the range of a real sensor",
                    out.directions, *out.halves_mg));
  }
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

Json to_json(const Verification& verification) {
  const auto maybe = [](const std::optional<double>& value) {
    return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
  };
  Json json;
  json["verified"] = verification.verified;
  json["verdict"] = to_string(verification.verdict);
  json["directions"] = verification.directions;
  json["redundancy"] = verification.redundancy;
  json["held_out_rms_mg"] = maybe(verification.held_out_rms_mg);
  json["held_out_directions"] = verification.held_out_directions;
  json["applied_rms_mg"] = maybe(verification.applied_rms_mg);
  json["repeatability_mg"] = maybe(verification.repeatability_mg);
  json["halves_mg"] = maybe(verification.halves_mg);
  json["worst_direction_mg"] = maybe(verification.worst_direction_mg);
  json["drift_mg"] = maybe(verification.drift_mg);
  json["hidden_drift_mg"] = maybe(verification.hidden_drift_mg);
  json["agreement_mg"] = maybe(verification.agreement_mg);
  json["agreement_limit_mg"] = maybe(verification.agreement_limit_mg);
  return json;
}

}  // namespace sixpoint::calib

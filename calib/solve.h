// From still blocks to constants with a verdict: the paper's methods 1 and 2.
//
//   SIXPOINT_ASSIGN(const SolveReport report, solve_from_still_blocks(blocks, file_constants));
//   if (report.usable()) {
//     const Calibration& constants = *report.calibration;
//   } else {
//     report.verification.missing_directions;  // what the recording lacks
//   }
//
// A report is never invented: where the data do not suffice there are no constants in it, but what
// is missing (missing_directions) and what is determined nevertheless (partial).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "calib/best_six.h"
#include "calib/block_fit.h"
#include "calib/constants.h"
#include "calib/coverage.h"
#include "calib/genetic.h"
#include "calib/still_blocks.h"
#include "calib/temperature_drift.h"
#include "calib/trust.h"
#include "calib/verify.h"

namespace sixpoint::calib {

enum class SolveMethod { least_squares, genetic };
std::string_view to_string(SolveMethod method);                 // "ls", "ga"
Result<SolveMethod> parse_solve_method(std::string_view text);  // usage if unknown

struct SolveOptions {
  SolveMethod method = SolveMethod::least_squares;
  std::uint64_t seed = 20160316;
  // Gravity where the recording was made, in standard g, and how well it is known. A file from an
  // unknown place: anywhere between equator and pole (9.780 .. 9.832 m/s2), as a uniform
  // distribution about standard gravity.
  double gravity_g = 1.0;
  double gravity_sd_g = 0.0015;
  // A documented prior over a model's constants (population_prior): partial data then give a
  // posterior with a wide uncertainty, which is never verified.
  std::optional<CalibrationPrior> prior;
  // What the file makes of raw counts where six constants cannot say it (the matrix of an .agdc):
  // residual_before_mg is that of it, and `file_constants` its nearest six.
  std::function<PerAxis<double>(const PerAxis<double>& mean_lsb)> file_g = {};
};

// Per axis: what the data determine when they do not determine everything.
struct PartialKnowledge {
  PerAxis<double> zero_mg{};  // standard uncertainties, given nothing but a real sensor's range
  PerAxis<double> sensitivity_relative{};
  // Below 5 mg and 0.5 %.
  PerAxis<bool> zero_determined{};
  PerAxis<bool> sensitivity_determined{};
};

struct SolveReport {
  // Filled by the caller, who knows the recording.
  std::string serial;
  std::optional<FilterConfiguration> filter;
  double seconds = 0;

  SolveMethod method = SolveMethod::least_squares;
  // Present when the data determine them, verified or not; absent when directions are missing.
  std::optional<Calibration> calibration;
  std::optional<StoredConstants> stored;  // the nine integers, verified after rounding
  ConstantsUncertainty uncertainty;       // with gravity's
  ConstantsUncertainty statistical;       // of the data alone
  std::size_t points = 0;                 // still blocks used
  std::size_t points_found = 0;
  std::size_t noisy_points = 0;  // of the used ones: beyond criterion 2 by sensor noise alone
  Coverage coverage;             // as the file's constants have it (the paper's rule)
  // RMS distance of still blocks from 1 g over directions, every direction equal; before: as the file
  // has them.
  double residual_before_mg = 0;
  std::optional<double> residual_after_mg;
  std::optional<double> residual_rounded_mg;  // with the nine integers
  Verification verification;
  std::vector<std::string> notes;  // what matters for people besides the verdict
  std::optional<BlockFit> fit;
  // How `calibration` was chosen, by least squares; and the map with cross-axis terms, made from
  // the same blocks, where the data show such terms.
  std::optional<BestSix> six;
  std::optional<CrossAxisMap> cross_axis;
  std::optional<Trust> trust;  // of least squares and the genetic algorithm, where both ran
  std::optional<GeneticResult> search;
  std::optional<PartialKnowledge> partial;
  // Filled by the caller where the recording holds temperatures and the unit was left lying while
  // they changed. Reported, not applied: six constants have no place for it.
  std::optional<TemperatureDrift> temperature;
  double gravity_g = 1.0;
  int iterations = 0;
  bool from_prior = false;

  bool usable() const { return verification.verified; }
  std::string brief() const;
};
// The document of `sixpoint solve` without its "schema".
nlohmann::ordered_json to_json(const SolveReport& report);

// `file_constants` are those that the blocks' mean_g were made with. Fails on data that are not
// finite and impossible constants; everything else is a report. Which blocks it uses:
//
// | those that meet the paper's criteria           | noisy ones | used                            |
// |------------------------------------------------|------------|---------------------------------|
// | give verified constants                        | any        | the paper's                     |
// | do not suffice: a side is missing, or has too  | none       | the paper's; what is missing is |
// | few blocks                                     |            | said                            |
// | do not suffice                                 | some       | all; noisy_points and a note    |
// |                                                |            | say how many of them are noisy  |
// | contradict the constants, or drift             | any        | the paper's: more are no remedy |
Result<SolveReport> solve_from_still_blocks(std::span<const StillBlock> blocks,
                                            const Calibration& file_constants,
                                            const SolveOptions& options = {});

// The record to store; only of a report that has constants, a serial and a filter.
Result<ConstantsRecord> record_of(const SolveReport& report, UtcTime made_at,
                                  ConstantsOrigin made_from);

// What units of one model are like under `current`: mean and spread of the raw constants of a
// wGT3X-BT of 2018 and two GT9X of the public recordings (same sensor), read from their PARAMETERS,
// widened to 15 LSB (60 mg) of zero and 5 % of sensitivity because three units are few. Under
// `legacy` two units of 2013, likewise. Fails for a model that nothing is known about.
Result<CalibrationPrior> population_prior(std::string_view serial, FilterConfiguration filter);

}  // namespace sixpoint::calib

// The verdict on constants: may they be used, and on what evidence.
//
//   const Verification answer = verify(blocks, file_constants, chosen, fit, {}, options);
//   answer.usable();  // may the chosen constants be used?
//   answer.brief();   // why, or why not
//
// Constants that were fitted to still blocks make those blocks read 1 g; that alone proves nothing.
// Six directions determine six constants exactly, so a six-sided calibration file has next to no
// residual, right or wrong. What can be tested depends on the data:
//
// | the data                              | tested by                | verdict                   |
// |---------------------------------------|--------------------------|---------------------------|
// | a side is missing                     | -                        | incomplete                |
// | three directions or more beyond six   | each direction, by a fit | verified                  |
// |                                       | without it (held out)    |                           |
// | six sides of three blocks or more     | the halves of the file   | verified_by_repeatability |
// |                                       | agree; noise; the range  |                           |
// |                                       | of a real sensor         |                           |
// | anything else, or a limit is exceeded | -                        | not_verified              |
//
// Each still side is a valid equation whatever its exact angle, so six sides are enough to use the
// constants. The weaker verdict says what they rest on. Magnitudes are in mg. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "calib/block_fit.h"
#include "calib/coverage.h"
#include "calib/genetic.h"

namespace sixpoint::calib {

enum class Verdict {
  verified,                   // held-out directions agree
  verified_by_repeatability,  // six directions only: repeatable and plausible, not contradicted
  incomplete,                 // directions are missing (missing_directions)
  not_verified,               // the data contradict the constants, or cannot support them
  rests_on_prior,             // computed with a population prior; never verified
};
std::string_view to_string(Verdict verdict);

// Where "good enough" comes from.
struct VerificationLimits {
  // Held-out directions, RMS. A real unit's six-parameter fit leaves 3.9 mg (GGIR's free-living
  // sample, a GT9X) and a real wGT3X-BT with 2.8 % of cross-axis 4 mg after the cross-axis terms;
  // twice that is a defect of the data. An affected file is off by 100 mg and more.
  static constexpr double held_out_mg = 8.0;
  // What a still unit reads with the six constants alone, which is all that a file's repair and a
  // unit's memory can apply: RMS over directions. The same wGT3X-BT leaves 8.5 mg.
  static constexpr double applied_mg = 16.0;
  // Standard uncertainty of the magnitude in the worst direction. The demo's promise is 5 mg.
  static constexpr double worst_direction_mg = 5.0;
  // Scatter of blocks in one direction. Noise of 5 mg per sample makes 0.5 mg; 20 C at the
  // ADXL362's 0.5 mg/C make up to 5.
  static constexpr double repeatability_mg = 6.0;
  // Six directions only: earlier and later half, RMS over the sphere.
  static constexpr double halves_mg = 2.0;
  // What the zeros are shown to drift in half of the file's time, with the upper 95 % bound. The
  // uncertainty of six good sides is up to 3 mg, and with 4 mg more the worst direction's 5 mg are
  // used up.
  static constexpr double drift_mg = 4.0;
  // What a drift could have done to the worst direction without being shown, one standard
  // deviation. A minute on each side and a minute and a half between them leave 1.7, nine
  // minutes 5.6. At 2.5, 20 C of warming are 3 of them and more.
  static constexpr double hidden_drift_mg = 2.5;
  static constexpr int blocks_per_side = 3;  // so that a half of a side still holds a block
  // Least squares and genetic algorithm, RMS over the sphere: this, twice their combined
  // uncertainty or 0.8 of what a richer model still leaves; but never more than the second. They
  // weight a misfit differently (squares over directions, absolute values over value subsets).
  // Where a richer model is admitted, the genetic algorithm is given the blocks without its terms:
  // before, 1 % of cross-axis on 19 directions set them 12 mg apart.
  static constexpr double agreement_mg = 2.0;
  static constexpr double most_disagreement_mg = 8.0;
  static constexpr double left_out_share = 0.2;  // of the blocks
  static constexpr int held_out_directions = 3;  // fewer tested directions are no test
};

struct Verification {
  bool verified = false;
  Verdict verdict = Verdict::not_verified;
  std::vector<std::string> reasons;  // why not; and for the weaker verdicts what they rest on
  // The data speak against the constants, or the zeros drift: more blocks are no remedy. False
  // where the data only do not suffice.
  bool contradicted = false;
  std::vector<std::string> missing_directions;
  std::optional<double> held_out_rms_mg;
  int held_out_directions = 0;
  int directions = 0;
  int redundancy = 0;
  double applied_rms_mg = 0;
  double repeatability_mg = 0;
  std::optional<double> halves_mg;
  double worst_direction_mg = 0;
  double undrifted_mg = 0;         // the same without what a drift may have done
  std::optional<double> drift_mg;  // 0: none is shown; absent: not asked (ZeroDrift)
  std::optional<double> hidden_drift_mg;
  std::optional<double> agreement_mg;
  double agreement_limit_mg = 0;

  std::string brief() const;
  bool usable() const { return verified; }
};
nlohmann::ordered_json to_json(const Verification& verification);

// `used` are the blocks that the fit was given, `chosen` the constants under judgement, `search`
// the genetic algorithm's answer where it was run. `applied`: the six constants that are applied
// where these are not `chosen` (best_six.h); only what they leave is judged.
Verification verify(std::span<const StillBlock> used, const Calibration& file_constants,
                    const Calibration& chosen, const BlockFit& fit,
                    const std::optional<GeneticResult>& search, const BlockFitOptions& options,
                    const std::optional<Calibration>& applied = std::nullopt);

}  // namespace sixpoint::calib

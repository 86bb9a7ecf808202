// The steps of the diagnosis, in the order in which diagnose() runs them. Each takes what it needs
// and returns what it found; none keeps anything.
//
//   const CleanSamples clean = clean_samples(bundle);
//   Findings found = judge_marks(request, clean);
//   const PoseCheck poses = judge_poses(bundle, clean);
//
// Internal to gap/judge.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "gap/explain/blocks.h"
#include "gap/explain/explanation.h"
#include "gap/features/lines.h"
#include "gap/features/noise.h"
#include "gap/features/response.h"
#include "gap/features/settling.h"
#include "gap/features/slow_noise.h"
#include "gap/features/timing.h"
#include "gap/features/tones.h"
#include "gap/judge/findings.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

// abilities.cpp
struct ProtocolKind {
  unsigned abilities = 0;  // of enum Ability
  std::string name;        // production, engineering, other
};
ProtocolKind protocol_kind(const Bundle& bundle);

// judge_samples.cpp: marks that noise cannot make (turned axes, zeros, held values, wraps,
// plateaus).
Findings judge_marks(const Request& request, const CleanSamples& clean);

// judge_poses.cpp
struct PoseCheck {
  bool moving = false;  // the unit moves inside the dwells: nothing that follows means anything
  bool wrong = false;   // some dwells do not lie as the protocol says
  Findings found;
};
PoseCheck judge_poses(const Bundle& bundle, const CleanSamples& clean);

// judge_records.cpp
struct Lines {
  std::vector<SpectralLine> list;
  double power_mg2 = 0;  // mean square of all, summed over the axes
  Findings found;
};
std::vector<double> frequencies_of(const Lines& lines);
Lines judge_lines(const Request& request, const CleanSamples& clean, const NoiseSpectrum& noise,
                  const CodeStatistics& codes);

// judge_timing.cpp
struct Timing {
  HostTiming host;
  std::vector<ToneFit> tones;  // one per vibration segment; amplitudes free of jitter
  double jitter_s = 0;         // accepted; 0: none
  Findings found;
};
// `lines` go through the tones, too.
Timing judge_timing(const Request& request, const CleanSamples& clean, const NoiseSpectrum& noise,
                    const Lines& lines = {});

// judge_records.cpp
struct ResponseStep {
  Response response;
  Findings found;
};
ResponseStep judge_response(const Request& request, const NoiseSpectrum& noise,
                            const std::vector<ToneFit>& tones, const Lines& lines);
struct Settling {
  StepResponse step;
  bool unexplained = false;  // something follows the moves that is not accepted as settling
  Findings found;
};
Settling judge_settling(const Request& request, const CleanSamples& clean,
                        const NoiseSpectrum& noise, const Lines& lines, const Response& response);

// All that the records show; nothing changes it afterwards.
struct Records {
  CleanSamples clean;
  NoiseSpectrum noise;
  CodeStatistics codes;
  HostTiming host;
  std::vector<ToneFit> tones;
  double jitter_s = 0;
  Lines lines;
  Response response;
  Settling settling;
  SlowNoise slow;
};

// judge_means.cpp: means and tones together, by exact evidence. `before`: what the steps before
// found. The explanation refers to `blocks`.
Explanation explain(const Request& request, const std::vector<Block>& blocks,
                    const SlowNoise& slow);
Findings judge_means(const Request& request, const Explanation& explanation, const SlowNoise& slow,
                     const Findings& before);

// judge_nuisances.cpp: gains and offsets against what units have.
struct Nuisances {
  UnitEstimate unit;
  Findings found;
};
// `judged`: false where gains and offsets are only estimated (few or wrong poses, raw counts).
Nuisances judge_nuisances(const Request& request, const ForwardState& state, bool judged);

// undo_later_effects.cpp: sizes as they were before an accepted effect that acts later changed them. How
// much they add to the recording stays.
//
// | accepted later effect  | effect                             | parameter      | answer               |
// |------------------------|------------------------------------|----------------|----------------------|
// | filter_mismatch        | settling                           | amplitude      | over the mode's gain |
// |                        | floor_vibration                    | vector_mg      | the same             |
// | clock_error            | floor_vibration, electrical_line   | frequency_hz   | times 1 + ppm / 1e6  |
// | any other, or none     | any                                | any            | as it was measured   |
//
// What the means show is explained beside gains already; a line of the supply is added behind the mode.
void undo_later_effects(Findings& found);

// judge_left_over.cpp, judge_samples.cpp: what the explanation leaves, against chance. Ringing that is
// named is known to this share of its own test.
inline constexpr double kKnownRinging = 0.03;
Findings judge_left_over(const Request& request, const Records& records,
                         const Explanation& explanation, const Findings& before);
Findings judge_codes(const Request& request, const Records& records, double slow_mg2,
                     const Findings& before);
Findings judge_texture(const Request& request, const Records& records, const Findings& before);
// Variance that accepted slow noise has within this time.
double slow_variance_mg2(const Fit& fit, const Findings& found, double seconds, double rate_hz);

// abilities.cpp
void list_not_observable(const Request& request, const ProtocolKind& kind, const Records& records,
                         const Explanation& explanation, const Findings& found, Diagnosis& out);

// measure_gap.cpp, where_and_plots.cpp
GapSize measure_gap(const Records& records, const Explanation& explanation, const Findings& found);
struct Residuals {
  std::vector<Location> where;  // worst first
  std::vector<Plots::Residual> plot;
};
Residuals locate_residuals(const Request& request, const Records& records,
                           const Explanation& explanation, const Findings& found);
// Axes and segments in which the named effects leave something, worst first; then those that the
// alarms are about.
std::vector<UnknownPlace> locate_unknown(const Request& request, const Records& records,
                                         const Explanation& explanation, const Findings& found);
Plots make_plots(const Request& request, const Records& records, const Fit& best,
                 const Findings& found);

// A clock that runs fast by e stretches a tone by 1 / (1 + e).
double clock_ppm_of(const ToneFit& tone);
double share_of(std::size_t part, std::size_t whole);

}  // namespace sixpoint::gap

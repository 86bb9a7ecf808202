// The diagnosis at work: one object per bundle, its steps in the files judge_*.cpp.
//
// Internal to gap/. Every step reads what the steps before it found and leaves findings (`find`) or
// alarms (`alarm`, `test`); `finish` turns them into the verdict.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "gap/blocks.h"
#include "gap/catalogue.h"
#include "gap/clean.h"
#include "gap/diagnose.h"
#include "gap/evidence.h"
#include "gap/features/lines.h"
#include "gap/features/noise.h"
#include "gap/features/response.h"
#include "gap/features/settling.h"
#include "gap/features/slow_noise.h"
#include "gap/features/timing.h"
#include "gap/features/tones.h"

namespace sixpoint::gap {

inline constexpr double kLogPrior = -3.5;  // of one effect of the catalogue being there
// A test of what is left alarms at this many standard deviations: about forty tests, one false
// alarm in a thousand bundles if all were normal; their tails are heavier (chi-square, few dwells).
inline constexpr double kAlarm_sd = 5.5;
// The nominal simulator: white noise within 10 %, one estimate's error added.
inline constexpr std::array<double, 3> kNominalNoise_mg = {3.9, 3.9, 5.5};
inline constexpr double kNoiseReach = 0.13;
// An effect is accepted from nine to one on.
inline constexpr double kAccept = 2.2;
inline constexpr double kFormShare = 0.03;
inline constexpr double kGainSd = 0.02;
inline constexpr double kOffsetSd_mg = 35;

// The cube root of chi-square over its freedom is nearly normal (Wilson and Hilferty).
double chi_to_sd(double chi, double freedom);

// Where the forward model's groups keep the contract's parameter names; empty for other effects.
std::string parameter_name(const std::string& effect);

class Diagnoser {
 public:
  Diagnoser(const Bundle& bundle, const DiagnoseOptions& options)
      : bundle_(bundle), options_(options) {}

  Diagnosis run();

 private:
  // findings.cpp
  bool allowed(const std::string& name) const { return options_.without.count(name) == 0; }
  bool accepted(const std::string& name) const {
    return std::any_of(out_.effects.begin(), out_.effects.end(),
                       [&](const EffectFinding& e) { return e.name == name; });
  }
  void find(EffectFinding finding);
  // Something is left over, this many standard deviations beyond chance.
  void alarm(double sd, std::string where) { alarms_.emplace_back(sd, std::move(where)); }
  void test(double sd, const std::string& where) {
    worst_sd_ = std::max(worst_sd_, sd);
    if (sd > kAlarm_sd) {
      alarm(sd, where);
    }
  }
  Diagnosis give_up(const std::string& why);
  void complete_candidates();
  void finish();

  // abilities.cpp: what the protocol offers, and what it can't show
  void find_abilities();
  void list_not_observable();

  // judge_samples.cpp
  void judge_discrete();
  void judge_codes();
  void judge_texture();

  // judge_poses.cpp: false where the unit moves inside the dwells: then nothing that follows means
  // anything.
  bool judge_poses();

  // judge_timing.cpp
  void judge_timing();
  void judge_jitter();
  // A clock that runs fast by e stretches a tone by 1 / (1 + e).
  static double clock_of(const ToneFit& tone) {
    return 1e6 * (1 / (1 + 1e-6 * tone.frequency_ppm) - 1);
  }
  static double share(std::size_t part, std::size_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
  }

  // judge_records.cpp: lines, response, steps
  // steps
  void judge_lines();
  void judge_response();
  void judge_settling();
  double noise_total(std::size_t axis) const;

  // judge_means.cpp: means and tones together
  void judge_means();
  double size_apart_nats(Scatter kind) const;
  // Other effects that would do nearly as well in its place.
  std::vector<std::string> confounded(const std::string& name) const;
  void judge_nuisances();

  // judge_left_over.cpp
  // Variance that the accepted slow noise has within this time.
  double slow_variance_mg2(double seconds) const;
  void judge_left_over();

  // measure_gap.cpp
  void measure_gap();
  void plot_allan();

  const Bundle& bundle_;
  const DiagnoseOptions& options_;
  Diagnosis out_;
  unsigned abilities_ = 0;
  CleanSamples clean_;
  NoiseSpectrum noise_;
  HostTiming timing_;
  std::vector<ToneFit> tones_;
  LineSearch lines_;
  Response response_;
  StepResponse step_;
  SlowNoise slow_;
  CodeStatistics codes_;
  std::vector<Block> blocks_;
  std::optional<EvidenceSearch> search_;
  std::vector<std::pair<double, std::string>> alarms_;
  double worst_sd_ = 0;
  double extra_mg2_ = 0;
  double jitter_s_ = 0;
  bool step_there_ = false;  // something follows the moves that is not accepted as settling
  bool mismatch_ = false;
  bool few_poses_ = false;
  bool poses_wrong_ = false;  // some dwells do not lie as the protocol says
};

}  // namespace sixpoint::gap

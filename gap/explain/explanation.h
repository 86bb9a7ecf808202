// The subset of effects and the kind of scatter that explain the blocks best, and what can be asked
// about them.
//
//   const Explanation explanation(blocks, {.lsb_mg = 1000 / bundle.accel_scale_lsb_per_g});
//   if (explanation.best().contains("tilt")) {
//     const double nats = explanation.gain_nats("tilt");
//     const auto estimate = explanation.estimate("tilt");  // value and standard uncertainty, deg
//   }
//
// Scatter between dwells is nominal seating (0.01 deg per placement) and at most one more kind: one
// of the catalogue (seating, random_walk, flicker; or bad seats beside one of the others), or one
// that the catalogue lacks and that stands for unknown causes (scatter.h). If an unknown kind wins, no random effect of the catalogue has
// the structure of this scatter.
//
// The object refers to `blocks`, which must outlive it. It is constant after construction.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "gap/explain/evidence.h"

namespace sixpoint::gap {

// A parameter that is not constant throughout the recording.
struct Inconstancy {
  std::string term;    // "the zero", "the gain", "the seat", "the jig's level", or an effect
  std::string factor;  // what it changes with
  double nats = 0;     // mean of the Bayes factors of all changes with this factor
};

class Explanation {
 public:
  Explanation(const std::vector<Block>& blocks, EvidenceOptions options);

  const EvidenceModel& model() const { return model_; }
  // Scatter of the catalogue only.
  const Fit& best_known() const { return best_known_; }
  const std::optional<Fit>& best_unknown() const { return best_unknown_; }
  // best_known(), unless an unknown kind of scatter is twenty times as likely.
  const Fit& best() const { return unknown_wins() ? *best_unknown_ : best_known_; }
  bool unknown_wins() const {
    return best_unknown_ && best_unknown_->nats > best_known_.nats + kUnknownWins_nats;
  }
  // Nuisances alone, scatter nominal.
  const Fit& nominal() const { return nominal_; }

  // Log evidence of the best explanation with this effect over the best without it; 0 if only one
  // of the two was tried. `known_only`: scatter that the catalogue lacks does not compete.
  double gain_nats(const std::string& effect, bool known_only = false) const;
  // Log evidence of the best explanation with `other` and without the effect over the best with the
  // effect; kExcluded_nats if only one of the two was tried.
  double stand_in_nats(const std::string& effect, const std::string& other) const;
  // Log odds of the best explanation with an unknown kind of scatter over the best known one.
  double unknown_nats() const {
    return best_unknown_ ? best_unknown_->nats - best_known_.nats : kExcluded_nats;
  }
  struct Estimate {
    std::vector<double> value;
    std::vector<double> sd;
    double tau_s = 0;
  };
  // Of an effect of the best explanation, or of any other added to it. Each effect that does not
  // bend has the prior of its full size, whatever size it was found by: numbers that the data leave
  // open, as six faces leave a turn about (1, 1, 1) between tilt, misalignment and cross-axis terms,
  // are as uncertain as the catalogue leaves them.
  std::optional<Estimate> estimate(const std::string& effect) const;
  // Effects of the best explanation that leave the numbers of this one open: without one of them
  // its standard uncertainty, which is half of its smallest realistic size and more, would be a
  // third or less.
  std::vector<std::string> left_open_by(const std::string& effect) const;
  // Posterior over prior standard deviation of the effect's worst parameter: 1 = the data say
  // nothing.
  double undetermined(const std::string& effect) const;
  // Log evidence to be expected of this effect at its smallest realistic size, prior included.
  // Below kAccept_nats this recording can't show it at that size.
  double expected_nats(const std::string& effect) const;
  // The size, in the unit of the effect's first parameter, at which this recording shows it half of
  // the time: its expected evidence beside everything else of the best explanation just reaches
  // kAccept_nats. Of one axis, the others a uniform share of it. None for effects that the means do
  // not show.
  std::optional<double> bound(const std::string& effect) const;
  // The same of a scatter of the catalogue, in the unit of sizes_of(), beside a drift, too: most of
  // what a walk adds is one. `record_nats`: evidence for a size that is tried which the records are
  // expected to have where another size is there. None of more than 400 blocks.
  std::optional<double> bound(
      Scatter kind, const std::function<double(double size, double tried)>& record_nats) const;
  // Log evidence that an effect of the best explanation (or "gain") changes in proportion to time,
  // over the best explanation, in which it is constant.
  double changing_nats(const std::string& effect) const;
  // Per factor (time, temperature, session, pose, approach, vibration) the evidence that a
  // parameter changes with it; likeliest first. Means of Bayes factors: if all is constant, one
  // exceeds e^x with a probability below e^-x (Markov's inequality).
  std::vector<Inconstancy> inconstancies() const;
  // Per row of best(): expected square of the whitened residual, 1 less the leverage.
  std::vector<double> row_freedom() const;
  // Log predictive likelihood of held-out conditions with the effect less without it.
  double held_out_nats(const std::string& effect) const;

  // Mean square, mg^2 per mean and tone amplitude, that each effect of the best explanation adds
  // beyond what gains and offsets take over: its Shapley value in the mean square of all together
  // (for a sum of vectors that is the product of the vector with the sum). Of a scatter: what it
  // is expected to add.
  std::map<std::string, double> gap_mg2() const;

  // Root mean squares of what was predicted from the other conditions, before (nuisances only) and
  // after (best explanation); sigma: in standard deviations of noise and nominal seating.
  struct HeldOut {
    double before_mg = 0, after_mg = 0;
    double floor_mg = 0;  // what noise and seating leave
    double before_sigma = 0, after_sigma = 0;
    double tone_before_sigma = 0, tone_after_sigma = 0;
    double mean_before_sigma = 0, mean_after_sigma = 0;
    int rows = 0;
  };
  // `named`: effects that count as explained; others are not fitted, and of what bends an effect from
  // its plain law the estimates are taken out, as a simulation with the named effects would have it.
  HeldOut held_out(const std::set<std::string>& named) const;
  // Per row: what the named effects leave, all conditions fitted, in standard deviations of noise,
  // nominal seating and named scatter.
  std::vector<double> left_over_sigma(const std::set<std::string>& named) const;

 private:
  struct Tried {
    Scatter scatter;
    bool bad_seats;  // beside it
    Subset subset;
  };
  // As a group, or as its scatter.
  bool has(const Tried& tried, const std::string& effect) const;
  struct Information {
    double per_size2 = 0;   // nats times two, for a size of one
    double occam_nats = 0;  // what the free numbers cost
  };
  Information information(int g, std::vector<int> others) const;
  // Of group `g` among `groups`, all with their widest priors.
  Estimate estimate_of(int g, std::vector<int> groups) const;
  // Of the best explanation what a simulation with the named effects has: their groups, and for each
  // column of a solution with these whether it counts.
  struct Named {
    std::vector<int> groups;
    std::vector<bool> counts;
  };
  Named of_named(const std::set<std::string>& named) const;
  // What one kind of scatter explains.
  struct Trial {
    std::optional<Fit> fit;
    Whitened data;
  };
  void remember(const Whitened& data, const std::vector<Subset>& tried);
  ForwardState explain_nominal();
  bool records_show_slow_noise() const;
  Trial explain_by(Scatter scatter, const Eigen::MatrixXd& linear);
  Trial explain_by_slow_noise_and_seats(Scatter slow, const Eigen::MatrixXd& linear);
  void compete(Scatter scatter, Trial trial, Whitened& unknown_data);

  EvidenceModel model_;
  std::vector<Tried> tried_;
  Fit nominal_;
  Fit best_known_;
  Fit best_nominal_;  // of the catalogue, without scatter
  std::optional<Fit> best_unknown_;
  Whitened data_;           // at best()'s covariance and state
  Eigen::MatrixXd linear_;  // linearise() at best()'s state
};

// evidence_zero_step.cpp: the best explanation with a zero that moves once, at an unknown moment.
// `nominal`: whitened with nominal scatter at `at`. None with fewer than three blocks.
std::optional<Fit> fit_zero_step(const EvidenceModel& model, const Whitened& nominal,
                                 const ForwardState& at);

}  // namespace sixpoint::gap

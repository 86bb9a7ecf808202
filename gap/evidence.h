// Which subset of effects explains the blocks: exact Gaussian evidence, over subsets and over the
// kinds of scatter (scatter.h) between dwells.
//
// Model: value = forward(parameters) + seating + scatter + noise. Parameters have Gaussian priors
// from the catalogue's realistic sizes, so that the evidence of a subset is known in closed form
// and carries its own penalty for every parameter that the data did not need. Linearised about the
// current estimate and repeated.
//
// Scatter is nominal seating (0.01 deg per placement) and at most one more kind: those of the
// catalogue (seating, random_walk, flicker), and those that the catalogue has not and that stand
// for whatever is unknown: scatter that repeats with the pose, that is new with each placement but
// has no lever of a rotation, that follows temperature, that follows time smoothly. A kind of the
// second sort that wins is the structure test against a random effect that absorbs everything.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "gap/forward.h"
#include "gap/scatter.h"

namespace sixpoint::gap {

inline constexpr int kNuisances = 2;  // groups: gain, offset

// Sums that the evidence of every subset needs, for one covariance.
struct Whitened {
  Scatter scatter = Scatter::nominal;
  double size = 0;          // deg, mg/sqrt(s) or mg
  double outside_nats = 0;  // evidence on this size from records (slow noise), and its prior
  Eigen::MatrixXd x;        // whitened columns: every group's
  Eigen::VectorXd y;
  std::vector<int> row_block;
  Eigen::MatrixXd a;
  Eigen::VectorXd b;
  double yy = 0;
  double half_log_det = 0;
};

struct Subset {
  std::vector<int> groups;  // ascending, positions in the search's list, nuisances left out
  double nats = 0;          // log evidence and log prior
};

struct Posterior {
  Eigen::VectorXd mean;  // per column used
  Eigen::MatrixXd covariance;
  std::vector<int> columns;
};

struct EvidenceOptions {
  double lsb_mg = 3.90625;
  double log_prior_effect =
      -3.5;  // about one effect in thirty present; thirty are in the catalogue
  double log_prior_unknown = -4.5;
  std::function<bool(const std::string&)> allowed;  // catalogue name; empty: all
  // Log likelihood of a size of random_walk or flicker from the records themselves.
  std::function<double(Scatter, double)> record_nats;
};

struct Fit {
  ForwardState state;
  Subset subset;
  std::vector<ParameterGroup> groups;  // of the subset
  Posterior posterior;                 // nuisances first, then the subset's columns
  Scatter scatter = Scatter::nominal;
  double scatter_size = 0;
  double nats = 0;
  // Whitened residual per row and what block it is of.
  Eigen::VectorXd residual;
  std::vector<int> row_block;
};

// A parameter that does not hold throughout the recording.
struct Inconstancy {
  std::string term;    // "the zero", "the gain", "the seat", "the jig's level", or an effect
  std::string factor;  // what it changes with
  double nats = 0;     // mean of the Bayes factors of all changes with this factor
  double best_nats = 0;
};

class EvidenceSearch {
 public:
  // Keeps a reference to `blocks`.
  EvidenceSearch(const std::vector<Block>& blocks, EvidenceOptions options);

  void run();

  const Fit& best_known() const { return best_known_; }  // scatter of the catalogue only
  // The explanation that stands: of the catalogue, unless an unknown kind of scatter is twenty
  // times as likely.
  const Fit& best() const { return unknown_wins() ? *best_unknown_ : best_known_; }
  bool unknown_wins() const { return best_unknown_ && best_unknown_->nats > best_known_.nats + 3; }
  const std::optional<Fit>& best_unknown() const { return best_unknown_; }
  // Nothing but nuisances, scatter nominal.
  const Fit& nominal() const { return nominal_; }

  // Probability over everything that was looked at (with scatter of the catalogue).
  double probability(const std::string& effect) const;
  // Log evidence of the best explanation with this effect over the best without it; with
  // `known_only` kinds of scatter that the catalogue lacks do not compete.
  double gain_nats(const std::string& effect, bool known_only = false) const;
  // Log odds of the best explanation with scatter of an unknown kind over the best known one.
  double unknown_nats() const {
    return best_unknown_ ? best_unknown_->nats - best_known_.nats : -1e3;
  }
  // Estimate of an effect on top of the best explanation, for candidates that were not accepted.
  struct Estimate {
    std::vector<double> value;
    std::vector<double> sd;
    double tau_s = 0;
  };
  std::optional<Estimate> estimate(const std::string& effect) const;
  // How well this effect's parameters would be known: sd over prior sd of the worst, 1 = not at
  // all.
  double undetermined(const std::string& effect) const;
  // Log evidence to be expected of this effect at its smallest realistic size, prior included:
  // below the threshold of acceptance this recording can't show it so small.
  double expected_nats(const std::string& effect) const;
  // Log evidence that an effect of the best explanation (or "gain") is not constant but changes in
  // proportion to time, over the best explanation, in which it is constant.
  double changing_nats(const std::string& effect) const;
  // Whether every parameter holds in all parts of the recording: whether a change of it with time,
  // temperature, session, pose, approach or vibration is likelier than that it is constant. One
  // entry per factor, likeliest first. Means of Bayes factors: under constancy one exceeds e^x with
  // a chance below e^-x.
  std::vector<Inconstancy> inconstancies() const;
  // Per row of best(): mean square of the whitened residual to be expected, 1 less the leverage.
  std::vector<double> row_freedom() const;
  // Log predictive likelihood of held-out conditions with the effect less without it.
  double held_out_nats(const std::string& effect) const;

  struct HeldOut {
    double before_mg = 0;  // rms of what was predicted from the other conditions
    double after_mg = 0;
    double floor_mg = 0;  // rms that noise and seating leave
    double before_sigma = 0;
    double after_sigma = 0;
    double tone_before_sigma = 0;
    double tone_after_sigma = 0;
    double mean_before_sigma = 0;
    double mean_after_sigma = 0;
    int rows = 0;
  };
  HeldOut held_out() const;

 private:
  void find_best();
  // evidence_whiten.cpp
  // `linear`: as linearise() gives it.
  Whitened whiten(Eigen::MatrixXd linear, Scatter scatter, double size) const;
  Whitened whiten(const ForwardState& at, Scatter scatter, double size) const {
    return whiten(linearise(at), scatter, size);
  }
  Eigen::MatrixXd linearise(const ForwardState& at) const;
  double whiten_rows(Scatter scatter, double size, Eigen::MatrixXd& m) const;
  // evidence_subsets.cpp
  Subset search(const Whitened& w, std::vector<Subset>& looked_at) const;
  double evidence(const Whitened& w, const std::vector<int>& groups, Posterior* posterior) const;
  double evidence_of(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double yy,
                     const std::vector<int>& groups, Posterior* posterior) const;
  double log_prior(const std::vector<int>& groups) const;
  Fit make_fit(const Whitened& w, const Subset& subset, const ForwardState& at) const;
  // evidence.cpp
  double chi_sd(const Fit& fit) const;
  ForwardState first_guess() const;
  void polish_shapes(Fit& fit);
  // evidence_zero_step.cpp
  std::optional<Fit> fit_step(const Whitened& nominal, const ForwardState& at) const;

  const std::vector<Block>& blocks_;
  EvidenceOptions options_;
  std::vector<ParameterGroup> groups_;  // nuisances first
  std::vector<int> group_column_;       // first column of each group
  std::vector<std::vector<int>> columns_of_;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<int> row_block_;

  struct State {
    Scatter scatter;
    double size;
    Subset subset;
  };
  std::vector<State> states_;
  Fit nominal_;
  Fit best_known_;
  Fit best_nominal_;  // of the catalogue, without scatter
  std::optional<Fit> best_unknown_;
  Whitened final_;               // at best()'s covariance and state
  Eigen::MatrixXd linear_best_;  // linearise() at best()'s state
};

}  // namespace sixpoint::gap

// Exact Gaussian evidence of subsets of effects for a list of blocks.
//
//   EvidenceOptions options;
//   options.lsb_mg = 1000 / bundle.accel_scale_lsb_per_g;
//   const EvidenceModel model(blocks, options);
//   const Whitened data = model.whiten(model.linearise(model.first_guess()), Scatter::nominal, 0);
//   std::vector<Subset> tried;
//   const Subset best = model.search(data, tried);  // best.nats: log evidence and log prior
//   const Fit fit = model.make_fit(data, best, model.first_guess());
//
// Model: value = forward(parameters) + seating + scatter + noise. Parameters have Gaussian priors
// from the catalogue's realistic sizes, so that the evidence of a subset has a closed form
// (Bayesian linear regression) and contains its own penalty for parameters that the data do not
// need. Linearised about an estimate.
//
// Units: mg for values, nats for evidence. The model refers to `blocks`, which must outlive it.
// Constant after construction, but for set_time_constant(); safe to read from several threads.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "gap/explain/decisions.h"
#include "gap/explain/forward.h"
#include "gap/explain/scatter.h"

namespace sixpoint::gap {

inline constexpr int kNuisances = 2;           // groups: gain, offset
inline constexpr int kNuisanceParameters = 6;  // their parameters, which come first everywhere
inline constexpr double kNoEvidence_nats = -1e300;

// Normal equations of whitened rows; every subset takes its part of them.
struct NormalSums {
  Eigen::MatrixXd a;
  Eigen::VectorXd b;
  double yy = 0;
};

// The blocks under one covariance: rows divided by its square root.
struct Whitened {
  Scatter scatter = Scatter::nominal;
  double size = 0;          // deg, mg/sqrt(s) or mg
  double seats_deg = 0;     // bad seats beside a slow noise; 0: none
  double outside_nats = 0;  // evidence for this size from records (slow noise), and its prior
  Eigen::MatrixXd x;        // a column for each parameter of every group
  Eigen::VectorXd y;
  NormalSums sums;
  double half_log_det = 0;
};

struct Subset {
  std::vector<int> groups;  // ascending positions in EvidenceModel::groups(), without nuisances
  double nats = 0;          // log evidence and log prior
};

struct Posterior {
  Eigen::VectorXd mean;  // per column used
  Eigen::MatrixXd covariance;
  std::vector<int> columns;
};

// The estimate by one subset, and what its covariance is made of: that costs six times the rest.
struct Solution {
  double nats = 0;       // log evidence
  Eigen::VectorXd mean;  // per column used
  Eigen::VectorXd sd;    // of the prior
  std::vector<int> columns;
  Eigen::LLT<Eigen::MatrixXd> normal;  // in units of the prior

  Posterior posterior() const;
};

struct EvidenceOptions {
  double lsb_mg = 3.90625;
  std::function<bool(const std::string&)> allowed = {};  // catalogue name; empty: all
  // Log likelihood of a size of random_walk or flicker from the records themselves.
  std::function<double(Scatter, double)> record_nats = {};
  std::vector<LearntSize> learnt = {};
};

struct Fit {
  ForwardState state;
  Subset subset;
  std::vector<ParameterGroup> groups;  // of the subset
  Posterior posterior;                 // nuisances first, then the subset's columns
  Scatter scatter = Scatter::nominal;
  double scatter_size = 0;
  double seats_deg = 0;  // bad seats beside a slow noise; 0: none
  double nats = 0;
  Eigen::VectorXd residual;  // whitened, per row

  bool contains(const std::string& effect) const;
  // Of one kind of scatter of the catalogue; 0: the fit does not have it.
  double size_of(Scatter kind) const {
    return kind == scatter ? scatter_size : kind == Scatter::seating ? seats_deg : 0;
  }
};

class EvidenceModel {
 public:
  EvidenceModel(const std::vector<Block>& blocks, EvidenceOptions options);

  const std::vector<Block>& blocks() const { return blocks_; }
  const EvidenceOptions& options() const { return options_; }
  bool allowed(const std::string& effect) const {
    return !options_.allowed || options_.allowed(effect);
  }
  // Nuisances first; an effect with several shapes has one group for each.
  int group_count() const { return static_cast<int>(groups_.size()); }
  const ParameterGroup& group(int g) const { return groups_[static_cast<std::size_t>(g)]; }
  int first_column(int g) const { return first_column_[static_cast<std::size_t>(g)]; }
  std::vector<int> groups_of(const std::string& effect) const;
  // The same numbers with the widest prior that they have. What was learnt stays, and what bends:
  // how much it bends goes with its size.
  int widest(int g) const;
  // Of this group and of those that share its columns.
  void set_time_constant(int g, double tau_s);
  int columns() const { return columns_; }
  int rows() const { return static_cast<int>(row_block_.size()); }
  const std::vector<int>& row_block() const { return row_block_; }
  // Which of its block's features a row is: see Block::value_mg.
  int feature_of_row(int row) const;
  const Block& block_of_row(Eigen::Index row) const {
    return blocks_[static_cast<std::size_t>(row_block_[static_cast<std::size_t>(row)])];
  }

  // Least squares of gain and offset from the means.
  ForwardState first_guess() const;

  // evidence_whiten.cpp
  // Columns of all parameters, and in the last one the values that they add up to.
  Eigen::MatrixXd linearise(const ForwardState& at) const;
  // Divides rows by the square root of their covariance; half the logarithm of its determinant.
  double whiten_rows(Scatter scatter, double size, Eigen::MatrixXd& rows,
                     double seats_deg = 0) const;
  Whitened whiten(Eigen::MatrixXd linear, Scatter scatter, double size, double seats_deg = 0) const;

  // evidence_subsets.cpp
  // These groups beside the nuisances, without the covariance's determinant.
  Solution solve(const NormalSums& sums, const std::vector<int>& groups) const;
  // Log evidence with it; an estimate far beyond an effect's largest size has none.
  double evidence(const Whitened& w, const std::vector<int>& groups,
                  Posterior* posterior = nullptr) const;
  // Of these groups beside this scatter, over none: see log_prior_of_count(), and
  // learnt_log_prior() of what was learnt.
  double log_prior(const std::vector<int>& groups, Scatter scatter = Scatter::nominal,
                   double seats_deg = 0) const;
  // The likeliest subset; every subset that was tried is added to `tried`. `swap`: also tries each
  // other effect in the place of each one found (some hundred subsets more).
  Subset search(const Whitened& w, std::vector<Subset>& tried, bool swap = false) const;
  Fit make_fit(const Whitened& w, const Subset& subset, const ForwardState& at) const;
  // Rows less the numbers that they determine; what the prior determines is none (effective number
  // of parameters: MacKay, Bayesian Interpolation, Neural Computation 4, 1992).
  double freedom_of(const Fit& fit) const;

 private:
  Subset climb(const Whitened& w, Subset from, bool generous, bool swap,
               std::vector<Subset>& tried) const;
  // Of these groups and this scatter, those whose prior is that of their count.
  std::size_t counted(const std::vector<int>& groups, Scatter scatter, double seats_deg) const;
  Subset attempt(const Whitened& w, std::vector<int> groups, std::vector<Subset>& tried) const;
  bool fits(const std::vector<int>& groups, int g) const;
  Eigen::Index whiten_blocks(std::size_t first, std::size_t last, Scatter scatter, double size,
                             double seats_deg, Eigen::Index first_row, double& half_log_det,
                             Eigen::MatrixXd& rows) const;
  void add_columns(const ForwardState& at, const Block& block, const Eigen::VectorXd& base, int g,
                   Eigen::Index row, Eigen::MatrixXd& x, Eigen::VectorXd& theta) const;

  const std::vector<Block>& blocks_;
  EvidenceOptions options_;
  std::vector<ParameterGroup> groups_;
  std::vector<int> first_column_;
  int columns_ = 0;
  std::vector<int> row_block_;
};

// Log prior odds of `count` given effects over none. Units are of two sorts: a few have one fault
// or two, each effect with the odds of kLogPriorEffect; kShareOfRealUnits of them have a little of
// everything, each effect with even odds. So the third effect that is found makes others likelier
// (a prior over the number of effects: Scott and Berger 2010).
//
// | count | nats  |
// |-------|-------|
// | 0     | 0     |
// | 1     | -3.5  |
// | 2     | -7.0  |
// | 3     | -10.4 |
// | 4     | -12.5 |
// | 10    | -12.8 |
double log_prior_of_count(std::size_t count);

// Nuisances and the subset's groups.
std::vector<int> with_nuisances(const std::vector<int>& groups);
std::vector<int> with_group(std::vector<int> groups, int g);
// The columns of x that a posterior speaks of.
Eigen::MatrixXd used_columns(const Eigen::MatrixXd& x, const Posterior& posterior);
Eigen::VectorXd residual_of(const Whitened& w, const Posterior& posterior);
// Sum of the logarithms of a Cholesky factor's diagonal: half the log determinant.
template <typename Cholesky>
double half_log_determinant(const Cholesky& llt) {
  return llt.matrixLLT().diagonal().array().log().sum();
}

}  // namespace sixpoint::gap

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "gap/explain/explanation.h"
#include "gap/explain/factors.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kLeastBlocks = 6;
// Prior sizes of a change that are tried (conventions): of gains, of the zero in mg, of angles in
// deg, and as shares of an accepted effect.
constexpr std::array<double, 3> kGainSizes = {5e-4, 2e-3, 8e-3};
constexpr std::array<double, 3> kZeroSizes_mg = {0.5, 2, 8};
constexpr std::array<double, 3> kAngleSizes_deg = {0.02, 0.1, 0.4};
constexpr std::array<double, 2> kEffectShares = {0.15, 0.6};
// A change begins at this many times what the form may be bent (kBend).
constexpr double kBeyondForm = 2;

// A parameter that may change, with the columns of its derivative.
struct Term {
  std::string name;
  Eigen::MatrixXd column;
  std::vector<double> sizes;
  double form = 0;          // a change of this size belongs to the effect's form
  double form_in_time = 0;  // the same for changes with time
  bool slow = false;
};

template <std::size_t N>
std::vector<double> scaled(const std::array<double, N>& sizes, double factor = 1) {
  std::vector<double> list;
  list.reserve(N);
  for (const double size : sizes) {
    list.push_back(size * factor);
  }
  return list;
}

double log_mean(const std::vector<double>& nats) {
  const double high = *std::max_element(nats.begin(), nats.end());
  double sum = 0;
  for (const double x : nats) {
    sum += std::exp(x - high);
  }
  return high + std::log(sum / static_cast<double>(nats.size()));
}

// The parameters of the fit, the jig's level and the seat. `linear`: about the fit's state.
std::vector<Term> terms_of(const EvidenceModel& model, const Fit& fit,
                           const Eigen::MatrixXd& linear) {
  const std::vector<Block>& blocks = model.blocks();
  const double hours = (blocks.back().middle_s - blocks.front().middle_s) / 3600;
  std::vector<Term> terms;
  double slow_mg = 0;
  for (const int g : with_nuisances(fit.subset.groups)) {
    const ParameterGroup& group = model.group(g);
    const int count = std::min(3, group.count);
    Term term{group.effect, linear.middleCols(model.first_column(g), count), {}};
    if (group.effect == "gain") {
      term.name = "the gain";
      term.sizes = scaled(kGainSizes);
    } else if (group.effect == "offset") {
      term.name = "the zero";
      term.sizes = scaled(kZeroSizes_mg);
    } else {
      double size = 0;
      for (int i = 0; i < count; ++i) {
        size = std::max(size, std::abs(parameter(fit.state, group.first + i)));
      }
      term.sizes = scaled(kEffectShares, size);
      term.form = kBend * size;
      term.slow = group.effect == "drift" || group.effect == "warm_up";
      if (term.slow) {
        slow_mg += size * (group.effect == "drift" ? hours : 1);
      }
    }
    terms.push_back(std::move(term));
  }
  terms[1].form_in_time = kBend * slow_mg;
  Term lab{"the jig's level", Eigen::MatrixXd(model.rows(), 3), scaled(kAngleSizes_deg)};
  Term seat{"the seat", Eigen::MatrixXd(model.rows(), 3), scaled(kAngleSizes_deg)};
  Eigen::Index row = 0;
  for (const Block& block : blocks) {
    const Eigen::MatrixXd lever = seating_lever(block);
    seat.column.middleRows(row, block.size()) = lever;
    lab.column.middleRows(row, block.size()) = lever * block.rotation;
    row += block.size();
  }
  terms.push_back(std::move(lab));
  terms.push_back(std::move(seat));
  return terms;
}

// The fit's columns, the values, and each term times each function of each factor, all whitened.
struct Regressors {
  Eigen::MatrixXd rows;
  double half_log_det = 0;
};

Regressors regressors(const EvidenceModel& model, const Fit& fit, const Eigen::MatrixXd& linear,
                      const std::vector<Term>& terms, const std::vector<Factor>& factors) {
  Eigen::Index columns = 0;
  for (const Term& term : terms) {
    for (const Factor& factor : factors) {
      columns += term.column.cols() * factor.value.cols();
    }
  }
  const Eigen::Index used = std::ssize(fit.posterior.columns);
  Regressors all{Eigen::MatrixXd(model.rows(), used + 1 + columns), 0};
  all.rows.leftCols(used) = used_columns(linear, fit.posterior);
  all.rows.col(used) = linear.col(model.columns());
  Eigen::Index at = used + 1;
  for (const Term& term : terms) {
    for (const Factor& factor : factors) {
      for (Eigen::Index f = 0; f < factor.value.cols(); ++f) {
        for (Eigen::Index r = 0; r < model.rows(); ++r) {
          const double scale = factor.value(model.row_block()[static_cast<std::size_t>(r)], f);
          all.rows.row(r).segment(at, term.column.cols()) = scale * term.column.row(r);
        }
        at += term.column.cols();
      }
    }
  }
  all.half_log_det = model.whiten_rows(fit.scatter, fit.scatter_size, all.rows, fit.seats_deg);
  return all;
}

// The fit once more, about its own estimate, in units of the prior and from the prior's mean.
struct Refit {
  Eigen::VectorXd left;   // whitened residual
  Eigen::MatrixXd taken;  // what the parameters would take over from each change
  double nats = 0;
};

Refit refit(const EvidenceModel& model, const Fit& fit, const Regressors& all) {
  const Eigen::Index used = std::ssize(fit.posterior.columns);
  Eigen::VectorXd prior_sd(used);
  Eigen::VectorXd prior_mean(used);
  Eigen::Index at = 0;
  for (const int g : with_nuisances(fit.subset.groups)) {
    for (int i = 0; i < model.group(g).count; ++i) {
      prior_mean[at] = model.group(g).mean_of(i);
      prior_sd[at++] = model.group(g).sd_of(i);
    }
  }
  const Eigen::MatrixXd x = all.rows.leftCols(used) * prior_sd.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> normal(x.transpose() * x +
                                           Eigen::MatrixXd::Identity(used, used));
  const Eigen::VectorXd value = all.rows.col(used) - all.rows.leftCols(used) * prior_mean;
  const Eigen::VectorXd pull = x.transpose() * value;
  const Eigen::VectorXd estimate = normal.solve(pull);
  Refit again;
  again.left = value - x * estimate;
  again.nats = 0.5 * pull.dot(estimate) - 0.5 * value.squaredNorm() - all.half_log_det -
               half_log_determinant(normal) +
               model.log_prior(fit.subset.groups, fit.scatter, fit.seats_deg);
  again.taken = x.transpose() * all.rows.rightCols(all.rows.cols() - used - 1);
  normal.matrixL().solveInPlace(again.taken);
  return again;
}

// Log evidence of a change of this prior size, from its normal equations.
double change_nats(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const Factor& factor,
                   double size) {
  if (size <= 0) {
    return 0;
  }
  const Eigen::Index width = b.size() / factor.value.cols();
  Eigen::VectorXd sd(b.size());
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    sd[i] = size * factor.weight[static_cast<std::size_t>(i / width)];
  }
  Eigen::MatrixXd scaled_a = sd.asDiagonal() * a * sd.asDiagonal();
  scaled_a.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> llt(scaled_a);
  if (llt.info() != Eigen::Success) {
    return 0;
  }
  const Eigen::VectorXd v = sd.cwiseProduct(b);
  return 0.5 * v.dot(llt.solve(v)) - half_log_determinant(llt);
}

// The Bayes factors of one factor's changes, and the likeliest term.
struct Changes {
  std::vector<double> nats;
  std::string term;
  double most_nats = 0;

  void add(const std::string& name, double gain_nats) {
    nats.push_back(gain_nats);
    if (term.empty() || gain_nats > most_nats) {
      term = name;
      most_nats = gain_nats;
    }
  }
};

// Adds the Bayes factors of all changes beside `fit`. `over_nats`: evidence of the explanation that
// they are compared with, if it is not this fit.
void add_changes(const EvidenceModel& model, const Fit& fit, const Eigen::MatrixXd& linear,
                 const std::vector<Factor>& factors, std::optional<double> over_nats,
                 std::map<std::string, Changes>& by_factor) {
  const std::vector<Term> terms = terms_of(model, fit, linear);
  const Regressors all = regressors(model, fit, linear, terms, factors);
  const Refit again = refit(model, fit, all);
  const double less = over_nats ? *over_nats - again.nats : 0;
  const Eigen::Index used = std::ssize(fit.posterior.columns);
  Eigen::Index first = 0;
  for (const Term& term : terms) {
    for (const Factor& factor : factors) {
      const Eigen::Index count = term.column.cols() * factor.value.cols();
      const auto z = all.rows.middleCols(used + 1 + first, count);
      const auto over = again.taken.middleCols(first, count);
      const Eigen::MatrixXd a = z.transpose() * z - over.transpose() * over;
      const Eigen::VectorXd b = z.transpose() * again.left;
      first += count;
      if (term.slow && factor.in_time) {
        continue;
      }
      // The form's own changes may have any size up to this; other changes begin beyond.
      const double form = factor.in_time ? std::max(term.form, term.form_in_time) : term.form;
      const auto nats = [&](double size) { return change_nats(a, b, factor, size); };
      const double form_nats = std::max({0.0, nats(form / 10), nats(form / 3), nats(form)});
      for (const double size : term.sizes) {
        if (size >= kBeyondForm * form) {
          by_factor[factor.name].add(term.name, nats(size) - form_nats - less);
        }
      }
    }
  }
}

}  // namespace

std::vector<Inconstancy> Explanation::inconstancies() const {
  if (model_.blocks().size() < kLeastBlocks || !in_catalogue(best_known_.scatter)) {
    return {};
  }
  const std::vector<Factor> factors = factors_of(model_.blocks());
  const auto linear_of = [&](const Fit& fit) {
    return &fit == &best() ? linear_ : model_.linearise(fit.state);
  };
  std::map<std::string, Changes> by_factor;
  add_changes(model_, best_known_, linear_of(best_known_), factors, std::nullopt, by_factor);
  if (best_known_.scatter != Scatter::nominal) {
    // Without scatter, but against what is accepted as if it were certain: a probability of e^-x is
    // to be just that.
    const double certain_nats =
        best_known_.nats -
        model_.log_prior(best_known_.subset.groups, best_known_.scatter, best_known_.seats_deg) -
        scatter_log_prior(best_known_.scatter) -
        (best_known_.seats_deg > 0 ? scatter_log_prior(Scatter::seating) : 0);
    add_changes(model_, best_nominal_, linear_of(best_nominal_), factors, certain_nats, by_factor);
  }
  std::vector<Inconstancy> found;
  found.reserve(by_factor.size());
  for (const auto& [factor, changes] : by_factor) {
    found.push_back({changes.term, factor, log_mean(changes.nats)});
  }
  std::sort(found.begin(), found.end(),
            [](const Inconstancy& a, const Inconstancy& b) { return a.nats > b.nats; });
  return found;
}

}  // namespace sixpoint::gap

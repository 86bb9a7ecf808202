#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "gap/evidence.h"

namespace sixpoint::gap {
namespace {

double log_sum(double a, double b) {
  const double high = std::max(a, b);
  return high == -1e300 ? high : high + std::log(std::exp(a - high) + std::exp(b - high));
}

}  // namespace

double EvidenceSearch::probability(const std::string& effect) const {
  double with = -1e300;
  double without = -1e300;
  for (const State& state : states_) {
    const bool has =
        to_string(state.scatter) == effect ||
        std::any_of(state.subset.groups.begin(), state.subset.groups.end(),
                    [&](int g) { return groups_[static_cast<std::size_t>(g)].effect == effect; });
    double& sum = has ? with : without;
    sum = log_sum(sum, state.subset.nats);
  }
  return with == -1e300 ? 0 : 1 / (1 + std::exp(std::min(700.0, without - with)));
}

double EvidenceSearch::gain_nats(const std::string& effect, bool known_only) const {
  double with = -1e300;
  double without = -1e300;
  for (const State& state : states_) {
    if (known_only && !in_catalogue(state.scatter)) {
      continue;
    }
    const bool has =
        to_string(state.scatter) == effect ||
        std::any_of(state.subset.groups.begin(), state.subset.groups.end(),
                    [&](int g) { return groups_[static_cast<std::size_t>(g)].effect == effect; });
    double& best = has ? with : without;
    best = std::max(best, state.subset.nats);
  }
  return with == -1e300 || without == -1e300 ? 0 : with - without;
}

std::optional<EvidenceSearch::Estimate> EvidenceSearch::estimate(const std::string& effect) const {
  std::vector<int> base = best().subset.groups;
  int chosen = -1;
  for (const int g : base) {
    if (groups_[static_cast<std::size_t>(g)].effect == effect) {
      chosen = g;
    }
  }
  if (chosen < 0) {
    double best = -1e300;
    for (int g = kNuisances; g < static_cast<int>(groups_.size()); ++g) {
      if (groups_[static_cast<std::size_t>(g)].effect == effect) {
        std::vector<int> grown = base;
        grown.insert(std::upper_bound(grown.begin(), grown.end(), g), g);
        const double nats = evidence(final_, grown, nullptr);
        if (nats > best) {
          best = nats;
          chosen = g;
        }
      }
    }
    if (chosen < 0) {
      return std::nullopt;
    }
    base.insert(std::upper_bound(base.begin(), base.end(), chosen), chosen);
  }
  Posterior posterior;
  evidence(final_, base, &posterior);
  Estimate estimate;
  const ParameterGroup& group = groups_[static_cast<std::size_t>(chosen)];
  for (std::size_t k = 0; k < posterior.columns.size(); ++k) {
    const int c = posterior.columns[k] - group_column_[static_cast<std::size_t>(chosen)];
    if (c >= 0 && c < std::min(3, group.count)) {
      const auto i = static_cast<Eigen::Index>(k);
      estimate.value.push_back(posterior.mean[i]);
      estimate.sd.push_back(std::sqrt(posterior.covariance(i, i)));
    }
  }
  estimate.tau_s = group.tau_s;
  return estimate;
}

double EvidenceSearch::undetermined(const std::string& effect) const {
  double worst = 0;
  bool any = false;
  for (int g = kNuisances; g < static_cast<int>(groups_.size()); ++g) {
    const ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
    if (group.effect != effect) {
      continue;
    }
    Posterior posterior;
    evidence(final_, {g}, &posterior);
    double here = 0;
    for (std::size_t k = 6; k < std::min<std::size_t>(9, posterior.columns.size()); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      here = std::max(here, std::sqrt(posterior.covariance(i, i)) / group.prior_sd);
    }
    worst = any ? std::min(worst, here) : here;  // the best determined shape counts
    any = true;
  }
  return any ? worst : 1;
}

double EvidenceSearch::expected_nats(const std::string& effect) const {
  // One axis has the size, the others a uniform share of it: the squares add up to 5/3 on average.
  constexpr double kOthers = 1.0 / 3;
  double best = -1e300;
  for (int g = kNuisances; g < static_cast<int>(groups_.size()); ++g) {
    const ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
    if (group.effect != effect || group.small == 0) {
      continue;
    }
    Posterior posterior;
    evidence(final_, {g}, &posterior);
    const Eigen::Index count = std::min(3, group.count);
    // What the data alone say of the numbers: posterior less prior precision.
    const Eigen::MatrixXd covariance = posterior.covariance.block(6, 6, count, count);
    double square = 0;
    double occam = 0;
    for (Eigen::Index i = 0; i < count; ++i) {
      const double prior2 = group.prior_sd * group.prior_sd;
      const double left = std::min(covariance(i, i), prior2 * (1 - 1e-9));
      const double information = 1 / left - 1 / prior2;
      square += group.small * group.small * information * (i == 0 ? 1 : kOthers);
      occam += 0.5 * std::log(prior2 / left);
    }
    best = std::max(best, 0.5 * square - occam + log_prior({g}));
  }
  return best == -1e300 ? 1e300 : best;
}

std::vector<double> EvidenceSearch::row_freedom() const {
  const Posterior& posterior = best().posterior;
  const auto used = static_cast<Eigen::Index>(posterior.columns.size());
  Eigen::MatrixXd x(final_.x.rows(), used);
  for (Eigen::Index c = 0; c < used; ++c) {
    x.col(c) = final_.x.col(posterior.columns[static_cast<std::size_t>(c)]);
  }
  const Eigen::VectorXd leverage = (x * posterior.covariance).cwiseProduct(x).rowwise().sum();
  std::vector<double> freedom;
  for (const double h : leverage) {
    freedom.push_back(std::clamp(1 - h, 0.0, 1.0));
  }
  return freedom;
}

double EvidenceSearch::changing_nats(const std::string& effect) const {
  const Fit& fit = best();
  if (blocks_.empty() || !in_catalogue(fit.scatter)) {
    return 0;
  }
  std::vector<int> all = {0, 1};
  all.insert(all.end(), fit.subset.groups.begin(), fit.subset.groups.end());
  const auto at = std::find_if(all.begin(), all.end(), [&](int g) {
    return groups_[static_cast<std::size_t>(g)].effect == effect;
  });
  if (at == all.end()) {
    return 0;
  }
  const ParameterGroup& group = groups_[static_cast<std::size_t>(*at)];
  // Scatter could stand for the change: then the comparison is with none beside it.
  const Whitened w = whiten(linear_best_, Scatter::nominal, 0);
  Posterior posterior;
  const double without = evidence(w, fit.subset.groups, &posterior) + log_prior(fit.subset.groups);
  const double first_s = blocks_.front().middle_s;
  const double half_s = std::max(1.0, (blocks_.back().middle_s - first_s) / 2);
  const Eigen::Index count = std::min(3, group.count);
  // Placements are whitened apart, and short against the recording: a column of the change is the
  // effect's own, row by row times the time.
  Eigen::MatrixXd change(w.x.rows(), count);
  for (Eigen::Index row = 0; row < change.rows(); ++row) {
    const Block& block =
        blocks_[static_cast<std::size_t>(w.row_block[static_cast<std::size_t>(row)])];
    const double time = (block.middle_s - first_s) / half_s - 1;
    for (Eigen::Index i = 0; i < count; ++i) {
      change(row, i) = w.x(row, group_column_[static_cast<std::size_t>(*at)] + i) * time;
    }
  }
  Eigen::MatrixXd used(w.x.rows(), posterior.mean.size());
  for (std::size_t c = 0; c < posterior.columns.size(); ++c) {
    used.col(static_cast<Eigen::Index>(c)) = w.x.col(posterior.columns[c]);
  }
  const Eigen::VectorXd residual = w.y - used * posterior.mean;
  const Eigen::MatrixXd cross = used.transpose() * change;
  Eigen::MatrixXd a =
      change.transpose() * change - cross.transpose() * posterior.covariance * cross;
  const Eigen::VectorXd b = change.transpose() * residual;
  // As much change as a small effect has size; gains by a thousandth.
  const double sd = group.effect == "gain" ? 1e-3 : 0.5 * group.prior_sd;
  a.diagonal().array() += 1 / (sd * sd);
  const Eigen::LLT<Eigen::MatrixXd> llt(a);
  return without - (fit.scatter == Scatter::nominal ? without : fit.nats) +
         0.5 * b.dot(llt.solve(b)) - llt.matrixLLT().diagonal().array().log().sum() -
         static_cast<double>(count) * std::log(sd);
}

}  // namespace sixpoint::gap

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "gap/explain/explanation.h"

namespace sixpoint::gap {

double Explanation::gain_nats(const std::string& effect, bool known_only) const {
  const std::vector<int> own = model_.groups_of(effect);
  double with = kNoEvidence_nats;
  double without = kNoEvidence_nats;
  for (const Tried& tried : tried_) {
    if (known_only && !in_catalogue(tried.scatter)) {
      continue;
    }
    const std::vector<int>& groups = tried.subset.groups;
    const bool has =
        to_string(tried.scatter) == effect ||
        std::find_first_of(groups.begin(), groups.end(), own.begin(), own.end()) != groups.end();
    double& best = has ? with : without;
    best = std::max(best, tried.subset.nats);
  }
  return with == kNoEvidence_nats || without == kNoEvidence_nats ? 0 : with - without;
}

std::optional<Explanation::Estimate> Explanation::estimate(const std::string& effect) const {
  std::vector<int> groups = best().subset.groups;
  int chosen = -1;
  double most = kNoEvidence_nats;
  for (const int g : model_.groups_of(effect)) {
    if (std::find(groups.begin(), groups.end(), g) != groups.end()) {
      chosen = g;
      break;
    }
    // Not in the explanation: the likeliest shape beside it.
    if (const double nats = model_.evidence(data_, with_group(groups, g)); nats > most) {
      most = nats;
      chosen = g;
    }
  }
  if (chosen < 0) {
    return std::nullopt;
  }
  if (std::find(groups.begin(), groups.end(), chosen) == groups.end()) {
    groups = with_group(groups, chosen);
  }
  Posterior posterior;
  model_.evidence(data_, groups, &posterior);
  const ParameterGroup& group = model_.group(chosen);
  Estimate estimate{{}, {}, group.tau_s};
  for (std::size_t k = 0; k < posterior.columns.size(); ++k) {
    const int c = posterior.columns[k] - model_.first_column(chosen);
    if (c >= 0 && c < std::min(3, group.count)) {
      const auto i = static_cast<Eigen::Index>(k);
      estimate.value.push_back(posterior.mean[i]);
      estimate.sd.push_back(std::sqrt(posterior.covariance(i, i)));
    }
  }
  return estimate;
}

double Explanation::undetermined(const std::string& effect) const {
  std::optional<double> least;  // the best determined shape counts
  for (const int g : model_.groups_of(effect)) {
    Posterior posterior;
    model_.evidence(data_, {g}, &posterior);
    double worst = 0;
    for (Eigen::Index i = kNuisanceParameters;
         i < std::min<Eigen::Index>(kNuisanceParameters + 3, posterior.mean.size()); ++i) {
      worst = std::max(worst, std::sqrt(posterior.covariance(i, i)) / model_.group(g).prior_sd);
    }
    least = std::min(least.value_or(worst), worst);
  }
  return least.value_or(1);
}

double Explanation::expected_nats(const std::string& effect) const {
  // One axis has the size, the others a uniform share of it: mean square a third.
  constexpr double kOthers = 1.0 / 3;
  double best = kNoEvidence_nats;
  for (const int g : model_.groups_of(effect)) {
    const ParameterGroup& group = model_.group(g);
    if (group.smallest == 0) {
      continue;
    }
    Posterior posterior;
    model_.evidence(data_, {g}, &posterior);
    double square = 0;
    double occam = 0;
    for (Eigen::Index i = 0; i < std::min(3, group.count); ++i) {
      const double variance =
          posterior.covariance(kNuisanceParameters + i, kNuisanceParameters + i);
      const double prior2 = group.prior_sd * group.prior_sd;
      const double left = std::min(variance, prior2 * (1 - 1e-9));
      // What the data alone say: posterior less prior precision.
      const double information = 1 / left - 1 / prior2;
      square += group.smallest * group.smallest * information * (i == 0 ? 1 : kOthers);
      occam += 0.5 * std::log(prior2 / left);
    }
    best = std::max(best, 0.5 * square - occam + model_.log_prior({g}));
  }
  return best == kNoEvidence_nats ? -kNoEvidence_nats : best;
}

std::vector<double> Explanation::row_freedom() const {
  const Posterior& posterior = best().posterior;
  const Eigen::MatrixXd x = used_columns(data_.x, posterior);
  const Eigen::VectorXd leverage = (x * posterior.covariance).cwiseProduct(x).rowwise().sum();
  std::vector<double> freedom;
  for (const double h : leverage) {
    freedom.push_back(std::clamp(1 - h, 0.0, 1.0));
  }
  return freedom;
}

double Explanation::changing_nats(const std::string& effect) const {
  // Prior size of a change: half an effect's, a thousandth of a gain (conventions).
  constexpr double kChangeOfEffect = 0.5;
  constexpr double kChangeOfGain = 1e-3;
  const Fit& fit = best();
  const std::vector<Block>& blocks = model_.blocks();
  const std::vector<int> own = model_.groups_of(effect);
  const std::vector<int> all = with_nuisances(fit.subset.groups);
  const auto at = std::find_first_of(all.begin(), all.end(), own.begin(), own.end());
  if (blocks.empty() || !in_catalogue(fit.scatter) || at == all.end()) {
    return 0;
  }
  const ParameterGroup& group = model_.group(*at);
  // Scatter could stand for the change: it is compared with no scatter beside the change.
  const Whitened w = model_.whiten(linear_, Scatter::nominal, 0);
  Posterior posterior;
  const double without =
      model_.evidence(w, fit.subset.groups, &posterior) + model_.log_prior(fit.subset.groups);
  const double first_s = blocks.front().middle_s;
  const double half_s = std::max(1.0, (blocks.back().middle_s - first_s) / 2);
  // Placements are whitened one by one, and short against the recording: a column of the change is
  // the effect's own, row by row times the time.
  Eigen::MatrixXd change = w.x.middleCols(model_.first_column(*at), std::min(3, group.count));
  for (Eigen::Index row = 0; row < change.rows(); ++row) {
    change.row(row) *= (model_.block_of_row(row).middle_s - first_s) / half_s - 1;
  }
  const Eigen::MatrixXd used = used_columns(w.x, posterior);
  const Eigen::VectorXd residual = w.y - used * posterior.mean;
  const Eigen::MatrixXd cross = used.transpose() * change;
  Eigen::MatrixXd a =
      change.transpose() * change - cross.transpose() * posterior.covariance * cross;
  const Eigen::VectorXd b = change.transpose() * residual;
  const double sd = group.effect == "gain" ? kChangeOfGain : kChangeOfEffect * group.prior_sd;
  a.diagonal().array() += 1 / (sd * sd);
  const Eigen::LLT<Eigen::MatrixXd> llt(a);
  return without - (fit.scatter == Scatter::nominal ? without : fit.nats) +
         0.5 * b.dot(llt.solve(b)) - half_log_determinant(llt) -
         static_cast<double>(change.cols()) * std::log(sd);
}

}  // namespace sixpoint::gap

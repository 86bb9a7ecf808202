#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <set>

#include "gap/explain/evidence.h"

namespace sixpoint::gap {
namespace {

// Conventions of the search. With them `gap challenge` (seeds 2031 and 2032) finds pairs of effects
// with an F1 of 0.98 to 0.99.
constexpr std::size_t kMostEffects = 5;
constexpr std::size_t kBeamOfPairs = 6;  // subsets that grow to three effects
constexpr std::size_t kBeam = 4;         // and further
constexpr double kLeastGain_nats = 0.5;  // of one more effect, for the search to go on

// An estimate is another thing where it lies beyond the effect's largest size by this factor, by
// more than three standard deviations.
constexpr double kBeyondLargest = 4;
constexpr double kBeyondCurve = 10;
constexpr double kBeyond_sd = 3;
constexpr double kImpossible_nats = 1e6;

double most_of(const ParameterGroup& group, int i) {
  return i >= 3 && group.curve_sd > 0
             ? kBeyondCurve * group.curve_sd
             : (group.effect == "truncation" ? 1 : kBeyondLargest) * group.largest;
}

}  // namespace

double EvidenceModel::evidence_of(const NormalSums& sums, const std::vector<int>& groups,
                                  Posterior* posterior) const {
  std::vector<int> columns;
  std::vector<double> sds, means;
  for (const int g : with_nuisances(groups)) {
    for (int k = 0; k < group(g).count; ++k) {
      columns.push_back(first_column(g) + k);
      sds.push_back(group(g).sd_of(k));
      means.push_back(group(g).prior_mean);
    }
  }
  const auto n = std::ssize(columns);
  const Eigen::VectorXd sd = Eigen::Map<const Eigen::VectorXd>(sds.data(), n);
  const Eigen::VectorXd mu = Eigen::Map<const Eigen::VectorXd>(means.data(), n);
  Eigen::MatrixXd m = sums.a(columns, columns);
  Eigen::VectorXd v = sums.b(columns);
  const double square = sums.yy - 2 * mu.dot(v) + mu.dot(m * mu);
  v -= m * mu;
  // In units of the prior's standard deviations.
  for (Eigen::Index i = 0; i < n; ++i) {
    v[i] *= sd[i];
    for (Eigen::Index j = 0; j < n; ++j) {
      m(i, j) *= sd[i] * sd[j];
    }
  }
  m.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> llt(m);
  const Eigen::VectorXd z = llt.solve(v);
  if (posterior != nullptr) {
    posterior->covariance = llt.solve(Eigen::MatrixXd::Identity(n, n));
    posterior->mean.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      posterior->mean[i] = mu[i] + sd[i] * z[i];
      for (Eigen::Index j = 0; j < n; ++j) {
        posterior->covariance(i, j) *= sd[i] * sd[j];
      }
    }
    posterior->columns = std::move(columns);
  }
  return -half_log_determinant(llt) + 0.5 * v.dot(z) - 0.5 * square;
}

double EvidenceModel::evidence(const Whitened& w, const std::vector<int>& groups,
                               Posterior* posterior) const {
  Posterior own;
  double nats = evidence_of(w.sums, groups, &own) - w.half_log_det + w.outside_nats;
  Eigen::Index at = kNuisanceParameters;
  for (const int g : groups) {
    for (int i = 0; i < group(g).count; ++i, ++at) {
      const double off = std::abs(own.mean[at] - group(g).prior_mean);
      if (off - kBeyond_sd * std::sqrt(own.covariance(at, at)) > most_of(group(g), i)) {
        nats -= kImpossible_nats;
      }
    }
  }
  if (posterior != nullptr) {
    *posterior = std::move(own);
  }
  return nats;
}

double EvidenceModel::log_prior(const std::vector<int>& groups) const {
  double sum = 0;
  for (const int g : groups) {
    // The shapes of an effect share its prior.
    sum += kLogPriorEffect - std::log(static_cast<double>(groups_of(group(g).effect).size()));
  }
  return sum;
}

Subset EvidenceModel::search(const Whitened& w, std::vector<Subset>& tried) const {
  const auto attempt = [&](std::vector<int> groups) {
    const double nats = evidence(w, groups) + log_prior(groups);
    tried.push_back({std::move(groups), nats});
    return tried.back();
  };
  const auto fits = [&](const std::vector<int>& groups, int g) {
    return std::none_of(groups.begin(), groups.end(),
                        [&](int have) { return group(have).effect == group(g).effect; });
  };
  const auto better = [](const Subset& a, const Subset& b) { return a.nats > b.nats; };
  // All singles and pairs; larger subsets grow from the best few.
  std::vector<Subset> beam = {attempt({})};
  for (int g = kNuisances; g < group_count(); ++g) {
    beam.push_back(attempt({g}));
    for (int h = g + 1; h < group_count(); ++h) {
      if (fits({g}, h)) {
        beam.push_back(attempt({g, h}));
      }
    }
  }
  std::sort(beam.begin(), beam.end(), better);
  Subset best = beam.front();
  beam.resize(std::min(beam.size(), kBeamOfPairs));
  std::set<std::vector<int>> seen;
  for (std::size_t size = 3; size <= kMostEffects; ++size) {
    std::vector<Subset> next;
    for (const Subset& from : beam) {
      for (int g = kNuisances; g < group_count() && from.groups.size() < kMostEffects; ++g) {
        if (fits(from.groups, g)) {
          std::vector<int> grown = with_group(from.groups, g);
          if (seen.insert(grown).second) {
            next.push_back(attempt(std::move(grown)));
          }
        }
      }
    }
    std::sort(next.begin(), next.end(), better);
    const double before_nats = best.nats;
    if (!next.empty() && next.front().nats > before_nats) {
      best = next.front();
    }
    if (next.empty() || next.front().nats < before_nats + kLeastGain_nats) {
      break;
    }
    next.resize(std::min(next.size(), kBeam));
    beam = std::move(next);
  }
  return best;
}

Fit EvidenceModel::make_fit(const Whitened& w, const Subset& subset, const ForwardState& at) const {
  Fit fit;
  fit.subset = subset;
  fit.scatter = w.scatter;
  fit.scatter_size = w.size;
  fit.nats = subset.nats;
  evidence(w, subset.groups, &fit.posterior);
  fit.state = at;
  for (int p = kNuisanceParameters; p < kForwardParameters; ++p) {
    parameter(fit.state, p) = 0;
  }
  Eigen::Index i = 0;
  for (const int g : with_nuisances(subset.groups)) {
    for (int k = 0; k < group(g).count; ++k, ++i) {
      parameter(fit.state, group(g).first + k) = fit.posterior.mean[i];
    }
    if (group(g).effect == "warm_up") {
      fit.state.warm_up_tau_s = group(g).tau_s;
    }
    if (group(g).effect == "hysteresis") {
      fit.state.hysteresis_shape = group(g).shape;
    }
    if (g >= kNuisances) {
      fit.groups.push_back(group(g));
    }
  }
  fit.residual = residual_of(w, fit.posterior);
  return fit;
}

}  // namespace sixpoint::gap

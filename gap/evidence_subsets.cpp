#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "gap/evidence.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kLargest = 5;  // effects at once in this model

}  // namespace

double EvidenceSearch::evidence_of(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double yy,
                                   const std::vector<int>& groups, Posterior* posterior) const {
  std::array<int, 40> columns{};
  std::array<double, 40> sd{};
  std::array<double, 40> mean{};
  int n = 0;
  const auto add = [&](int g) {
    const auto& group = groups_[static_cast<std::size_t>(g)];
    const auto& own = columns_of_[static_cast<std::size_t>(g)];
    for (std::size_t k = 0; k < own.size(); ++k) {
      columns[static_cast<std::size_t>(n)] = own[k];
      sd[static_cast<std::size_t>(n)] = group.sd_of(static_cast<int>(k));
      mean[static_cast<std::size_t>(n)] = group.prior_mean;
      ++n;
    }
  };
  for (int g = 0; g < kNuisances; ++g) {
    add(g);
  }
  for (const int g : groups) {
    add(g);
  }
  Eigen::MatrixXd m(n, n);
  Eigen::VectorXd v(n);
  Eigen::VectorXd mu(n);
  for (int i = 0; i < n; ++i) {
    mu[i] = mean[static_cast<std::size_t>(i)];
    v[i] = b[columns[static_cast<std::size_t>(i)]];
    for (int j = 0; j < n; ++j) {
      m(i, j) = a(columns[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]);
    }
  }
  const double square = yy - 2 * mu.dot(v) + mu.dot(m * mu);
  v -= m * mu;
  for (int i = 0; i < n; ++i) {
    v[i] *= sd[static_cast<std::size_t>(i)];
    for (int j = 0; j < n; ++j) {
      m(i, j) *= sd[static_cast<std::size_t>(i)] * sd[static_cast<std::size_t>(j)];
    }
  }
  m.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> llt(m);
  const Eigen::VectorXd z = llt.solve(v);
  if (posterior != nullptr) {
    posterior->columns.assign(columns.begin(), columns.begin() + n);
    posterior->mean.resize(n);
    posterior->covariance = llt.solve(Eigen::MatrixXd::Identity(n, n));
    for (int i = 0; i < n; ++i) {
      posterior->mean[i] = mu[i] + sd[static_cast<std::size_t>(i)] * z[i];
      for (int j = 0; j < n; ++j) {
        posterior->covariance(i, j) *=
            sd[static_cast<std::size_t>(i)] * sd[static_cast<std::size_t>(j)];
      }
    }
  }
  return -llt.matrixLLT().diagonal().array().log().sum() + 0.5 * v.dot(z) - 0.5 * square;
}

double EvidenceSearch::evidence(const Whitened& w, const std::vector<int>& groups,
                                Posterior* posterior) const {
  Posterior own;
  double nats = evidence_of(w.a, w.b, w.yy, groups, &own) - w.half_log_det + w.outside_nats;
  // An estimate far outside what the effect can be is another thing.
  Eigen::Index at = 6;
  for (const int g : groups) {
    const ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
    for (int i = 0; i < group.count; ++i, ++at) {
      const double off = std::abs(own.mean[at] - group.prior_mean);
      const double sd = std::sqrt(own.covariance(at, at));
      const double high = i >= 3 && group.curve_sd > 0
                              ? 10 * group.curve_sd
                              : (group.effect == "truncation" ? 1 : 4) * group.high;
      if (off - 3 * sd > high) {
        nats -= 1e6;
      }
    }
  }
  if (posterior != nullptr) {
    *posterior = std::move(own);
  }
  return nats;
}

double EvidenceSearch::log_prior(const std::vector<int>& groups) const {
  double sum = 0;
  for (const int g : groups) {
    const std::string& effect = groups_[static_cast<std::size_t>(g)].effect;
    const auto shapes =
        std::count_if(groups_.begin(), groups_.end(),
                      [&](const ParameterGroup& other) { return other.effect == effect; });
    sum += options_.log_prior_effect - std::log(static_cast<double>(shapes));
  }
  return sum;
}

Subset EvidenceSearch::search(const Whitened& w, std::vector<Subset>& looked_at) const {
  const int count = static_cast<int>(groups_.size());
  const auto judge = [&](const std::vector<int>& groups) {
    Subset subset;
    subset.groups = groups;
    subset.nats = evidence(w, groups, nullptr) + log_prior(groups);
    looked_at.push_back(subset);
    return subset;
  };
  const auto fits = [&](const std::vector<int>& groups, int g) {
    return std::none_of(groups.begin(), groups.end(), [&](int have) {
      return groups_[static_cast<std::size_t>(have)].effect ==
             groups_[static_cast<std::size_t>(g)].effect;
    });
  };
  const std::vector<int> nothing;
  Subset best = judge(nothing);
  // All singles and pairs exactly; larger ones from the best few.
  std::vector<Subset> beam = {best};
  for (int g = kNuisances; g < count; ++g) {
    beam.push_back(judge({g}));
    for (int h = g + 1; h < count; ++h) {
      if (fits({g}, h)) {
        beam.push_back(judge({g, h}));
      }
    }
  }
  const auto better = [](const Subset& a, const Subset& b) { return a.nats > b.nats; };
  std::sort(beam.begin(), beam.end(), better);
  best = beam.front();
  beam.resize(std::min<std::size_t>(beam.size(), 6));
  std::set<std::vector<int>> seen;
  for (std::size_t size = 3; size <= kLargest; ++size) {
    std::vector<Subset> next;
    for (const Subset& from : beam) {
      for (int g = kNuisances; g < count && from.groups.size() < kLargest; ++g) {
        if (!fits(from.groups, g)) {
          continue;
        }
        std::vector<int> grown = from.groups;
        grown.insert(std::upper_bound(grown.begin(), grown.end(), g), g);
        if (seen.insert(grown).second) {
          next.push_back(judge(grown));
        }
      }
    }
    std::sort(next.begin(), next.end(), better);
    if (next.empty() || next.front().nats < best.nats + 0.5) {
      if (!next.empty() && next.front().nats > best.nats) {
        best = next.front();
      }
      break;
    }
    best = next.front();
    beam.assign(next.begin(),
                next.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, next.size())));
  }
  return best;
}

Fit EvidenceSearch::make_fit(const Whitened& w, const Subset& subset,
                             const ForwardState& at) const {
  Fit fit;
  fit.subset = subset;
  fit.scatter = w.scatter;
  fit.scatter_size = w.size;
  fit.nats = subset.nats;
  evidence(w, subset.groups, &fit.posterior);
  fit.state = at;
  for (int p = 6; p < kForwardParameters; ++p) {
    parameter(fit.state, p) = 0;
  }
  std::vector<int> all = {0, 1};
  all.insert(all.end(), subset.groups.begin(), subset.groups.end());
  Eigen::Index i = 0;
  for (const int g : all) {
    const ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
    for (int k = 0; k < group.count; ++k, ++i) {
      parameter(fit.state, group.first + k) = fit.posterior.mean[i];
    }
    if (group.effect == "warm_up") {
      fit.state.warm_up_tau_s = group.tau_s;
    }
    if (group.effect == "hysteresis") {
      fit.state.hysteresis_shape = group.shape;
    }
    if (g >= kNuisances) {
      fit.groups.push_back(group);
    }
  }
  fit.residual = w.y;
  for (std::size_t k = 0; k < fit.posterior.columns.size(); ++k) {
    fit.residual -=
        w.x.col(fit.posterior.columns[k]) * fit.posterior.mean[static_cast<Eigen::Index>(k)];
  }
  fit.row_block = w.row_block;
  return fit;
}

}  // namespace sixpoint::gap

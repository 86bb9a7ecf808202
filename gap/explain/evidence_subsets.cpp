#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "gap/explain/evidence.h"

namespace sixpoint::gap {
namespace {

// Conventions of the search. With them `gap challenge` (seeds 2031 and 2032) finds pairs of effects
// with an F1 of 0.98 to 0.99.
constexpr std::size_t kMostEffects = 12;
constexpr std::size_t kMostInBeam = 5;
constexpr std::size_t kBeamOfPairs = 6;  // subsets that grow to three effects
constexpr std::size_t kBeam = 4;         // and further
constexpr double kLeastGain_nats = 0.5;  // of one more effect, for the search to go on
constexpr double kClimb_nats = 1e-6;     // of one step: less is rounding

// An estimate is another thing where it lies beyond the effect's largest size by this factor, by
// more than three standard deviations.
constexpr double kBeyondLargest = 4;
constexpr double kBeyondCurve = 10;
constexpr double kBeyond_sd = 3;
constexpr double kImpossible_nats = 1e6;

double most_of(const ParameterGroup& group, int i) {
  return i >= 3 ? kBeyondCurve * group.sd_of(i)
                : (group.effect == "truncation" ? 1 : kBeyondLargest) * group.largest;
}

}  // namespace

Solution EvidenceModel::solve(const NormalSums& sums, const std::vector<int>& groups) const {
  Solution solved;
  std::vector<double> sds, means;
  for (const int g : with_nuisances(groups)) {
    for (int k = 0; k < group(g).count; ++k) {
      solved.columns.push_back(first_column(g) + k);
      sds.push_back(group(g).sd_of(k));
      means.push_back(group(g).mean_of(k));
    }
  }
  const auto n = std::ssize(solved.columns);
  solved.sd = Eigen::Map<const Eigen::VectorXd>(sds.data(), n);
  const Eigen::VectorXd& sd = solved.sd;
  const Eigen::VectorXd mu = Eigen::Map<const Eigen::VectorXd>(means.data(), n);
  Eigen::MatrixXd m = sums.a(solved.columns, solved.columns);
  Eigen::VectorXd v = sums.b(solved.columns);
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
  solved.normal.compute(m);
  const Eigen::VectorXd z = solved.normal.solve(v);
  solved.mean = mu + sd.cwiseProduct(z);
  solved.nats = -half_log_determinant(solved.normal) + 0.5 * v.dot(z) - 0.5 * square;
  return solved;
}

Posterior Solution::posterior() const {
  const auto n = std::ssize(columns);
  return {mean, sd.asDiagonal() * normal.solve(Eigen::MatrixXd::Identity(n, n)) * sd.asDiagonal(),
          columns};
}

double EvidenceModel::evidence(const Whitened& w, const std::vector<int>& groups,
                               Posterior* posterior) const {
  const Solution solved = solve(w.sums, groups);
  double nats = solved.nats - w.half_log_det + w.outside_nats;
  // The covariance costs six times the solution, and nearly no estimate is far beyond its largest
  // size.
  std::optional<Posterior> own;
  Eigen::Index at = kNuisanceParameters;
  for (const int g : groups) {
    for (int i = 0; i < group(g).count; ++i, ++at) {
      const double beyond = std::abs(solved.mean[at] - group(g).mean_of(i)) - most_of(group(g), i);
      if (beyond > 0 && !own) {
        own = solved.posterior();
      }
      if (beyond > 0 && beyond > kBeyond_sd * std::sqrt(own->covariance(at, at))) {
        nats -= kImpossible_nats;
      }
    }
  }
  if (posterior != nullptr) {
    *posterior = own ? *std::move(own) : solved.posterior();
  }
  return nats;
}

double log_prior_of_count(std::size_t count) {
  // Of the sixteen effects of the means and kinds of scatter, per unit of either sort.
  constexpr double kEffects = 16;
  static const double kEven = std::log(kShareOfRealUnits) - kEffects * std::log(2.0);
  static const double kFew =
      std::log(1 - kShareOfRealUnits) - kEffects * std::log1p(std::exp(kLogPriorEffect));
  const auto log_sum = [](double few, double real) {
    return std::max(few, real) + std::log1p(std::exp(-std::abs(few - real)));
  };
  return log_sum(kFew + static_cast<double>(count) * kLogPriorEffect, kEven) - log_sum(kFew, kEven);
}

std::size_t EvidenceModel::counted(const std::vector<int>& groups, Scatter scatter,
                                   double seats_deg) const {
  const auto effects =
      std::count_if(groups.begin(), groups.end(), [&](int g) { return !group(g).learnt; });
  const bool also_scatter = scatter != Scatter::nominal && in_catalogue(scatter);
  return static_cast<std::size_t>(effects) + (also_scatter ? 1 : 0) + (seats_deg > 0 ? 1 : 0);
}

double EvidenceModel::log_prior(const std::vector<int>& groups, Scatter scatter,
                                double seats_deg) const {
  // The scatter's own prior is in Whitened::outside_nats already.
  const auto scatters = static_cast<double>(counted({}, scatter, seats_deg));
  double sum = log_prior_of_count(counted(groups, scatter, seats_deg)) - scatters * kLogPriorEffect;
  for (const int g : groups) {
    const std::vector<int> same = groups_of(group(g).effect);
    // The shapes of an effect share its prior.
    sum -= std::log(static_cast<double>(std::count_if(same.begin(), same.end(), [&](int other) {
      return group(other).learnt.has_value() == group(g).learnt.has_value();
    })));
    sum += group(g).learnt ? learnt_log_prior(*group(g).learnt) : 0;
  }
  return sum;
}

Subset EvidenceModel::attempt(const Whitened& w, std::vector<int> groups,
                              std::vector<Subset>& tried) const {
  const double nats = evidence(w, groups) + log_prior(groups, w.scatter, w.seats_deg);
  tried.push_back({std::move(groups), nats});
  return tried.back();
}

// One group of an effect at most.
bool EvidenceModel::fits(const std::vector<int>& groups, int g) const {
  return std::none_of(groups.begin(), groups.end(),
                      [&](int have) { return group(have).effect == group(g).effect; });
}

// From one subset to the likeliest neighbour until none is likelier: one group more, one less, or
// another shape of the same effect; with `swap`, another effect in the place of one. `generous`: as
// if the unit were known to have a little of everything, so that many small effects, each too small
// to begin with, are found together.
Subset EvidenceModel::climb(const Whitened& w, Subset from, bool generous, bool swap,
                            std::vector<Subset>& tried) const {
  const auto height = [&](const Subset& s) {
    return s.nats - (generous ? log_prior_of_count(counted(s.groups, w.scatter, w.seats_deg)) : 0);
  };
  for (;;) {
    Subset best = from;
    const auto consider = [&](std::vector<int> groups) {
      const Subset tested = attempt(w, std::move(groups), tried);
      if (height(tested) > height(best) + kClimb_nats) {
        best = tested;
      }
    };
    for (int g = kNuisances; g < group_count(); ++g) {
      if (from.groups.size() < kMostEffects && fits(from.groups, g)) {
        consider(with_group(from.groups, g));
      }
    }
    for (std::size_t i = 0; i < from.groups.size(); ++i) {
      std::vector<int> less = from.groups;
      less.erase(less.begin() + static_cast<std::ptrdiff_t>(i));
      consider(less);
      for (int g = kNuisances; g < group_count(); ++g) {
        const bool shape = group(g).effect == group(from.groups[i]).effect;
        if (g != from.groups[i] && (swap || shape) && fits(less, g)) {
          consider(with_group(less, g));
        }
      }
    }
    if (best.groups == from.groups) {
      return from;
    }
    from = best;
  }
}

Subset EvidenceModel::search(const Whitened& w, std::vector<Subset>& tried, bool swap) const {
  const auto better = [](const Subset& a, const Subset& b) { return a.nats > b.nats; };
  // All singles and pairs; larger subsets grow from the best few. Faint sizes wait for that: they
  // would double the pairs, and are seldom what makes a pair likely.
  std::vector<Subset> beam = {attempt(w, {}, tried)};
  for (int g = kNuisances; g < group_count(); ++g) {
    beam.push_back(attempt(w, {g}, tried));
    for (int h = g + 1; h < group_count(); ++h) {
      if (!group(g).faint && !group(h).faint && fits({g}, h)) {
        beam.push_back(attempt(w, {g, h}, tried));
      }
    }
  }
  std::sort(beam.begin(), beam.end(), better);
  Subset best = beam.front();
  beam.resize(std::min(beam.size(), kBeamOfPairs));
  std::set<std::vector<int>> seen;
  for (std::size_t size = 3; size <= kMostInBeam; ++size) {
    std::vector<Subset> next;
    for (const Subset& from : beam) {
      for (int g = kNuisances; g < group_count() && from.groups.size() < kMostInBeam; ++g) {
        if (fits(from.groups, g)) {
          std::vector<int> grown = with_group(from.groups, g);
          if (seen.insert(grown).second) {
            next.push_back(attempt(w, std::move(grown), tried));
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
  const Subset few = climb(w, best, false, swap, tried);
  const Subset many = climb(w, climb(w, few, true, false, tried), false, swap, tried);
  return many.nats > few.nats ? many : few;
}

Fit EvidenceModel::make_fit(const Whitened& w, const Subset& subset, const ForwardState& at) const {
  Fit fit;
  fit.subset = subset;
  fit.scatter = w.scatter;
  fit.scatter_size = w.size;
  fit.seats_deg = w.seats_deg;
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

double EvidenceModel::freedom_of(const Fit& fit) const {
  double freedom = rows();
  Eigen::Index at = 0;
  for (const int g : with_nuisances(fit.subset.groups)) {
    for (int i = 0; i < group(g).count; ++i, ++at) {
      freedom -= 1 - fit.posterior.covariance(at, at) / std::pow(group(g).sd_of(i), 2);
    }
  }
  return freedom;
}

}  // namespace sixpoint::gap

#include "gap/explain/explanation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace sixpoint::gap {
namespace {

// Relinearisations about the best explanation; the subset settles in two.
constexpr int kLeastRounds = 3;
constexpr int kMostRounds = 4;
// Scatter is tried if chi-square lies so far above its freedom, or the records show slow noise. At
// 1.5 a bad seat of nominal size was hardly ever seen; without a limit a bundle takes a third
// longer.
constexpr double kScatters_sd = 0.5;
constexpr double kRecordsShow_nats = 3;  // log 20
// Sizes of scatter are tried until the evidence has fallen so many times in a row.
constexpr int kFalls = 2;

// Time constants of warm_up that are tried, and the factor between neighbours at first.
constexpr double kLeastTau_s = 20;
constexpr double kMostTau_s = 2000;
constexpr double kTauFactor = 1.25;

double chi_sd(const EvidenceModel& model, const Fit& fit) {
  const double n = model.freedom_of(fit);
  return n > 0 ? (fit.residual.squaredNorm() - n) / std::sqrt(2 * n) : 0;
}

// The likeliest time constant near that of group g. It is no linear parameter: it is searched.
double best_time_constant(EvidenceModel model, const Fit& fit, int g) {
  double chosen = model.group(g).tau_s;
  double factor = kTauFactor;
  double best = kNoEvidence_nats;
  for (int round = 0; round < 4; ++round) {
    const double centre = chosen;
    for (const double scale : {1 / factor, 1.0, factor}) {
      ForwardState at = fit.state;
      at.warm_up_tau_s = std::clamp(centre * scale, kLeastTau_s, kMostTau_s);
      model.set_time_constant(g, at.warm_up_tau_s);
      const double nats =
          model.evidence(model.whiten(model.linearise(at), Scatter::nominal, 0), fit.subset.groups);
      if (nats > best) {
        best = nats;
        chosen = at.warm_up_tau_s;
      }
    }
    if (chosen == centre) {
      factor = std::sqrt(factor);
    }
  }
  return chosen;
}

// Where evidence over the logarithm of the size has its maximum, by a parabola through the best of
// the sizes that were tried and its neighbours. `tried`: size and nats, at least one.
std::optional<double> likeliest_size(std::vector<std::array<double, 2>> tried) {
  std::sort(tried.begin(), tried.end());
  for (std::size_t i = 1; i + 1 < tried.size(); ++i) {
    if (tried[i][1] >= tried[i - 1][1] && tried[i][1] >= tried[i + 1][1]) {
      const double a = std::log(tried[i][0] / tried[i - 1][0]);
      const double b = std::log(tried[i + 1][0] / tried[i][0]);
      const double down = (tried[i][1] - tried[i - 1][1]) / a;
      const double up = (tried[i + 1][1] - tried[i][1]) / b;
      if (down <= up) {
        return std::nullopt;
      }
      const double move = (down * b + up * a) / (down - up) / 2;
      return tried[i][0] * std::exp(std::clamp(move, -a, b));
    }
  }
  return std::nullopt;
}

// Sizes that are tried, one after another from `start` uphill; the likeliest. `nats_of` is not asked
// twice for one of them.
double likeliest_of(const std::vector<double>& sizes, double start,
                    const std::function<double(double)>& nats_of) {
  std::map<std::size_t, double> known;
  const auto nats = [&](std::size_t i) {
    const auto [at, is_new] = known.try_emplace(i, 0);
    return is_new ? at->second = nats_of(sizes[i]) : at->second;
  };
  const auto above = std::ranges::lower_bound(sizes, start) - sizes.begin();
  std::size_t best = std::min(static_cast<std::size_t>(above), sizes.size() - 1);
  for (;;) {
    const std::size_t before = best;
    for (const std::size_t next : {before - 1, before + 1}) {  // below 0: beyond the end
      if (next < sizes.size() && nats(next) > nats(best)) {
        best = next;
      }
    }
    if (best == before) {
      break;
    }
  }
  std::vector<std::array<double, 2>> tried;
  tried.reserve(known.size());
  for (const auto& [i, value] : known) {
    tried.push_back({sizes[i], value});
  }
  return likeliest_size(tried).value_or(sizes[best]);
}

}  // namespace

void Explanation::remember(const Whitened& data, const std::vector<Subset>& tried) {
  for (const Subset& subset : tried) {
    tried_.push_back({data.scatter, data.seats_deg > 0, subset});
  }
}

// Scatter nominal, relinearised about its own best explanation, which is returned.
ForwardState Explanation::explain_nominal() {
  ForwardState at = model_.first_guess();
  Fit fit;
  std::vector<Subset> tried;
  for (int round = 1; round <= kMostRounds; ++round) {
    data_ = model_.whiten(model_.linearise(at), Scatter::nominal, 0);
    tried.clear();
    const Fit next = model_.make_fit(data_, model_.search(data_, tried, round > 1), at);
    const bool settled = round > 1 && next.subset.groups == fit.subset.groups;
    fit = next;
    if (settled && round >= kLeastRounds) {
      break;
    }
    for (const int g : fit.subset.groups) {
      if (model_.group(g).effect == "warm_up") {
        fit.state.warm_up_tau_s = best_time_constant(model_, fit, g);
        model_.set_time_constant(g, fit.state.warm_up_tau_s);
      }
    }
    at = fit.state;
  }
  nominal_ = model_.make_fit(data_, {{}, model_.evidence(data_, {})}, fit.state);
  best_known_ = best_nominal_ = fit;
  remember(data_, tried);
  return fit.state;
}

bool Explanation::records_show_slow_noise() const {
  const auto& record_nats = model_.options().record_nats;
  for (const Scatter scatter : {Scatter::random_walk, Scatter::flicker}) {
    for (const double size : sizes_of(scatter)) {
      if (record_nats && record_nats(scatter, size) > kRecordsShow_nats) {
        return true;
      }
    }
  }
  return false;
}

// `linear`: about the first guess.
Explanation::Trial Explanation::explain_by(Scatter scatter, const Eigen::MatrixXd& linear) {
  Trial best;
  std::vector<std::array<double, 2>> sizes;  // size, nats
  const auto try_size = [&](double size) {
    Whitened data = model_.whiten(linear, scatter, size);
    std::vector<Subset> tried;
    const Subset subset = model_.search(data, tried);
    remember(data, tried);
    sizes.push_back({size, subset.nats});
    if (!best.fit || subset.nats > best.fit->nats) {
      best.fit = model_.make_fit(data, subset, model_.first_guess());
      best.data = std::move(data);
    }
    return subset.nats;
  };
  int falling = 0;
  double last = kNoEvidence_nats;
  for (const double size : sizes_of(scatter)) {
    const double nats = try_size(size);
    falling = nats < last ? falling + 1 : 0;
    last = nats;
    if (falling >= kFalls) {
      break;
    }
  }
  if (in_catalogue(scatter) && best.fit && best.fit->nats > best_known_.nats) {
    for (int round = 0; round < 2; ++round) {
      if (const std::optional<double> size = likeliest_size(sizes)) {
        try_size(*size);
      }
    }
  }
  return best;
}

// Bad seats beside a slow noise. The records inside the dwells say best how large the noise is, the
// placements how bad the seats are: each size is searched beside the other one, and the subset of
// effects beside both.
Explanation::Trial Explanation::explain_by_slow_noise_and_seats(Scatter slow,
                                                                const Eigen::MatrixXd& linear) {
  constexpr int kTurns = 2;
  constexpr double kMiddle_deg = 0.04;  // of the seats that are tried
  const std::vector<double> sizes = sizes_of(slow);
  const auto& record_nats = model_.options().record_nats;
  double size = *std::ranges::max_element(
      sizes, {}, [&](double tried) { return record_nats ? record_nats(slow, tried) : 0; });
  double seats_deg = kMiddle_deg;
  std::vector<int> groups = best_known_.subset.groups;
  Trial trial;
  for (int round = 0; round < kTurns; ++round) {
    seats_deg = likeliest_of(sizes_of(Scatter::seating), seats_deg, [&](double tried_deg) {
      return model_.evidence(model_.whiten(linear, slow, size, tried_deg), groups);
    });
    size = likeliest_of(sizes, size, [&](double tried) {
      return model_.evidence(model_.whiten(linear, slow, tried, seats_deg), groups);
    });
    trial.data = model_.whiten(linear, slow, size, seats_deg);
    std::vector<Subset> tried;
    const Subset subset = model_.search(trial.data, tried);
    remember(trial.data, tried);
    trial.fit = model_.make_fit(trial.data, subset, model_.first_guess());
    groups = subset.groups;
  }
  return trial;
}

// Puts the trial in the place of the best of its sort, if it is better.
void Explanation::compete(Scatter scatter, Trial trial, Whitened& unknown_data) {
  if (!trial.fit) {
    return;
  }
  if (!in_catalogue(scatter)) {
    if (!best_unknown_ || trial.fit->nats > best_unknown_->nats) {
      best_unknown_ = std::move(trial.fit);
      unknown_data = std::move(trial.data);
    }
  } else if (trial.fit->nats > best_known_.nats) {
    // Once more about its own estimate.
    const ForwardState& at = trial.fit->state;
    data_ =
        model_.whiten(model_.linearise(at), scatter, trial.fit->scatter_size, trial.fit->seats_deg);
    std::vector<Subset> tried;
    best_known_ = model_.make_fit(data_, model_.search(data_, tried, true), at);
    remember(data_, tried);
  }
}

Explanation::Explanation(const std::vector<Block>& blocks, EvidenceOptions options)
    : model_(blocks, std::move(options)) {
  const ForwardState nominal_at = explain_nominal();
  // Scatter can only help where the residuals scatter more than noise and seating do.
  if (chi_sd(model_, best_nominal_) >= kScatters_sd || records_show_slow_noise()) {
    const Eigen::MatrixXd linear = model_.linearise(model_.first_guess());
    Whitened unknown_data;
    const auto allowed = [&](Scatter scatter) {
      return !in_catalogue(scatter) || model_.allowed(std::string(to_string(scatter)));
    };
    for (const Scatter scatter :
         {Scatter::seating, Scatter::random_walk, Scatter::flicker, Scatter::by_pose,
          Scatter::by_placement, Scatter::by_session, Scatter::seat_walks, Scatter::by_temperature,
          Scatter::by_time, Scatter::by_time_fast}) {
      if (allowed(scatter)) {
        compete(scatter, explain_by(scatter, linear), unknown_data);
      }
    }
    const Scatter found = best_known_.scatter;
    for (const Scatter slow : {Scatter::random_walk, Scatter::flicker}) {
      if (allowed(slow) && allowed(Scatter::seating) &&
          (found == Scatter::random_walk || found == Scatter::flicker ||
           (found == Scatter::seating && records_show_slow_noise()))) {
        compete(slow, explain_by_slow_noise_and_seats(slow, linear), unknown_data);
      }
    }
    if (unknown_wins()) {
      data_ = std::move(unknown_data);
    }
    const Whitened plain = model_.whiten(model_.linearise(nominal_at), Scatter::nominal, 0);
    if (std::optional<Fit> stepped = fit_zero_step(model_, plain, nominal_at);
        stepped && (!best_unknown_ || stepped->nats > best_unknown_->nats)) {
      best_unknown_ = std::move(stepped);
      if (unknown_wins()) {
        data_ = plain;
      }
    }
  }
  linear_ = model_.linearise(best().state);
}

}  // namespace sixpoint::gap

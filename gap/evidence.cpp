#include "gap/evidence.h"

#include <algorithm>
#include <cmath>

namespace sixpoint::gap {

EvidenceSearch::EvidenceSearch(const std::vector<Block>& blocks, EvidenceOptions options)
    : blocks_(blocks), options_(std::move(options)) {
  for (const ParameterGroup& group : parameter_groups()) {
    if (group.effect == "gain" || group.effect == "offset" || !options_.allowed ||
        options_.allowed(group.effect)) {
      groups_.push_back(group);
    }
  }
  for (const ParameterGroup& group : groups_) {
    group_column_.push_back(columns_);
    std::vector<int> columns;
    columns.reserve(static_cast<std::size_t>(group.count));
    for (int i = 0; i < group.count; ++i) {
      columns.push_back(columns_++);
    }
    columns_of_.push_back(columns);
  }
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    rows_ += static_cast<int>(blocks[b].size());
    row_block_.insert(row_block_.end(), static_cast<std::size_t>(blocks[b].size()),
                      static_cast<int>(b));
  }
}

// Plain least squares of gain and offset from the means.
ForwardState EvidenceSearch::first_guess() const {
  ForwardState state;
  for (Eigen::Index a = 0; a < 3; ++a) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    for (const Block& block : blocks_) {
      const double f = 1000 * (block.rotation * block.gravity_lab_g)[a];
      n += 1;
      x += f;
      y += block.value_mg[a];
      xx += f * f;
      xy += f * block.value_mg[a];
    }
    // Weak pull to gain 1, so that one pose alone gives something finite.
    const double pull = 1e4;
    const double mean_x = n > 0 ? x / n : 0;
    const double mean_y = n > 0 ? y / n : 0;
    const double sxx = xx - n * mean_x * mean_x;
    const double sxy = xy - n * mean_x * mean_y;
    state.gain[a] = std::clamp((sxy + pull) / (sxx + pull), 0.2, 3.0);
    state.offset_mg[a] = mean_y - state.gain[a] * mean_x;
  }
  return state;
}

double EvidenceSearch::chi_sd(const Fit& fit) const {
  const double n = static_cast<double>(rows_) - static_cast<double>(fit.posterior.columns.size());
  return n > 0 ? (fit.residual.squaredNorm() - n) / std::sqrt(2 * n) : 0;
}

// A time constant is no linear parameter: the chosen shape of warm_up moves to its likeliest value.
void EvidenceSearch::polish_shapes(Fit& fit) {
  for (const int g : fit.subset.groups) {
    ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
    if (group.effect != "warm_up") {
      continue;
    }
    double step = 1.25;
    double best = -1e300;
    for (int round = 0; round < 4; ++round) {
      const double centre = group.tau_s;
      double chosen = centre;
      for (const double factor : {1 / step, 1.0, step}) {
        group.tau_s = std::clamp(centre * factor, 20.0, 2000.0);
        ForwardState at = fit.state;
        at.warm_up_tau_s = group.tau_s;
        const Whitened w = whiten(at, Scatter::nominal, 0);
        const double nats = evidence(w, fit.subset.groups, nullptr);
        if (nats > best) {
          best = nats;
          chosen = group.tau_s;
        }
      }
      group.tau_s = chosen;
      if (chosen == centre) {
        step = std::sqrt(step);
      }
    }
    fit.state.warm_up_tau_s = group.tau_s;
  }
}

void EvidenceSearch::run() {
  find_best();
  linear_best_ = linearise(best().state);
}

void EvidenceSearch::find_best() {
  ForwardState at = first_guess();
  // Nominal scatter first, relinearised about its own best explanation.
  Whitened w;
  Fit fit;
  std::vector<Subset> looked_at;
  for (int round = 0; round < 4; ++round) {
    w = whiten(at, Scatter::nominal, 0);
    looked_at.clear();
    const Subset subset = search(w, looked_at);
    const Fit next = make_fit(w, subset, at);
    const bool settled = round > 0 && next.subset.groups == fit.subset.groups;
    fit = next;
    if (settled && round >= 2) {
      break;
    }
    polish_shapes(fit);
    at = fit.state;
  }
  at = fit.state;
  Subset nothing;
  nothing.nats = evidence(w, nothing.groups, nullptr);
  nominal_ = make_fit(w, nothing, at);
  best_known_ = fit;
  best_nominal_ = fit;
  final_ = w;
  for (const Subset& s : looked_at) {
    states_.push_back({Scatter::nominal, 0, s});
  }
  const bool record_says = [&] {
    for (const Scatter s : {Scatter::random_walk, Scatter::flicker}) {
      for (const double size : sizes_of(s)) {
        if (options_.record_nats && options_.record_nats(s, size) > 3) {
          return true;
        }
      }
    }
    return false;
  }();
  // Scatter can only help where the residuals scatter more than they should.
  if (chi_sd(fit) < 1.5 && !record_says) {
    return;
  }
  const ForwardState nominal_at = at;
  const Eigen::MatrixXd linear = linearise(first_guess());
  Whitened final_unknown;
  for (const Scatter scatter : {Scatter::seating, Scatter::random_walk, Scatter::flicker,
                                Scatter::by_pose, Scatter::by_placement, Scatter::by_session,
                                Scatter::by_temperature, Scatter::by_time, Scatter::by_time_fast}) {
    if (in_catalogue(scatter) && options_.allowed &&
        !options_.allowed(std::string(to_string(scatter)))) {
      continue;
    }
    std::optional<Fit> best;
    std::optional<Whitened> best_w;
    const ForwardState here = first_guess();
    int falling = 0;
    double last = -1e300;
    std::vector<std::array<double, 2>> tried;  // size, nats
    const auto try_size = [&](double size) {
      Whitened trial = whiten(linear, scatter, size);
      looked_at.clear();
      const Subset subset = search(trial, looked_at);
      for (const Subset& s : looked_at) {
        states_.push_back({scatter, size, s});
      }
      tried.push_back({size, subset.nats});
      if (!best || subset.nats > best->nats) {
        best = make_fit(trial, subset, here);
        best_w = std::move(trial);
      }
      return subset.nats;
    };
    for (const double size : sizes_of(scatter)) {
      const double nats = try_size(size);
      falling = nats < last ? falling + 1 : 0;
      last = nats;
      if (falling >= 2) {
        break;
      }
    }
    // Between the grid's points: the vertex of a parabola over the size's logarithm.
    if (in_catalogue(scatter) && best && best->nats > best_known_.nats) {
      for (int round = 0; round < 2; ++round) {
        std::sort(tried.begin(), tried.end());
        for (std::size_t i = 1; i + 1 < tried.size(); ++i) {
          if (tried[i][1] >= tried[i - 1][1] && tried[i][1] >= tried[i + 1][1]) {
            const double a = std::log(tried[i][0] / tried[i - 1][0]);
            const double b = std::log(tried[i + 1][0] / tried[i][0]);
            const double down = (tried[i][1] - tried[i - 1][1]) / a;
            const double up = (tried[i + 1][1] - tried[i][1]) / b;
            if (down > up) {
              const double move = (down * b + up * a) / (down - up) / 2;
              try_size(tried[i][0] * std::exp(std::clamp(move, -a, b)));
            }
            break;
          }
        }
      }
    }
    if (!best) {
      continue;
    }
    Fit& target = *best;
    if (in_catalogue(scatter)) {
      if (target.nats > best_known_.nats) {
        // Once more about its own estimate.
        const Whitened again = whiten(target.state, scatter, target.scatter_size);
        looked_at.clear();
        const Subset subset = search(again, looked_at);
        best_known_ = make_fit(again, subset, target.state);
        final_ = again;
      }
    } else if (!best_unknown_ || target.nats > best_unknown_->nats) {
      best_unknown_ = target;
      final_unknown = std::move(*best_w);
    }
  }
  if (unknown_wins()) {
    final_ = std::move(final_unknown);
  }
  const Whitened plain = whiten(nominal_at, Scatter::nominal, 0);
  if (std::optional<Fit> stepped = fit_step(plain, nominal_at);
      stepped && (!best_unknown_ || stepped->nats > best_unknown_->nats)) {
    best_unknown_ = std::move(stepped);
    if (unknown_wins()) {
      final_ = plain;
    }
  }
}

}  // namespace sixpoint::gap

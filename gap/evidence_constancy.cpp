#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "gap/evidence.h"

namespace sixpoint::gap {
namespace {

double log_mean(const std::vector<double>& nats) {
  const double high = *std::max_element(nats.begin(), nats.end());
  double sum = 0;
  for (const double x : nats) {
    sum += std::exp(x - high);
  }
  return high + std::log(sum / static_cast<double>(nats.size()));
}

// What parameters might change with: some functions of the block, each with a weight on its size.
struct Factor {
  std::string words;
  Eigen::MatrixXd value;  // block x function
  std::vector<double> weight;
  bool in_time = false;
};

// cos(k pi u) of u in 0..1 from k = 1 on, slower ones larger.
Factor smooth(std::string words, const Eigen::VectorXd& u, int count) {
  Factor factor{std::move(words), Eigen::MatrixXd(u.size(), count), {}, false};
  for (int k = 1; k <= count; ++k) {
    factor.value.col(k - 1) = (k * M_PI * u.array()).cos();
    factor.weight.push_back(1.0 / k);
  }
  return factor;
}

std::vector<Factor> factors_of(const std::vector<Block>& blocks) {
  std::vector<Factor> factors;
  const auto n = static_cast<Eigen::Index>(blocks.size());
  const auto of = [&](const auto& function) {
    Eigen::VectorXd v(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      v[i] = function(blocks[static_cast<std::size_t>(i)]);
    }
    return v;
  };
  const auto spread = [](const Eigen::VectorXd& v) { return v.maxCoeff() - v.minCoeff(); };
  const auto to_unit = [&](const Eigen::VectorXd& v) -> Eigen::VectorXd {
    return (v.array() - v.minCoeff()) / std::max(1e-9, spread(v));
  };
  const Eigen::VectorXd time = of([](const Block& b) { return b.middle_s; });
  factors.push_back(smooth("time", to_unit(time), 4));
  factors.back().in_time = true;
  const Eigen::VectorXd temperature = of([](const Block& b) { return b.temperature_c; });
  if (spread(temperature) > 3) {
    factors.push_back(smooth("temperature", to_unit(temperature), 3));
  }
  std::map<int, int> sessions;
  for (const Block& block : blocks) {
    sessions.emplace(block.session, static_cast<int>(sessions.size()));
  }
  constexpr std::size_t kMostSessions = 24;  // a protocol of more has no sessions
  if (sessions.size() > 1 && sessions.size() <= kMostSessions) {
    Factor factor{"session", Eigen::MatrixXd::Zero(n, std::ssize(sessions)), {}, false};
    for (Eigen::Index i = 0; i < n; ++i) {
      factor.value(i, sessions[blocks[static_cast<std::size_t>(i)].session]) = 1;
    }
    factor.weight.assign(sessions.size(), 1);
    factors.push_back(std::move(factor));
  }
  if (spread(temperature) > 3) {
    // What went before: the temperature against those that lag behind it.
    Factor factor{"the way of the temperature", Eigen::MatrixXd::Zero(n, 2), {1, 1}, false};
    constexpr std::array<double, 2> kLag_s = {300, 1500};
    for (std::size_t k = 0; k < kLag_s.size(); ++k) {
      double lagging = temperature[0];
      for (Eigen::Index i = 1; i < n; ++i) {
        lagging += (temperature[i] - lagging) *
                   -std::expm1(-std::max(0.0, time[i] - time[i - 1]) / kLag_s[k]);
        factor.value(i, static_cast<Eigen::Index>(k)) = (temperature[i] - lagging) / 5;
      }
    }
    factors.push_back(std::move(factor));
  }
  // The direction of gravity in the sensor, to second order, and of the room's horizontal axes.
  Factor room{"direction in the room", Eigen::MatrixXd(n, 6), std::vector<double>(6, 1), false};
  Factor pose{"pose", Eigen::MatrixXd(n, 8), std::vector<double>(8, 1), false};
  Factor approach{"side of approach", Eigen::MatrixXd(n, 6), std::vector<double>(6, 1), false};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Block& block = blocks[static_cast<std::size_t>(i)];
    const Eigen::Vector3d u = block.rotation.col(2);
    pose.value.row(i) << u[0], u[1], u[2], u[0] * u[0] - u[2] * u[2], u[1] * u[1] - u[2] * u[2],
        u[0] * u[1], u[1] * u[2], u[0] * u[2];
    approach.value.row(i) << block.approach_g.transpose() / 2, block.held_sign.transpose();
    room.value.row(i) << block.rotation.col(0).transpose(), block.rotation.col(1).transpose();
  }
  factors.push_back(std::move(room));
  factors.push_back(std::move(pose));
  if (approach.value.squaredNorm() > 0) {
    factors.push_back(std::move(approach));
  }
  if (std::any_of(blocks.begin(), blocks.end(), [](const Block& b) { return b.tone; })) {
    Factor shaken{"vibration", Eigen::MatrixXd(n, 2), {1, 0.5}, false};
    shaken.value.col(0) = of([](const Block& b) { return b.tone ? 1 : 0; });
    shaken.value.col(1) = of([](const Block& b) { return b.vibration_lab_g.norm(); });
    factors.push_back(std::move(shaken));
  }
  return factors;
}

}  // namespace

std::vector<Inconstancy> EvidenceSearch::inconstancies() const {
  std::vector<Inconstancy> found;
  if (blocks_.size() < 6 || !in_catalogue(best_known_.scatter)) {
    return found;
  }
  struct Term {
    std::string words;
    Eigen::MatrixXd column;
    std::vector<double> sizes;
    double form = 0;          // a change by this much is the form's, and no finding
    double form_in_time = 0;  // drifts and warming up bend
    bool slow = false;
  };
  const std::vector<Factor> factors = factors_of(blocks_);
  const double hours = (blocks_.back().middle_s - blocks_.front().middle_s) / 3600;
  // Against what is accepted as if it were certain: a chance of e^-x is to be just that.
  double certain_nats = best_known_.nats - log_prior(best_known_.subset.groups);
  if (best_known_.scatter != Scatter::nominal) {
    certain_nats -= options_.log_prior_effect -
                    std::log(static_cast<double>(sizes_of(best_known_.scatter).size()));
  }
  std::map<std::string, Inconstancy> by_factor;
  std::map<std::string, std::vector<double>> all;
  const auto judge = [&](const Fit& fit, std::optional<double> over_nats) {
    const Eigen::MatrixXd raw = &fit == &best() ? linear_best_ : linearise(fit.state);
    std::vector<int> used_groups = {0, 1};
    used_groups.insert(used_groups.end(), fit.subset.groups.begin(), fit.subset.groups.end());
    std::vector<Term> terms;
    double slow_mg = 0;
    for (const int g : used_groups) {
      const ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
      const Eigen::Index count = std::min(3, group.count);
      Term term;
      term.words = group.effect;
      term.column = raw.middleCols(group_column_[static_cast<std::size_t>(g)], count);
      if (group.effect == "gain") {
        term.words = "the gain";
        term.sizes = {5e-4, 2e-3, 8e-3};
      } else if (group.effect == "offset") {
        term.words = "the zero";
        term.sizes = {0.5, 2, 8};
      } else {
        double size = 0;
        for (int i = 0; i < count; ++i) {
          size = std::max(size, std::abs(parameter(fit.state, group.first + i)));
        }
        term.sizes = {0.15 * size, 0.6 * size};
        term.form = 0.03 * size;
        term.slow = group.effect == "drift" || group.effect == "warm_up";
        if (term.slow) {
          slow_mg += size * (group.effect == "drift" ? hours : 1);
        }
      }
      terms.push_back(std::move(term));
    }
    terms[1].form_in_time = 0.1 * slow_mg;
    Term lab{"the jig's level", Eigen::MatrixXd(rows_, 3), {0.02, 0.1, 0.4}};
    Term seat{"the seat", Eigen::MatrixXd(rows_, 3), {0.02, 0.1, 0.4}};
    Eigen::Index row = 0;
    for (const Block& block : blocks_) {
      const Eigen::MatrixXd lever = seating_lever(block);
      seat.column.middleRows(row, block.size()) = lever;
      lab.column.middleRows(row, block.size()) = lever * block.rotation;
      row += block.size();
    }
    terms.push_back(std::move(lab));
    terms.push_back(std::move(seat));
    // All columns are whitened at once: those in use, the values, and each term times each factor.
    Eigen::Index columns = 0;
    for (const Term& term : terms) {
      for (const Factor& factor : factors) {
        columns += term.column.cols() * factor.value.cols();
      }
    }
    const auto used = static_cast<Eigen::Index>(fit.posterior.columns.size());
    Eigen::MatrixXd m(rows_, used + 1 + columns);
    for (Eigen::Index c = 0; c < used; ++c) {
      m.col(c) = raw.col(fit.posterior.columns[static_cast<std::size_t>(c)]);
    }
    m.col(used) = raw.col(columns_);
    Eigen::Index at = used + 1;
    for (const Term& term : terms) {
      for (const Factor& factor : factors) {
        for (Eigen::Index f = 0; f < factor.value.cols(); ++f) {
          for (Eigen::Index r = 0; r < rows_; ++r) {
            const double scale = factor.value(row_block_[static_cast<std::size_t>(r)], f);
            m.row(r).segment(at, term.column.cols()) = scale * term.column.row(r);
          }
          at += term.column.cols();
        }
      }
    }
    const double half_log_det = whiten_rows(fit.scatter, fit.scatter_size, m);
    Eigen::VectorXd prior_sd(used);
    Eigen::VectorXd prior_mean(used);
    Eigen::Index i_used = 0;
    for (const int g : used_groups) {
      const ParameterGroup& group = groups_[static_cast<std::size_t>(g)];
      for (int i = 0; i < group.count; ++i) {
        prior_mean[i_used] = group.prior_mean;
        prior_sd[i_used++] = group.sd_of(i);
      }
    }
    // The fit once more, about its own estimate: in units of the prior, from the prior's mean.
    const Eigen::MatrixXd scaled_used = m.leftCols(used) * prior_sd.asDiagonal();
    const Eigen::LLT<Eigen::MatrixXd> normal(scaled_used.transpose() * scaled_used +
                                             Eigen::MatrixXd::Identity(used, used));
    const Eigen::VectorXd value = m.col(used) - m.leftCols(used) * prior_mean;
    const Eigen::VectorXd pull = scaled_used.transpose() * value;
    const Eigen::VectorXd estimate = normal.solve(pull);
    const Eigen::VectorXd left = value - scaled_used * estimate;
    const double fit_nats = 0.5 * pull.dot(estimate) - 0.5 * value.squaredNorm() - half_log_det -
                            normal.matrixLLT().diagonal().array().log().sum() +
                            log_prior(fit.subset.groups);
    const double less = over_nats ? *over_nats - fit_nats : 0;
    // What the parameters in use would take over from the changes.
    Eigen::MatrixXd taken = scaled_used.transpose() * m.rightCols(columns);
    normal.matrixL().solveInPlace(taken);
    Eigen::Index first = 0;
    for (const Term& term : terms) {
      for (const Factor& factor : factors) {
        const Eigen::Index count = term.column.cols() * factor.value.cols();
        const auto z = m.middleCols(used + 1 + first, count);
        const auto over = taken.middleCols(first, count);
        const Eigen::MatrixXd a = z.transpose() * z - over.transpose() * over;
        const Eigen::VectorXd b = z.transpose() * left;
        first += count;
        if (term.slow && factor.in_time) {
          continue;
        }
        const auto nats = [&](double size) {
          if (size <= 0) {
            return 0.0;
          }
          Eigen::VectorXd sd(count);
          for (Eigen::Index i = 0; i < count; ++i) {
            sd[i] = size * factor.weight[static_cast<std::size_t>(i / term.column.cols())];
          }
          Eigen::MatrixXd scaled = sd.asDiagonal() * a * sd.asDiagonal();
          scaled.diagonal().array() += 1;
          const Eigen::LLT<Eigen::MatrixXd> llt(scaled);
          if (llt.info() != Eigen::Success) {
            return 0.0;
          }
          const Eigen::VectorXd v = sd.cwiseProduct(b);
          return 0.5 * v.dot(llt.solve(v)) - llt.matrixLLT().diagonal().array().log().sum();
        };
        // The form's own changes may have any size up to this; others begin beyond.
        const double tolerated =
            factor.in_time ? std::max(term.form, term.form_in_time) : term.form;
        const double form =
            std::max({0.0, nats(tolerated / 10), nats(tolerated / 3), nats(tolerated)});
        for (const double size : term.sizes) {
          if (size < 2 * tolerated) {
            continue;
          }
          const double gain = nats(size) - form - less;
          all[factor.words].push_back(gain);
          Inconstancy& most = by_factor[factor.words];
          if (most.term.empty() || gain > most.best_nats) {
            most = {term.words, factor.words, 0, gain};
          }
        }
      }
    }
  };
  judge(best_known_, std::nullopt);
  if (best_known_.scatter != Scatter::nominal) {
    judge(best_nominal_, certain_nats);
  }
  for (auto& [words, inconstancy] : by_factor) {
    inconstancy.nats = log_mean(all[words]);
    found.push_back(inconstancy);
  }
  std::sort(found.begin(), found.end(),
            [](const Inconstancy& a, const Inconstancy& b) { return a.nats > b.nats; });
  return found;
}

}  // namespace sixpoint::gap

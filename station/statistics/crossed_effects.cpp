#include "station/statistics/crossed_effects.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace sixpoint::station {

namespace {

constexpr Eigen::Index kNotHeld = -1;

double square_of(double x) { return x * x; }

// Where each element stands among the held ones, or -1.
std::vector<Eigen::Index> places_of(const std::vector<HeldElement>& held, std::size_t elements) {
  std::vector<Eigen::Index> place(elements, kNotHeld);
  for (std::size_t i = 0; i < held.size(); ++i) {
    place[held[i].element] = static_cast<Eigen::Index>(i);
  }
  return place;
}

}  // namespace

// x' K^-1 x and x' K^-1 y, where K is the covariance of the readings by units and scatter alone, x
// the columns of zeros and ones of the elements. By the formula of Sherman and Morrison K^-1 of one
// unit is W/s - c w w', with s the scatter's variance and c as below.
struct CrossedEffects::Sums {
  Eigen::MatrixXd held_held;
  Eigen::MatrixXd held_reading;
  Eigen::MatrixXd all_held;  // these three only where they are asked for
  Eigen::MatrixXd all_reading;
  Eigen::VectorXd all_diagonal;
  double reading_reading = 0;  // over all columns
  double log_determinant = 0;  // of K, of one column, but for the weights
};

CrossedEffects::CrossedEffects(std::size_t units, std::size_t elements,
                               std::vector<CrossedRun> runs)
    : units_(units), together_(elements), runs_(runs.size()) {
  columns_ = static_cast<std::size_t>(runs.front().reading.size());
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(runs.front().reading.size());
  squares_ = none;
  for (Unit& unit : units_) {
    unit.sum = none;
  }
  std::vector<std::map<std::size_t, double>> together(elements);
  std::vector<std::map<std::size_t, std::size_t>> share_of(units);
  for (const CrossedRun& run : runs) {
    Unit& unit = units_[run.unit];
    unit.weight += run.weight;
    unit.sum += run.weight * run.reading;
    squares_ += run.weight * run.reading.cwiseAbs2();
    for (const std::size_t element : run.elements) {
      const auto [at, is_new] = share_of[run.unit].emplace(element, unit.shares.size());
      if (is_new) {
        unit.shares.push_back({element, 0, none});
      }
      Share& share = unit.shares[at->second];
      share.weight += run.weight;
      share.sum += run.weight * run.reading;
      for (const std::size_t other : run.elements) {
        together[element][other] += run.weight;
      }
    }
  }
  for (std::size_t e = 0; e < elements; ++e) {
    for (const auto& [other, weight] : together[e]) {
      together_[e].push_back({other, weight});
    }
  }
}

CrossedEffects::Sums CrossedEffects::sums(const std::vector<HeldElement>& held,
                                          const CrossedScatter& scatter,
                                          bool of_all_elements) const {
  const auto columns = static_cast<Eigen::Index>(columns_);
  const auto size = static_cast<Eigen::Index>(held.size());
  const auto all = static_cast<Eigen::Index>(together_.size());
  const double s = square_of(scatter.run);
  const double between = square_of(scatter.unit);
  const std::vector<Eigen::Index> place = places_of(held, together_.size());
  Sums out;
  out.held_held = Eigen::MatrixXd::Zero(size, size);
  out.held_reading = Eigen::MatrixXd::Zero(size, columns);
  if (of_all_elements) {
    out.all_held = Eigen::MatrixXd::Zero(all, size);
    out.all_reading = Eigen::MatrixXd::Zero(all, columns);
    out.all_diagonal = Eigen::VectorXd::Zero(all);
  }
  for (Eigen::Index h = 0; h < size; ++h) {
    for (const Pair& pair : together_[held[static_cast<std::size_t>(h)].element]) {
      const Eigen::Index other = place[pair.other];
      if (other >= 0) {
        out.held_held(other, h) += pair.weight / s;
      }
      if (of_all_elements) {
        out.all_held(static_cast<Eigen::Index>(pair.other), h) += pair.weight / s;
      }
    }
  }
  out.reading_reading = squares_.sum() / s;
  out.log_determinant = static_cast<double>(runs_) * std::log(s);
  for (const Unit& unit : units_) {
    const double c = between / (s * (s + between * unit.weight));
    out.reading_reading -= c * unit.sum.squaredNorm();
    out.log_determinant += std::log1p(between * unit.weight / s);
    for (const Share& share : unit.shares) {
      const auto e = static_cast<Eigen::Index>(share.element);
      const Eigen::Index h = place[share.element];
      if (h < 0 && !of_all_elements) {
        continue;
      }
      const Eigen::RowVectorXd reading = (share.sum / s - c * share.weight * unit.sum).transpose();
      if (h >= 0) {
        out.held_reading.row(h) += reading;
      }
      if (of_all_elements) {
        out.all_reading.row(e) += reading;
        out.all_diagonal(e) += share.weight / s - c * square_of(share.weight);
      }
      for (const Share& other : unit.shares) {
        const Eigen::Index k = place[other.element];
        if (k < 0) {
          continue;
        }
        if (h >= 0) {
          out.held_held(h, k) -= c * share.weight * other.weight;
        }
        if (of_all_elements) {
          out.all_held(e, k) -= c * share.weight * other.weight;
        }
      }
    }
  }
  for (std::size_t i = 0; i < held.size(); ++i) {
    if (held[i].prior_sd) {
      const auto h = static_cast<Eigen::Index>(i);
      out.held_held(h, h) += 1 / square_of(*held[i].prior_sd);
      out.log_determinant += 2 * std::log(*held[i].prior_sd);
    }
  }
  return out;
}

double CrossedEffects::log_likelihood(const std::vector<HeldElement>& held,
                                      const CrossedScatter& scatter) const {
  const Sums at = sums(held, scatter, false);
  double log_determinant = at.log_determinant;
  double quadratic = at.reading_reading;
  if (!held.empty()) {
    const Eigen::LLT<Eigen::MatrixXd> factor(at.held_held);
    const Eigen::MatrixXd root = factor.matrixL();
    log_determinant += 2 * root.diagonal().array().log().sum();
    quadratic -= factor.matrixL().solve(at.held_reading).squaredNorm();
  }
  return -0.5 * (static_cast<double>(columns_) * log_determinant + quadratic);
}

CrossedScatter CrossedEffects::learn_scatter(const std::vector<HeldElement>& held,
                                             const ScatterPrior& prior,
                                             const std::optional<CrossedScatter>& near) const {
  using Logs = std::array<double, 2>;  // of unit and run, over the prior's medians
  const auto scatter_of = [&](const Logs& logs) {
    return CrossedScatter{prior.median.unit * std::exp(logs[0]),
                          prior.median.run * std::exp(logs[1])};
  };
  const auto density = [&](const Logs& logs) {
    const double value = log_likelihood(held, scatter_of(logs)) -
                         (square_of(logs[0]) + square_of(logs[1])) / (2 * square_of(prior.log_sd));
    return std::isfinite(value) ? value : -std::numeric_limits<double>::infinity();
  };
  // A pattern search: two smooth unknowns, one maximum, and no derivative that could be wrong.
  Logs best{};
  if (near) {
    best = {std::log(near->unit / prior.median.unit), std::log(near->run / prior.median.run)};
  }
  double highest = density(best);
  constexpr double kLastStep = 0.01;  // a hundredth of a standard deviation
  for (double step = near ? 0.25 : 1; step > kLastStep;) {
    bool moved = false;
    for (const Logs& way : {Logs{1, 0}, Logs{-1, 0}, Logs{0, 1}, Logs{0, -1}}) {
      const Logs next = {best[0] + step * way[0], best[1] + step * way[1]};
      if (const double value = density(next); value > highest) {
        highest = value;
        best = next;
        moved = true;
        break;
      }
    }
    step = moved ? step : step / 2;
  }
  return scatter_of(best);
}

std::vector<ElementEstimate> CrossedEffects::estimates(const std::vector<HeldElement>& held,
                                                       const CrossedScatter& scatter) const {
  // An information so much smaller than without the held elements is rounding.
  constexpr double kNothingLeft = 1e-9;
  const Sums at = sums(held, scatter, true);
  const auto all = static_cast<Eigen::Index>(together_.size());
  Eigen::MatrixXd score = at.all_reading;
  Eigen::VectorXd information = at.all_diagonal;
  Eigen::MatrixXd inverse;
  Eigen::MatrixXd mean;
  if (!held.empty()) {
    const Eigen::LLT<Eigen::MatrixXd> factor(at.held_held);
    inverse = factor.solve(Eigen::MatrixXd::Identity(at.held_held.rows(), at.held_held.cols()));
    mean = inverse * at.held_reading;
    const Eigen::MatrixXd projected = at.all_held * inverse;
    score -= at.all_held * mean;
    information -= projected.cwiseProduct(at.all_held).rowwise().sum();
  }
  const std::vector<Eigen::Index> place = places_of(held, together_.size());
  std::vector<ElementEstimate> out;
  for (Eigen::Index e = 0; e < all; ++e) {
    const Eigen::Index h = place[static_cast<std::size_t>(e)];
    ElementEstimate estimate;
    double left = information(e);
    Eigen::VectorXd weighted = score.row(e).transpose();
    if (h >= 0) {
      // The readings' own part: the posterior without the prior.
      const std::optional<double> sd = held[static_cast<std::size_t>(h)].prior_sd;
      left = 1 / inverse(h, h) - (sd ? 1 / square_of(*sd) : 0);
      weighted = mean.row(h).transpose() / inverse(h, h);
    }
    if (left > kNothingLeft * at.all_diagonal(e)) {
      estimate.value = weighted / left;
      estimate.variance = 1 / left;
    } else {
      estimate.value = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(columns_));
      estimate.variance = std::numeric_limits<double>::infinity();
    }
    out.push_back(std::move(estimate));
  }
  return out;
}

}  // namespace sixpoint::station

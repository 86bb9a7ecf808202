#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "gap/explain/explanation.h"

namespace sixpoint::gap {
namespace {

// Mean square about their mean that scatter adds to the blocks' means.
double scatter_mg2(const std::vector<Block>& blocks, Scatter kind, double size) {
  const double n = static_cast<double>(blocks.size());
  const double size2 = size * size;
  double own = 0, shared = 0;
  for (const Block& a : blocks) {
    if (kind == Scatter::seating) {
      own += size2 * seating_lever(a).topRows<3>().squaredNorm() / 3;
      continue;
    }
    const double start_s = blocks.front().middle_s - blocks.front().seconds / 2;
    own += size2 * scatter_kernel(kind, a, a, start_s);
    for (const Block& b : blocks) {
      shared += size2 * scatter_kernel(kind, a, b, start_s);
    }
  }
  return std::max(0.0, own / n - shared / (n * n));
}

// The blocks' values of scatter of size one: columns that independent numbers of variance one add
// up. Those of a thousandth of the largest variance add nothing that shows.
Eigen::MatrixXd scatter_columns(const std::vector<Block>& blocks, Scatter kind) {
  Eigen::Index rows = 0;
  for (const Block& block : blocks) {
    rows += block.size();
  }
  const auto n = static_cast<Eigen::Index>(blocks.size());
  if (kind == Scatter::seating) {
    const Eigen::Index seats = 1 + blocks.back().placement - blocks.front().placement;
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(rows, 3 * seats);
    Eigen::Index row = 0;
    for (const Block& block : blocks) {
      const Eigen::Index seat = Eigen::Index{3} * (block.placement - blocks.front().placement);
      columns.block(row, seat, block.size(), 3) = seating_lever(block);
      row += block.size();
    }
    return columns;
  }
  const double start_s = blocks.front().middle_s - blocks.front().seconds / 2;
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      covariance(i, j) = scatter_kernel(kind, blocks[static_cast<std::size_t>(i)],
                                        blocks[static_cast<std::size_t>(j)], start_s);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> own(covariance);
  constexpr double kLeast = 1e-3;
  const Eigen::VectorXd& variance = own.eigenvalues();  // ascending
  const Eigen::Index kept = (variance.array() > kLeast * variance[n - 1]).count();
  const Eigen::MatrixXd root =
      own.eigenvectors().rightCols(kept) * variance.tail(kept).cwiseSqrt().asDiagonal();
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(rows, 3 * kept);
  Eigen::Index row = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      columns.block(row + axis, axis * kept, 1, kept) = root.row(i);
    }
    row += blocks[static_cast<std::size_t>(i)].size();
  }
  return columns;
}

}  // namespace

bool Explanation::has(const Tried& tried, const std::string& effect) const {
  return to_string(tried.scatter) == effect ||
         (tried.bad_seats && effect == to_string(Scatter::seating)) ||
         std::ranges::any_of(tried.subset.groups,
                             [&](int g) { return model_.group(g).effect == effect; });
}

double Explanation::gain_nats(const std::string& effect, bool known_only) const {
  double with = kNoEvidence_nats;
  double without = kNoEvidence_nats;
  for (const Tried& tried : tried_) {
    if (!known_only || in_catalogue(tried.scatter)) {
      double& best = has(tried, effect) ? with : without;
      best = std::max(best, tried.subset.nats);
    }
  }
  return with == kNoEvidence_nats || without == kNoEvidence_nats ? 0 : with - without;
}

double Explanation::stand_in_nats(const std::string& effect, const std::string& other) const {
  double own = kNoEvidence_nats;
  double others = kNoEvidence_nats;
  for (const Tried& tried : tried_) {
    if (has(tried, effect)) {
      own = std::max(own, tried.subset.nats);
    } else if (has(tried, other)) {
      others = std::max(others, tried.subset.nats);
    }
  }
  return own == kNoEvidence_nats || others == kNoEvidence_nats ? kExcluded_nats : others - own;
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
  return estimate_of(chosen, std::move(groups));
}

Explanation::Estimate Explanation::estimate_of(int g, std::vector<int> groups) const {
  std::ranges::transform(groups, groups.begin(), [&](int each) { return model_.widest(each); });
  const Posterior posterior = model_.solve(data_.sums, groups).posterior();
  const ParameterGroup& group = model_.group(g);
  Estimate estimate{{}, {}, group.tau_s};
  for (std::size_t k = 0; k < posterior.columns.size(); ++k) {
    const int c = posterior.columns[k] - model_.first_column(g);
    if (c >= 0 && c < std::min(3, group.count)) {
      const auto i = static_cast<Eigen::Index>(k);
      estimate.value.push_back(posterior.mean[i]);
      estimate.sd.push_back(std::sqrt(posterior.covariance(i, i)));
    }
  }
  return estimate;
}

std::vector<std::string> Explanation::left_open_by(const std::string& effect) const {
  constexpr double kOpen = 3;
  constexpr double kMatters = 0.5;  // of the smallest realistic size
  const std::vector<int>& groups = best().subset.groups;
  const auto own = std::ranges::find(groups, effect, [&](int g) { return model_.group(g).effect; });
  std::vector<std::string> found;
  if (own == groups.end()) {
    return found;
  }
  const Estimate with = estimate_of(*own, groups);
  for (const int g : groups) {
    std::vector<int> others = groups;
    std::erase(others, g);
    const Estimate without = g == *own ? with : estimate_of(*own, others);
    for (std::size_t i = 0; i < with.sd.size(); ++i) {
      if (with.sd[i] > kOpen * without.sd[i] &&
          with.sd[i] > kMatters * model_.group(*own).smallest) {
        found.push_back(model_.group(g).effect);
        break;
      }
    }
  }
  return found;
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

// What the data alone say of one group beside `others`.
Explanation::Information Explanation::information(int g, std::vector<int> others) const {
  // One axis has the size, the others a uniform share of it: mean square a third.
  constexpr double kOthers = 1.0 / 3;
  const ParameterGroup& group = model_.group(g);
  Posterior posterior;
  model_.evidence(data_, with_group(std::move(others), g), &posterior);
  const auto at = std::find(posterior.columns.begin() + kNuisanceParameters,
                            posterior.columns.end(), model_.first_column(g)) -
                  posterior.columns.begin();
  Information sum;
  for (Eigen::Index i = 0; i < std::min(3, group.count); ++i) {
    const double prior2 = group.prior_sd * group.prior_sd;
    const double left = std::min(posterior.covariance(at + i, at + i), prior2 * (1 - 1e-9));
    // Posterior less prior precision, and what a prior of this width keeps of a size beyond it.
    sum.per_size2 += (1 / left - 1 / prior2) * (1 - left / prior2) * (i == 0 ? 1 : kOthers);
    sum.occam_nats += 0.5 * std::log(prior2 / left);
  }
  return sum;
}

double Explanation::expected_nats(const std::string& effect) const {
  double best = kNoEvidence_nats;
  for (const int g : model_.groups_of(effect)) {
    const double smallest = model_.group(g).smallest;
    if (smallest > 0 && !model_.group(g).learnt) {
      const Information known = information(g, {});
      best = std::max(best, 0.5 * smallest * smallest * known.per_size2 - known.occam_nats +
                                model_.log_prior({g}));
    }
  }
  return best == kNoEvidence_nats ? -kNoEvidence_nats : best;
}

std::optional<double> Explanation::bound(const std::string& effect) const {
  std::vector<int> others = best().subset.groups;
  const std::vector<int> own = model_.groups_of(effect);
  std::erase_if(others, [&](int g) { return std::find(own.begin(), own.end(), g) != own.end(); });
  std::optional<double> least;
  for (const int g : own) {
    if (model_.group(g).learnt) {
      continue;  // the bound is that of an effect about which nothing is known
    }
    const Information known = information(g, others);
    const double prior = model_.log_prior(with_group(others, g), best().scatter, best().seats_deg) -
                         model_.log_prior(others, best().scatter, best().seats_deg);
    const double needed = kAccept_nats + known.occam_nats - prior;
    const double size = std::sqrt(2 * std::max(0.0, needed) / std::max(1e-12, known.per_size2));
    least = std::min(least.value_or(size), size);
  }
  return least;
}

std::optional<double> Explanation::bound(
    Scatter kind, const std::function<double(double size, double tried)>& record_nats) const {
  constexpr double kRange = 100;  // beyond the sizes that are tried
  // Three times the engineering protocol's; the work grows with the cube.
  constexpr std::size_t kMostBlocks = 400;
  const std::vector<double> sizes = sizes_of(kind);
  const std::vector<Block>& blocks = model_.blocks();
  if (blocks.empty() || blocks.size() > kMostBlocks) {
    return std::nullopt;
  }
  Eigen::MatrixXd scatter = scatter_columns(blocks, kind);
  model_.whiten_rows(Scatter::nominal, 0, scatter);
  // What is left by the rest of the explanation, and a drift.
  std::vector<int> others = best().subset.groups;
  if (!best().contains("drift")) {
    for (const int g : model_.groups_of("drift")) {
      others = with_group(others, g);
    }
  }
  const Whitened w = model_.whiten(linear_, Scatter::nominal, 0);
  Posterior posterior;
  model_.evidence(w, others, &posterior);
  const Eigen::MatrixXd taken = used_columns(w.x, posterior).transpose() * scatter;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      scatter.transpose() * scatter - taken.transpose() * posterior.covariance * taken,
      Eigen::EigenvaluesOnly);
  const Eigen::ArrayXd power = solver.eigenvalues().cwiseMax(0);
  // The median of the log likelihood ratio of variances 1 + tried^2 power over 1 where they are 1 +
  // size^2 power: of its sum of squares by Wilson and Hilferty (1931), for the freedom that it is
  // worth.
  const auto median_nats = [&](double size, double tried) {
    const Eigen::ArrayXd ratio = tried * tried * power;
    const Eigen::ArrayXd part = (1 + size * size * power) * ratio / (1 + ratio);
    const double sum = std::max(1e-300, part.sum());
    const double shift = 2 * part.square().sum() / (9 * sum * sum);
    return 0.5 * (sum * std::pow(1 - shift, 3) - ratio.log1p().sum()) + record_nats(size, tried) +
           scatter_log_prior(kind);
  };
  const auto shows = [&](double size) {
    return std::ranges::any_of(
        sizes, [&](double tried) { return median_nats(size, tried) > kAccept_nats; });
  };
  double low = sizes.front() / kRange, high = sizes.back() * kRange;
  if (!shows(high)) {
    return std::nullopt;
  }
  for (int halving = 0; halving < 25; ++halving) {
    const double middle = std::sqrt(low * high);
    (shows(middle) ? high : low) = middle;
  }
  return high;
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

std::map<std::string, double> Explanation::gap_mg2() const {
  std::map<std::string, double> found;
  const Posterior& posterior = best().posterior;
  const Whitened w = model_.whiten(linear_, Scatter::nominal, 0);
  const Posterior nuisances = model_.solve(w.sums, {}).posterior();
  // What gains and offsets take over, by least squares of the whitened rows.
  const Eigen::MatrixXd own = used_columns(w.x, nuisances);
  const Eigen::MatrixXd own_mg = used_columns(linear_, nuisances);
  std::vector<std::string> names;
  Eigen::MatrixXd adds_mg = Eigen::MatrixXd::Zero(model_.rows(), 0);
  Eigen::Index at = kNuisanceParameters;
  for (const int g : best().subset.groups) {
    const int count = model_.group(g).count;
    const Eigen::VectorXd value = posterior.mean.segment(at, count);
    const auto adds = w.x.middleCols(model_.first_column(g), count) * value;
    const Eigen::VectorXd taken = nuisances.covariance * (own.transpose() * adds);
    adds_mg.conservativeResize(Eigen::NoChange, adds_mg.cols() + 1);
    adds_mg.rightCols<1>() =
        linear_.middleCols(model_.first_column(g), count) * value - own_mg * taken;
    names.push_back(model_.group(g).effect);
    at += count;
  }
  double n = 0;
  Eigen::VectorXd in_mg(model_.rows());
  for (int row = 0; row < model_.rows(); ++row) {
    in_mg[row] = model_.feature_of_row(row) < kSecondHarmonic ? 1 : 0;  // as in held_out()
    n += in_mg[row];
  }
  Eigen::VectorXd all_mg = Eigen::VectorXd::Zero(model_.rows());
  for (Eigen::Index i = 0; i < adds_mg.cols(); ++i) {  // there may be none
    all_mg += in_mg.cwiseProduct(adds_mg.col(i));
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    found[names[i]] = adds_mg.col(static_cast<Eigen::Index>(i)).dot(all_mg) / std::max(1.0, n);
  }
  for (const Scatter kind : {Scatter::seating, Scatter::random_walk, Scatter::flicker}) {
    if (const double size = best().size_of(kind); size > 0) {
      found[std::string(to_string(kind))] = scatter_mg2(model_.blocks(), kind, size);
    }
  }
  return found;
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

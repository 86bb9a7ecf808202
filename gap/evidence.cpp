#include "gap/evidence.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "gap/features/slow_noise.h"

namespace sixpoint::gap {
namespace {

constexpr int kNuisances = 2;        // groups: gain, offset
constexpr std::size_t kLargest = 5;  // effects at once in this model

// Sizes of the kinds of scatter, log-uniform.
std::vector<double> sizes_of(Scatter scatter) {
  switch (scatter) {
    case Scatter::nominal:
      return {0};
    case Scatter::seating:
      return {0.016, 0.025, 0.04, 0.065, 0.1, 0.16, 0.25, 0.4, 0.65};
    case Scatter::random_walk:
      return {0.03, 0.065, 0.12, 0.2, 0.3, 0.5};
    case Scatter::flicker:
      return {0.035, 0.09, 0.18, 0.35, 0.7, 1.4};
    case Scatter::by_pose:
      return {0.4, 1.2, 4, 12, 40, 200};
    case Scatter::by_placement:
      return {0.4, 1.2, 4, 12, 40};
    case Scatter::step:
      return {};
    case Scatter::by_session:
    case Scatter::by_temperature:
    case Scatter::by_time:
    case Scatter::by_time_fast:
      return {0.5, 2, 8, 30};
  }
  return {};
}

bool same_pose(const Block& a, const Block& b) {
  return (a.rotation - b.rotation).cwiseAbs().maxCoeff() < 1e-3;
}

// Covariance of two blocks' means on one axis for scatter that is not of the seat, unit size.
double kernel(Scatter scatter, const Block& a, const Block& b, double start_s) {
  const double gap_s = std::abs(a.middle_s - b.middle_s);
  const bool same = &a == &b;
  switch (scatter) {
    case Scatter::random_walk:
      return same ? std::max(0.0, a.middle_s - a.seconds / 2 - start_s) + a.seconds / 3
                  : std::max(0.0, std::min(a.middle_s, b.middle_s) - start_s);
    case Scatter::flicker: {
      // Ornstein-Uhlenbeck processes a factor e apart add up to 1/f.
      double sum = 0;
      for (int k = 0; k < 11; ++k) {
        const double tau = 0.5 * std::exp(k);
        if (same) {
          const double l = std::max(1e-3, a.seconds / tau);
          sum += 2 * (1 / l - (1 - std::exp(-l)) / (l * l));
        } else {
          sum += std::exp(-gap_s / tau) * std::min(1.0, tau / std::max(1e-3, a.seconds));
        }
      }
      return sum * flicker_density_mg2(1);
    }
    case Scatter::by_pose:
      return same_pose(a, b) ? 1 : 0;
    case Scatter::by_placement: {
      // Rectified vibration grows with the square of its amplitude.
      const auto weight = [](const Block& block) {
        return 1 + block.vibration_lab_g.squaredNorm() / 4;
      };
      return a.placement == b.placement ? weight(a) * weight(b) : 0;
    }
    case Scatter::by_session:
      return a.session == b.session ? 1 : 0;
    case Scatter::by_temperature:
      return std::exp(-0.5 * std::pow((a.temperature_c - b.temperature_c) / 10, 2));
    case Scatter::by_time:
      return std::exp(-0.5 * std::pow(gap_s / 700, 2));
    case Scatter::by_time_fast:
      return std::exp(-0.5 * std::pow(gap_s / 90, 2));
    default:
      return 0;
  }
}

// Prior sd of a group's number.
double sd_of(const ParameterGroup& group, int i) {
  return i >= 3 && group.curve_sd > 0 ? group.curve_sd : group.prior_sd;
}

double log_sum(double a, double b) {
  const double high = std::max(a, b);
  return high == -1e300 ? high : high + std::log(std::exp(a - high) + std::exp(b - high));
}

}  // namespace

std::string_view to_string(Scatter scatter) {
  switch (scatter) {
    case Scatter::nominal:
      return "nominal";
    case Scatter::seating:
      return "seating";
    case Scatter::random_walk:
      return "random_walk";
    case Scatter::flicker:
      return "flicker";
    case Scatter::by_pose:
      return "pose";
    case Scatter::by_placement:
      return "placement";
    case Scatter::by_temperature:
      return "temperature";
    case Scatter::by_session:
      return "session";
    case Scatter::by_time:
      return "time";
    case Scatter::by_time_fast:
      return "time, within minutes";
    case Scatter::step:
      return "a step of the zero";
  }
  return "";
}

bool in_catalogue(Scatter scatter) { return scatter <= Scatter::flicker; }

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

Whitened EvidenceSearch::whiten(const ForwardState& at, Scatter scatter, double size) const {
  Whitened w;
  w.scatter = scatter;
  w.size = size;
  w.row_block = row_block_;
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(rows_, columns_);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(rows_);
  Eigen::VectorXd theta = Eigen::VectorXd::Zero(columns_);
  int row = 0;
  for (const Block& block : blocks_) {
    const Eigen::VectorXd base = predict(at, block, options_.lsb_mg);
    y.segment(row, block.size()) = block.value_mg - base;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const ParameterGroup& group = groups_[g];
      const bool shaped_alike = group.effect == "warm_up"      ? group.tau_s == at.warm_up_tau_s
                                : group.effect == "hysteresis" ? group.shape == at.hysteresis_shape
                                                               : true;
      for (int i = 0; i < group.count; ++i) {
        ForwardState moved = at;
        double here = parameter(at, group.first + i);
        if (!shaped_alike) {
          // Another shape of the same effect: its column is about zero of its own.
          for (int k = 0; k < group.count; ++k) {
            parameter(moved, group.first + k) = 0;
          }
          moved.warm_up_tau_s = group.tau_s > 0 ? group.tau_s : moved.warm_up_tau_s;
          moved.hysteresis_shape = group.shape;
          here = 0;
        }
        const Eigen::VectorXd from = shaped_alike ? base : predict(moved, block, options_.lsb_mg);
        const double step = group.effect == "truncation" ? 1.0 : 0.02 * sd_of(group, i);
        parameter(moved, group.first + i) =
            here + (group.effect == "truncation" && here > 0.5 ? -step : step);
        const double sign = group.effect == "truncation" && here > 0.5 ? -1 : 1;
        const Eigen::VectorXd column =
            sign * (predict(moved, block, options_.lsb_mg) - from) / step;
        const int c = group_column_[g] + i;
        x.block(row, c, block.size(), 1) = column;
        theta[c] = here;
      }
    }
    row += static_cast<int>(block.size());
  }
  y += x * theta;

  const auto seat = [&](const Block& a, const Block& b, double sd_deg) -> Eigen::MatrixXd {
    return sd_deg * sd_deg * seating_lever(a) * seating_lever(b).transpose();
  };
  const double seat_sd =
      scatter == Scatter::seating ? std::hypot(kNominalSeating_deg, size) : kNominalSeating_deg;
  const bool dense = scatter != Scatter::nominal && scatter != Scatter::seating &&
                     scatter != Scatter::by_placement;
  const double start_s =
      blocks_.empty() ? 0 : blocks_.front().middle_s - blocks_.front().seconds / 2;

  const auto whiten_rows = [&](std::size_t first, std::size_t last, int first_row) {
    int size_rows = 0;
    for (std::size_t b = first; b < last; ++b) {
      size_rows += static_cast<int>(blocks_[b].size());
    }
    Eigen::MatrixXd v = Eigen::MatrixXd::Zero(size_rows, size_rows);
    int ri = 0;
    for (std::size_t i = first; i < last; ++i) {
      const Block& bi = blocks_[i];
      v.block(ri, ri, bi.size(), bi.size()) += bi.white_mg2;
      int rj = ri;
      for (std::size_t j = i; j < last; ++j) {
        const Block& bj = blocks_[j];
        const bool one_pose = scatter == Scatter::by_pose && same_pose(bi, bj);
        if (bi.placement == bj.placement || one_pose) {
          // What a pose brings with it may be a turn, too: 1 mg is a turn of 0.057 deg.
          const double turn_deg = one_pose ? size / 17.45 : 0;
          const Eigen::MatrixXd c =
              seat(bi, bj, bi.placement == bj.placement ? std::hypot(seat_sd, turn_deg) : turn_deg);
          v.block(ri, rj, bi.size(), bj.size()) += c;
          if (i != j) {
            v.block(rj, ri, bj.size(), bi.size()) += c.transpose();
          }
        }
        if (scatter != Scatter::nominal && scatter != Scatter::seating) {
          const double c = size * size * kernel(scatter, bi, bj, start_s);
          for (int a = 0; a < 3 && c != 0; ++a) {
            v(ri + a, rj + a) += c;
            if (i != j) {
              v(rj + a, ri + a) += c;
            }
          }
        }
        if (i == j && scatter == Scatter::by_placement && bi.tone) {
          const double sd = size * bi.vibration_lab_g.norm();
          v.block(ri, ri, bi.size(), bi.size()).diagonal().tail(bi.size() - 3).array() += sd * sd;
        }
        rj += static_cast<int>(bj.size());
      }
      ri += static_cast<int>(bi.size());
    }
    v.diagonal().array() *= 1 + 1e-9;
    const Eigen::LLT<Eigen::MatrixXd> llt(v);
    llt.matrixL().solveInPlace(x.middleRows(first_row, size_rows));
    Eigen::VectorXd piece = y.segment(first_row, size_rows);
    llt.matrixL().solveInPlace(piece);
    y.segment(first_row, size_rows) = piece;
    w.half_log_det += llt.matrixLLT().diagonal().array().log().sum();
    return size_rows;
  };
  if (dense) {
    whiten_rows(0, blocks_.size(), 0);
  } else {
    int first_row = 0;
    for (std::size_t first = 0; first < blocks_.size();) {
      std::size_t last = first;
      while (last < blocks_.size() && blocks_[last].placement == blocks_[first].placement) {
        ++last;
      }
      first_row += whiten_rows(first, last, first_row);
      first = last;
    }
  }
  w.x = std::move(x);
  w.y = std::move(y);
  w.a = w.x.transpose() * w.x;
  w.b = w.x.transpose() * w.y;
  w.yy = w.y.squaredNorm();
  if (options_.record_nats) {
    w.outside_nats = options_.record_nats(scatter, size);
  }
  if (scatter != Scatter::nominal) {
    w.outside_nats +=
        (in_catalogue(scatter) ? options_.log_prior_effect : options_.log_prior_unknown) -
        std::log(static_cast<double>(sizes_of(scatter).size()));
  }
  return w;
}

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
      sd[static_cast<std::size_t>(n)] = sd_of(group, static_cast<int>(k));
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

// A zero that moved once looks like a random walk, a drift or warming up. Every placement is tried
// as the first after the step, together with every subset; covariance nominal.
std::optional<Fit> EvidenceSearch::fit_step(const Whitened& nominal, const ForwardState& at) const {
  constexpr double kPrior_mg = 5;
  // The whitened columns of a step just before each block. Placements are independent of each
  // other, so that a step reaches into its own placement in part and into all later ones whole.
  struct Start {
    int row = 0;          // of its block
    int end = 0;          // of its placement
    Eigen::MatrixXd own;  // rows from `first` to `end`; 3 columns, or 6 with a block of its own
    int first = 0;        // of its placement
    bool whole = false;   // the first of its placement, all of which follows the step
  };
  std::vector<Start> starts;
  Eigen::MatrixXd column = Eigen::MatrixXd::Zero(rows_, 3);
  int row = 0;
  for (std::size_t first = 0; first < blocks_.size();) {
    std::size_t last = first;
    int rows = 0;
    while (last < blocks_.size() && blocks_[last].placement == blocks_[first].placement) {
      rows += static_cast<int>(blocks_[last].size());
      ++last;
    }
    Eigen::MatrixXd v = Eigen::MatrixXd::Zero(rows, rows);
    int ri = 0;
    for (std::size_t i = first; i < last; ++i) {
      int rj = 0;
      for (std::size_t j = first; j < last; ++j) {
        v.block(ri, rj, blocks_[i].size(), blocks_[j].size()) =
            kNominalSeating_deg * kNominalSeating_deg * seating_lever(blocks_[i]) *
            seating_lever(blocks_[j]).transpose();
        rj += static_cast<int>(blocks_[j].size());
      }
      v.block(ri, ri, blocks_[i].size(), blocks_[i].size()) += blocks_[i].white_mg2;
      ri += static_cast<int>(blocks_[i].size());
    }
    const Eigen::LLT<Eigen::MatrixXd> llt(v);
    Eigen::MatrixXd from = Eigen::MatrixXd::Zero(rows, 3);
    std::vector<Start> own;  // last first
    ri = rows;
    for (std::size_t i = last; i-- > first;) {
      // A step inside this block leaves its mean anywhere: three numbers of its own.
      const auto size = static_cast<int>(blocks_[i].size());
      Start inside;
      inside.own = Eigen::MatrixXd::Zero(rows, 6);
      inside.own.leftCols<3>() = from;
      ri -= size;
      inside.own.block<3, 3>(ri, 3) = Eigen::Matrix3d::Identity();
      from.block<3, 3>(ri, 0) = Eigen::Matrix3d::Identity();
      Start before;
      before.own = from;
      before.whole = i == first;
      for (Start* start : {&inside, &before}) {
        start->row = row + ri;
        start->first = row;
        start->end = row + rows;
        llt.matrixL().solveInPlace(start->own);
        own.push_back(std::move(*start));
      }
    }
    column.middleRows(row, rows) = own.back().own;
    starts.insert(starts.end(), own.rbegin(), own.rend());
    row += rows;
    first = last;
  }
  if (starts.size() < 6) {
    return std::nullopt;
  }
  const double record_nats = options_.record_nats ? options_.record_nats(Scatter::by_time, 1) : 0;
  Whitened w = nominal;
  std::optional<Fit> best;
  std::vector<Subset> looked_at;
  std::vector<int> groups;
  for (int round = 0; round < 3; ++round) {
    // What the subset leaves is searched for the step.
    Posterior posterior;
    evidence_of(w.a, w.b, w.yy, groups, &posterior);
    Eigen::VectorXd left = nominal.y;
    for (std::size_t c = 0; c < posterior.columns.size(); ++c) {
      left -= nominal.x.col(posterior.columns[c]) * posterior.mean[static_cast<Eigen::Index>(c)];
    }
    Eigen::MatrixXd used(rows_, posterior.mean.size());
    for (std::size_t c = 0; c < posterior.columns.size(); ++c) {
      used.col(static_cast<Eigen::Index>(c)) = nominal.x.col(posterior.columns[c]);
    }
    Eigen::MatrixXd later_used = Eigen::MatrixXd::Zero(used.cols(), 3);
    double most = -1e300;
    const Start* chosen = nullptr;
    Eigen::VectorXd size;
    double penalty = 0;
    Eigen::Matrix3d later = Eigen::Matrix3d::Zero();
    Eigen::Vector3d later_b = Eigen::Vector3d::Zero();
    for (std::size_t k = starts.size(); k-- > 1;) {
      const Start& start = starts[k];
      Eigen::MatrixXd a = start.own.transpose() * start.own;
      Eigen::VectorXd b =
          start.own.transpose() * left.segment(start.first, start.end - start.first);
      a.topLeftCorner<3, 3>() += later;
      b.head<3>() += later_b;
      const Eigen::Matrix3d here = a.topLeftCorner<3, 3>();
      const Eigen::Vector3d here_b = b.head<3>();
      // What the subset's parameters would take over from the step.
      Eigen::MatrixXd cross =
          used.middleRows(start.first, start.end - start.first).transpose() * start.own;
      cross.leftCols<3>() += later_used;
      const Eigen::MatrixXd here_used = cross.leftCols<3>();
      a -= cross.transpose() * posterior.covariance * cross;
      a.diagonal().array() += 1 / (kPrior_mg * kPrior_mg);
      const Eigen::LLT<Eigen::MatrixXd> llt(a);
      const Eigen::VectorXd x = llt.solve(b);
      const double cost = llt.matrixLLT().diagonal().array().log().sum() +
                          static_cast<double>(a.rows()) * std::log(kPrior_mg);
      if (0.5 * b.dot(x) - cost > most) {
        most = 0.5 * b.dot(x) - cost;
        chosen = &start;
        size = x;
        penalty = cost;
      }
      if (start.whole) {
        later = here;
        later_b = here_b;
        later_used = here_used;
      }
    }
    if (chosen == nullptr) {
      return std::nullopt;  // no step has a finite evidence
    }
    w.y = nominal.y;
    w.y.segment(chosen->first, chosen->end - chosen->first) -= chosen->own * size;
    w.y.tail(rows_ - chosen->end) -= column.bottomRows(rows_ - chosen->end) * size.head<3>();
    w.b = w.x.transpose() * w.y;
    w.yy = w.y.squaredNorm();
    w.scatter = Scatter::step;
    w.size = size.head<3>().cwiseAbs().maxCoeff();
    looked_at.clear();
    Subset subset = search(w, looked_at);
    subset.nats += record_nats + options_.log_prior_unknown - penalty -
                   0.5 * size.squaredNorm() / (kPrior_mg * kPrior_mg) -
                   std::log(static_cast<double>(starts.size()));
    groups = subset.groups;
    if (!best || subset.nats > best->nats) {
      best = make_fit(w, subset, at);
      best->nats = subset.nats;
    }
  }
  return best;
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
    ForwardState here = scatter == Scatter::nominal ? nominal_at : first_guess();
    int falling = 0;
    double last = -1e300;
    std::vector<std::array<double, 2>> tried;  // size, nats
    const auto try_size = [&](double size) {
      Whitened trial = whiten(here, scatter, size);
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

double EvidenceSearch::gain_nats(const std::string& effect) const {
  double with = -1e300;
  double without = -1e300;
  for (const State& state : states_) {
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

double EvidenceSearch::held_out_nats(const std::string& effect) const {
  std::vector<int> with = best().subset.groups;
  std::vector<int> without;
  for (const int g : with) {
    if (groups_[static_cast<std::size_t>(g)].effect != effect) {
      without.push_back(g);
    }
  }
  if (without.size() == with.size()) {
    for (int g = kNuisances; g < static_cast<int>(groups_.size()); ++g) {
      if (groups_[static_cast<std::size_t>(g)].effect == effect) {
        with.push_back(g);
        break;
      }
    }
    std::sort(with.begin(), with.end());
    if (with.size() == without.size()) {
      return 0;
    }
  }
  int folds = 0;
  for (const Block& block : blocks_) {
    folds = std::max(folds, block.condition + 1);
  }
  double gain = 0;
  for (int fold = 0; fold < folds; ++fold) {
    Eigen::MatrixXd a = final_.a;
    Eigen::VectorXd b = final_.b;
    double yy = final_.yy;
    for (int row = 0; row < rows_; ++row) {
      if (blocks_[static_cast<std::size_t>(row_block_[static_cast<std::size_t>(row)])].condition ==
          fold) {
        const Eigen::VectorXd x = final_.x.row(row).transpose();
        a.noalias() -= x * x.transpose();
        b -= x * final_.y[row];
        yy -= final_.y[row] * final_.y[row];
      }
    }
    const auto predictive = [&](const std::vector<int>& groups) {
      return evidence_of(final_.a, final_.b, final_.yy, groups, nullptr) -
             evidence_of(a, b, yy, groups, nullptr);
    };
    gain += predictive(with) - predictive(without);
  }
  return gain;
}

EvidenceSearch::HeldOut EvidenceSearch::held_out() const {
  HeldOut out;
  if (rows_ == 0) {
    return out;
  }
  const Whitened w = whiten(best().state, Scatter::nominal, 0);
  int folds = 0;
  for (const Block& block : blocks_) {
    folds = std::max(folds, block.condition + 1);
  }
  // Rows in mg again: the scale that nominal noise and seating give each block's rows.
  double before = 0, after = 0, floor = 0, before_w = 0, after_w = 0;
  double tone_before = 0, tone_after = 0, mean_before = 0, mean_after = 0;
  int tones = 0;
  int n = 0;
  int in_mg = 0;
  std::vector<int> within;
  int last_block = -1;
  int k = 0;
  for (int row = 0; row < rows_; ++row) {
    const int b = row_block_[static_cast<std::size_t>(row)];
    k = b == last_block ? k + 1 : 0;
    last_block = b;
    within.push_back(k);
  }
  for (int fold = 0; fold < folds; ++fold) {
    Eigen::MatrixXd a = w.a;
    Eigen::VectorXd b = w.b;
    double yy = w.yy;
    std::vector<int> rows;
    for (int row = 0; row < rows_; ++row) {
      if (blocks_[static_cast<std::size_t>(row_block_[static_cast<std::size_t>(row)])].condition ==
          fold) {
        const Eigen::VectorXd x = w.x.row(row).transpose();
        a.noalias() -= x * x.transpose();
        b -= x * w.y[row];
        yy -= w.y[row] * w.y[row];
        rows.push_back(row);
      }
    }
    if (rows.empty()) {
      continue;
    }
    Posterior nothing;
    Posterior accepted;
    evidence_of(a, b, yy, {}, &nothing);
    evidence_of(a, b, yy, best().subset.groups, &accepted);
    for (const int row : rows) {
      const auto residual = [&](const Posterior& p) {
        double r = w.y[row];
        for (std::size_t c = 0; c < p.columns.size(); ++c) {
          r -= w.x(row, p.columns[c]) * p.mean[static_cast<Eigen::Index>(c)];
        }
        return r;
      };
      const Block& block =
          blocks_[static_cast<std::size_t>(row_block_[static_cast<std::size_t>(row)])];
      const int i = within[static_cast<std::size_t>(row)];
      const Eigen::MatrixXd lever = seating_lever(block);
      const double scale2 =
          block.white_mg2(i, i) + std::pow(kNominalSeating_deg, 2) * lever.row(i).squaredNorm();
      const double r0 = residual(nothing);
      const double r1 = residual(accepted);
      if (i < 6) {  // harmonics of folding tones are known too badly to count in mg
        before += r0 * r0 * scale2;
        after += r1 * r1 * scale2;
        floor += scale2;
        ++in_mg;
      }
      before_w += r0 * r0;
      after_w += r1 * r1;
      const bool tone_row = i >= 3;
      (tone_row ? tone_before : mean_before) += r0 * r0;
      (tone_row ? tone_after : mean_after) += r1 * r1;
      tones += tone_row ? 1 : 0;
      ++n;
    }
  }
  const double dn = std::max(1, n);
  out.rows = n;
  out.before_mg = std::sqrt(before / std::max(1, in_mg));
  out.after_mg = std::sqrt(after / std::max(1, in_mg));
  out.floor_mg = std::sqrt(floor / std::max(1, in_mg));
  out.before_sigma = std::sqrt(before_w / dn);
  out.after_sigma = std::sqrt(after_w / dn);
  const double dt = std::max(1, tones);
  const double dm = std::max(1, n - tones);
  out.tone_before_sigma = tones > 0 ? std::sqrt(tone_before / dt) : 0;
  out.tone_after_sigma = tones > 0 ? std::sqrt(tone_after / dt) : 0;
  out.mean_before_sigma = std::sqrt(mean_before / dm);
  out.mean_after_sigma = std::sqrt(mean_after / dm);
  return out;
}

}  // namespace sixpoint::gap

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "gap/explain/evidence.h"

namespace sixpoint::gap {
namespace {

// Step of a numerical derivative in prior standard deviations: the model is a polynomial of third
// order, so that the step's error is far below the noise.
constexpr double kDerivativeStep = 0.02;
// Relative addition to the diagonal: keeps the Cholesky decomposition finite.
constexpr double kRegular = 1e-9;
// A rotation by one degree moves 1 g by this many mg (1000 pi / 180).
constexpr double kMgPerDegree = 17.45;

// Placements are independent of each other under these kinds of scatter.
bool by_placement_only(Scatter scatter) {
  return scatter == Scatter::nominal || scatter == Scatter::seating ||
         scatter == Scatter::by_placement;
}

// Covariance of two blocks for one kind of scatter of the given size, and bad seats beside it; of a
// block with itself the noise included. `first`: the recording's first block.
Eigen::MatrixXd covariance_of(const Block& a, const Block& b, Scatter scatter, double size,
                              double seats_deg, const Block& first) {
  Eigen::MatrixXd v =
      &a == &b ? a.white_mg2 : Eigen::MatrixXd(Eigen::MatrixXd::Zero(a.size(), b.size()));
  const bool one_placement = a.placement == b.placement;
  const bool one_pose = scatter == Scatter::by_pose && same_pose(a, b);
  if (one_placement || one_pose) {
    const double seat_deg =
        std::hypot(kNominalSeating_deg, scatter == Scatter::seating ? size : seats_deg);
    // Scatter by pose may also be a rotation.
    const double turn_deg = one_pose ? size / kMgPerDegree : 0;
    const double sd_deg = one_placement ? std::hypot(seat_deg, turn_deg) : turn_deg;
    v += sd_deg * sd_deg * seating_lever(a) * seating_lever(b).transpose();
    // To second order a turn by (x, y) takes x^2 + y^2 off: its mean square is 8 sd^4.
    const double loss = 8 * std::pow(sd_deg * M_PI / 180, 4);
    v += loss * seating_loss(a) * seating_loss(b).transpose();
  }
  if (scatter == Scatter::seat_walks) {
    const int steps = 1 + std::min(a.placement, b.placement) - first.placement;
    v += size * size * steps * seating_lever(a) * seating_lever(b).transpose();
  } else if (scatter != Scatter::nominal && scatter != Scatter::seating) {
    const double start_s = first.middle_s - first.seconds / 2;
    const double c = size * size * scatter_kernel(scatter, a, b, start_s);
    v.topLeftCorner<3, 3>().diagonal().array() += c;
  }
  if (&a == &b && scatter == Scatter::by_placement && a.tone) {
    const double sd = size * a.filter_gain * a.vibration_lab_g.norm();
    v.diagonal().tail(a.size() - 3).array() += sd * sd;
  }
  return v;
}

}  // namespace

// The columns of one group for one block, by differences.
void EvidenceModel::add_columns(const ForwardState& at, const Block& block,
                                const Eigen::VectorXd& base, int g, Eigen::Index row,
                                Eigen::MatrixXd& x, Eigen::VectorXd& theta) const {
  const ParameterGroup& own = group(g);
  const bool same_shape = own.effect == "warm_up"      ? own.tau_s == at.warm_up_tau_s
                          : own.effect == "hysteresis" ? own.shape == at.hysteresis_shape
                                                       : true;
  for (int i = 0; i < own.count; ++i) {
    ForwardState moved = at;
    double here = parameter(at, own.first + i);
    if (!same_shape) {
      // Another shape of the same effect: its columns are about zero.
      for (int k = 0; k < own.count; ++k) {
        parameter(moved, own.first + k) = 0;
      }
      moved.warm_up_tau_s = own.tau_s > 0 ? own.tau_s : moved.warm_up_tau_s;
      moved.hysteresis_shape = own.shape;
      here = 0;
    }
    const Eigen::VectorXd from = same_shape ? base : predict(moved, block, options_.lsb_mg);
    // Truncation is off (0) or on (1): its step leads to the other.
    const bool truncation = own.effect == "truncation";
    const double step = truncation ? 1.0 : kDerivativeStep * own.sd_of(i);
    const double sign = truncation && here > 0.5 ? -1 : 1;
    parameter(moved, own.first + i) = here + sign * step;
    x.block(row, first_column(g) + i, block.size(), 1) =
        sign * (predict(moved, block, options_.lsb_mg) - from) / step;
    theta[first_column(g) + i] = here;
  }
}

Eigen::MatrixXd EvidenceModel::linearise(const ForwardState& at) const {
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(rows(), columns_ + 1);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(rows());
  Eigen::VectorXd theta = Eigen::VectorXd::Zero(columns_);
  Eigen::Index row = 0;
  for (const Block& block : blocks_) {
    const Eigen::VectorXd base = predict(at, block, options_.lsb_mg);
    y.segment(row, block.size()) = block.value_mg - base;
    int next_column = 0;
    for (int g = 0; g < group_count(); ++g) {
      if (first_column(g) == next_column) {  // the others share columns
        add_columns(at, block, base, g, row, x, theta);
        next_column += group(g).count;
      }
    }
    row += block.size();
  }
  x.col(columns_) = y + x.leftCols(columns_) * theta;
  return x;
}

// Whitens the rows of blocks first..last, from first_row on; returns how many rows they have.
Eigen::Index EvidenceModel::whiten_blocks(std::size_t first, std::size_t last, Scatter scatter,
                                          double size, double seats_deg, Eigen::Index first_row,
                                          double& half_log_det, Eigen::MatrixXd& rows) const {
  Eigen::Index count = 0;
  for (std::size_t b = first; b < last; ++b) {
    count += blocks_[b].size();
  }
  Eigen::MatrixXd v = Eigen::MatrixXd::Zero(count, count);
  Eigen::Index ri = 0;
  for (std::size_t i = first; i < last; ++i) {
    const Block& bi = blocks_[i];
    Eigen::Index rj = ri;
    for (std::size_t j = i; j < last; ++j) {
      const Block& bj = blocks_[j];
      const Eigen::MatrixXd c = covariance_of(bi, bj, scatter, size, seats_deg, blocks_.front());
      v.block(ri, rj, bi.size(), bj.size()) = c;
      if (i != j) {
        v.block(rj, ri, bj.size(), bi.size()) = c.transpose();
      }
      rj += bj.size();
    }
    ri += bi.size();
  }
  v.diagonal().array() *= 1 + kRegular;
  const Eigen::LLT<Eigen::MatrixXd> llt(v);
  llt.matrixL().solveInPlace(rows.middleRows(first_row, count));
  half_log_det += half_log_determinant(llt);
  return count;
}

double EvidenceModel::whiten_rows(Scatter scatter, double size, Eigen::MatrixXd& rows,
                                  double seats_deg) const {
  double half_log_det = 0;
  Eigen::Index first_row = 0;
  for (std::size_t first = 0; first < blocks_.size();) {
    std::size_t last = by_placement_only(scatter) ? first : blocks_.size();
    while (last < blocks_.size() && blocks_[last].placement == blocks_[first].placement) {
      ++last;
    }
    first_row +=
        whiten_blocks(first, last, scatter, size, seats_deg, first_row, half_log_det, rows);
    first = last;
  }
  return half_log_det;
}

Whitened EvidenceModel::whiten(Eigen::MatrixXd linear, Scatter scatter, double size,
                               double seats_deg) const {
  Whitened w;
  w.scatter = scatter;
  w.size = size;
  w.seats_deg = seats_deg;
  w.half_log_det = whiten_rows(scatter, size, linear, seats_deg);
  w.y = linear.col(columns_);
  w.x = linear.leftCols(columns_);
  w.sums = {w.x.transpose() * w.x, w.x.transpose() * w.y, w.y.squaredNorm()};
  if (options_.record_nats) {
    w.outside_nats = options_.record_nats(scatter, size);
  }
  if (scatter != Scatter::nominal) {
    w.outside_nats += scatter_log_prior(scatter);
  }
  if (seats_deg > 0) {
    w.outside_nats += scatter_log_prior(Scatter::seating);
  }
  return w;
}

}  // namespace sixpoint::gap

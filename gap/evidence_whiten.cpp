#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "gap/evidence.h"

namespace sixpoint::gap {

// Columns of all groups, and on the right the values that they add up to.
Eigen::MatrixXd EvidenceSearch::linearise(const ForwardState& at) const {
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(rows_, columns_ + 1);
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
        const double step = group.effect == "truncation" ? 1.0 : 0.02 * group.sd_of(i);
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
  x.col(columns_) = y + x.leftCols(columns_) * theta;
  return x;
}

// Divides rows by the square root of their covariance; half the logarithm of its determinant.
double EvidenceSearch::whiten_rows(Scatter scatter, double size, Eigen::MatrixXd& m) const {
  double half_log_det = 0;
  const auto seat = [&](const Block& a, const Block& b, double sd_deg) -> Eigen::MatrixXd {
    return sd_deg * sd_deg * seating_lever(a) * seating_lever(b).transpose();
  };
  const double seat_sd =
      scatter == Scatter::seating ? std::hypot(kNominalSeating_deg, size) : kNominalSeating_deg;
  const bool dense = scatter != Scatter::nominal && scatter != Scatter::seating &&
                     scatter != Scatter::by_placement;
  const double start_s =
      blocks_.empty() ? 0 : blocks_.front().middle_s - blocks_.front().seconds / 2;

  const auto whiten_some = [&](std::size_t first, std::size_t last, int first_row) {
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
          const double c = size * size * scatter_kernel(scatter, bi, bj, start_s);
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
    llt.matrixL().solveInPlace(m.middleRows(first_row, size_rows));
    half_log_det += llt.matrixLLT().diagonal().array().log().sum();
    return size_rows;
  };
  if (dense) {
    whiten_some(0, blocks_.size(), 0);
  } else {
    int first_row = 0;
    for (std::size_t first = 0; first < blocks_.size();) {
      std::size_t last = first;
      while (last < blocks_.size() && blocks_[last].placement == blocks_[first].placement) {
        ++last;
      }
      first_row += whiten_some(first, last, first_row);
      first = last;
    }
  }
  return half_log_det;
}

// What the data look like from one linearisation, under one covariance.
Whitened EvidenceSearch::whiten(Eigen::MatrixXd x, Scatter scatter, double size) const {
  Whitened w;
  w.scatter = scatter;
  w.size = size;
  w.row_block = row_block_;
  w.half_log_det = whiten_rows(scatter, size, x);
  w.y = x.col(columns_);
  w.x = x.leftCols(columns_);
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

}  // namespace sixpoint::gap

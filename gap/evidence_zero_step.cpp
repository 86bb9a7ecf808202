#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "gap/evidence.h"

namespace sixpoint::gap {

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

}  // namespace sixpoint::gap

// A zero that moves once looks like a random walk, a drift or warming up. Every placement, and
// every block inside one, is tried as the first after the step, together with every subset of
// effects.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "gap/explain/explanation.h"

namespace sixpoint::gap {
namespace {

constexpr double kStepPrior_mg = 5;  // convention: prior standard deviation per axis
constexpr std::size_t kLeastStarts = 6;
constexpr int kRounds = 3;  // step and subset in turn

// One moment of the step, with whitened columns. Placements are independent of each other: a step
// reaches into its own placement in part and into all later ones in full.
struct Start {
  int first = 0;        // row of its placement
  int end = 0;          // row after its placement
  Eigen::MatrixXd own;  // rows first..end; 3 columns, or 6 where the step falls inside a block
  bool whole = false;   // the whole placement follows the step
};

struct Starts {
  std::vector<Start> list;       // in the order of time
  Eigen::MatrixXd whole_column;  // for every row: its placement follows the step
};

// Covariance of the blocks of one placement: noise and nominal seating.
Eigen::MatrixXd placement_covariance(const std::vector<Block>& blocks, std::size_t first,
                                     std::size_t last, Eigen::Index rows) {
  Eigen::MatrixXd v = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::Index ri = 0;
  for (std::size_t i = first; i < last; ++i) {
    Eigen::Index rj = 0;
    for (std::size_t j = first; j < last; ++j) {
      v.block(ri, rj, blocks[i].size(), blocks[j].size()) =
          kNominalSeating_deg * kNominalSeating_deg * seating_lever(blocks[i]) *
          seating_lever(blocks[j]).transpose();
      rj += blocks[j].size();
    }
    v.block(ri, ri, blocks[i].size(), blocks[i].size()) += blocks[i].white_mg2;
    ri += blocks[i].size();
  }
  return v;
}

// The starts inside one placement, whose rows begin at `row`; the last one is the whole placement.
std::vector<Start> starts_backward(const std::vector<Block>& blocks, std::size_t first,
                                   std::size_t last, int row) {
  Eigen::Index rows = 0;
  for (std::size_t i = first; i < last; ++i) {
    rows += blocks[i].size();
  }
  const Eigen::LLT<Eigen::MatrixXd> llt(placement_covariance(blocks, first, last, rows));
  Eigen::MatrixXd from = Eigen::MatrixXd::Zero(rows, 3);
  std::vector<Start> starts;
  Eigen::Index ri = rows;
  for (std::size_t i = last; i-- > first;) {
    ri -= blocks[i].size();
    // A step inside this block leaves its mean anywhere: three numbers of its own.
    Eigen::MatrixXd inside = Eigen::MatrixXd::Zero(rows, 6);
    inside.leftCols<3>() = from;
    inside.block<3, 3>(ri, 3) = Eigen::Matrix3d::Identity();
    from.block<3, 3>(ri, 0) = Eigen::Matrix3d::Identity();
    const int end = row + static_cast<int>(rows);
    starts.push_back({row, end, std::move(inside), false});
    starts.push_back({row, end, from, i == first});
    for (std::size_t k = starts.size() - 2; k < starts.size(); ++k) {
      llt.matrixL().solveInPlace(starts[k].own);
    }
  }
  return starts;
}

Starts starts_of(const EvidenceModel& model) {
  const std::vector<Block>& blocks = model.blocks();
  Starts starts{{}, Eigen::MatrixXd::Zero(model.rows(), 3)};
  int row = 0;
  for (std::size_t first = 0; first < blocks.size();) {
    std::size_t last = first;
    while (last < blocks.size() && blocks[last].placement == blocks[first].placement) {
      ++last;
    }
    const std::vector<Start> own = starts_backward(blocks, first, last, row);
    const Start& whole = own.back();
    starts.whole_column.middleRows(row, whole.end - row) = whole.own;
    starts.list.insert(starts.list.end(), own.rbegin(), own.rend());
    row = whole.end;
    first = last;
  }
  return starts;
}

struct Step {
  const Start* start = nullptr;
  Eigen::VectorXd size_mg;
  double occam_nats = 0;  // what the free sizes cost
};

// The likeliest start, the subset's parameters being free beside it. `residual`: what the subset
// leaves of the values; `used`: its columns.
Step likeliest_step(const Starts& starts, const Eigen::VectorXd& residual,
                    const Eigen::MatrixXd& used, const Posterior& posterior) {
  // Sums over the placements that follow the one in question.
  Eigen::Matrix3d later = Eigen::Matrix3d::Zero();
  Eigen::Vector3d later_b = Eigen::Vector3d::Zero();
  Eigen::MatrixXd later_used = Eigen::MatrixXd::Zero(used.cols(), 3);
  double most = kNoEvidence_nats;
  Step step;
  for (std::size_t k = starts.list.size(); k-- > 1;) {
    const Start& start = starts.list[k];
    const int rows = start.end - start.first;
    Eigen::MatrixXd a = start.own.transpose() * start.own;
    Eigen::VectorXd b = start.own.transpose() * residual.segment(start.first, rows);
    // What the subset's parameters would take over from the step.
    Eigen::MatrixXd cross = used.middleRows(start.first, rows).transpose() * start.own;
    a.topLeftCorner<3, 3>() += later;
    b.head<3>() += later_b;
    cross.leftCols<3>() += later_used;
    if (start.whole) {
      later = a.topLeftCorner<3, 3>();
      later_b = b.head<3>();
      later_used = cross.leftCols<3>();
    }
    a -= cross.transpose() * posterior.covariance * cross;
    a.diagonal().array() += 1 / (kStepPrior_mg * kStepPrior_mg);
    const Eigen::LLT<Eigen::MatrixXd> llt(a);
    const Eigen::VectorXd size_mg = llt.solve(b);
    const double occam_nats =
        half_log_determinant(llt) + static_cast<double>(a.rows()) * std::log(kStepPrior_mg);
    if (const double nats = 0.5 * b.dot(size_mg) - occam_nats; nats > most) {
      most = nats;
      step = {&start, size_mg, occam_nats};
    }
  }
  return step;
}

// The values with the step taken off.
Whitened without_step(const Whitened& nominal, const Starts& starts, const Step& step) {
  const Start& start = *step.start;
  const Eigen::Index later = nominal.y.size() - start.end;
  Whitened w = nominal;
  w.y.segment(start.first, start.end - start.first) -= start.own * step.size_mg;
  w.y.tail(later) -= starts.whole_column.bottomRows(later) * step.size_mg.head<3>();
  w.sums.b = w.x.transpose() * w.y;
  w.sums.yy = w.y.squaredNorm();
  w.scatter = Scatter::step;
  w.size = step.size_mg.head<3>().cwiseAbs().maxCoeff();
  return w;
}

}  // namespace

std::optional<Fit> fit_zero_step(const EvidenceModel& model, const Whitened& nominal,
                                 const ForwardState& at) {
  const Starts starts = starts_of(model);
  if (starts.list.size() < kLeastStarts) {
    return std::nullopt;
  }
  const auto& record_nats = model.options().record_nats;
  // A zero that moves shows in the records as unknown slow noise does.
  const double in_records = record_nats ? record_nats(Scatter::by_time, 1) : 0;
  NormalSums sums = nominal.sums;
  std::vector<int> groups;
  std::optional<Fit> best;
  for (int round = 0; round < kRounds; ++round) {
    const Posterior posterior = model.solve(sums, groups).posterior();
    const Step step = likeliest_step(starts, residual_of(nominal, posterior),
                                     used_columns(nominal.x, posterior), posterior);
    if (step.start == nullptr) {
      return std::nullopt;  // no step has a finite evidence
    }
    const Whitened w = without_step(nominal, starts, step);
    std::vector<Subset> tried;
    Subset subset = model.search(w, tried);
    subset.nats += in_records + kLogPriorUnknown - step.occam_nats -
                   0.5 * step.size_mg.squaredNorm() / (kStepPrior_mg * kStepPrior_mg) -
                   std::log(static_cast<double>(starts.list.size()));
    sums = w.sums;
    groups = subset.groups;
    if (!best || subset.nats > best->nats) {
      best = model.make_fit(w, subset, at);
    }
  }
  return best;
}

}  // namespace sixpoint::gap

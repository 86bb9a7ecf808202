#include <algorithm>
#include <cmath>

#include "gap/evidence.h"

namespace sixpoint::gap {

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
  const Whitened w = whiten(linear_best_, Scatter::nominal, 0);
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

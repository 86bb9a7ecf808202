#include <algorithm>
#include <cmath>

#include "gap/explain/explanation.h"

namespace sixpoint::gap {
namespace {

int folds_of(const std::vector<Block>& blocks) {
  int folds = 0;
  for (const Block& block : blocks) {
    folds = std::max(folds, block.condition + 1);
  }
  return folds;
}

struct Fold {
  NormalSums others;      // of all rows but the fold's
  std::vector<int> rows;  // of the fold
};

Fold leave_out(const EvidenceModel& model, const Whitened& w, int fold) {
  Fold left{w.sums, {}};
  for (int row = 0; row < model.rows(); ++row) {
    if (model.block_of_row(row).condition == fold) {
      const Eigen::VectorXd x = w.x.row(row).transpose();
      left.others.a.noalias() -= x * x.transpose();
      left.others.b -= x * w.y[row];
      left.others.yy -= w.y[row] * w.y[row];
      left.rows.push_back(row);
    }
  }
  return left;
}

double residual_of_row(const Whitened& w, int row, const Posterior& posterior) {
  double residual = w.y[row];
  for (std::size_t c = 0; c < posterior.columns.size(); ++c) {
    residual -= w.x(row, posterior.columns[c]) * posterior.mean[static_cast<Eigen::Index>(c)];
  }
  return residual;
}

// A standard deviation far above those of means and tones, which are tenths of a mg.
constexpr double kBadlyKnown_mg = 2;

// Mean squares of predictions, with nuisances alone and with the explanation.
struct Squares {
  double before = 0;
  double after = 0;
  int count = 0;
  void add(double r0, double r1, double scale2 = 1) {
    before += r0 * r0 * scale2;
    after += r1 * r1 * scale2;
    ++count;
  }
  double rms(double sum) const { return std::sqrt(sum / std::max(1, count)); }
};

}  // namespace

double Explanation::held_out_nats(const std::string& effect) const {
  std::vector<int> with = best().subset.groups;
  std::vector<int> without = with;
  const std::vector<int> own = model_.groups_of(effect);
  std::erase_if(without, [&](int g) { return std::find(own.begin(), own.end(), g) != own.end(); });
  if (without.size() == with.size()) {
    if (own.empty()) {
      return 0;
    }
    with = with_group(with, own.front());
  }
  double gain = 0;
  for (int fold = 0; fold < folds_of(model_.blocks()); ++fold) {
    const NormalSums others = leave_out(model_, data_, fold).others;
    const auto predictive = [&](const std::vector<int>& groups) {
      return model_.solve(data_.sums, groups).nats - model_.solve(others, groups).nats;
    };
    gain += predictive(with) - predictive(without);
  }
  return gain;
}

Explanation::Named Explanation::of_named(const std::set<std::string>& named) const {
  Named out;
  out.counts.assign(kNuisanceParameters, true);
  for (const int g : best().subset.groups) {
    if (named.count(model_.group(g).effect) == 0) {
      continue;
    }
    out.groups.push_back(g);
    for (int i = 0; i < model_.group(g).count; ++i) {
      out.counts.push_back(i < 3);
    }
  }
  return out;
}

std::vector<double> Explanation::left_over_sigma(const std::set<std::string>& named) const {
  const auto [groups, counts] = of_named(named);
  const Whitened w = model_.whiten(linear_, Scatter::nominal, 0);
  const Posterior fitted = model_.solve(w.sums, groups).posterior();
  Eigen::VectorXd left_mg = linear_.col(model_.columns());
  for (std::size_t c = 0; c < counts.size(); ++c) {
    if (counts[c]) {
      left_mg -= linear_.col(fitted.columns[c]) * fitted.mean[static_cast<Eigen::Index>(c)];
    }
  }
  const auto named_size = [&](Scatter kind) {
    return named.count(std::string(to_string(kind))) != 0 ? best().size_of(kind) : 0;
  };
  const Scatter scatter = best().scatter;
  const double size2 = scatter == Scatter::seating ? 0 : std::pow(named_size(scatter), 2);
  const double seats2 = std::pow(named_size(Scatter::seating), 2);
  const std::vector<Block>& blocks = model_.blocks();
  const double start_s = blocks.empty() ? 0 : blocks.front().middle_s - blocks.front().seconds / 2;
  std::vector<double> sigma;
  for (int row = 0; row < model_.rows(); ++row) {
    const Block& block = model_.block_of_row(row);
    const int feature = model_.feature_of_row(row);
    double variance_mg2 = nominal_variance_mg2(block, feature) +
                          seats2 * seating_lever(block).row(feature).squaredNorm();
    if (feature < kToneAmplitude) {
      variance_mg2 += size2 * scatter_kernel(scatter, block, block, start_s);
    }
    sigma.push_back(left_mg[row] / std::sqrt(variance_mg2));
  }
  return sigma;
}

Explanation::HeldOut Explanation::held_out(const std::set<std::string>& named) const {
  HeldOut out;
  const auto [groups, counts] = of_named(named);
  if (model_.rows() == 0) {
    return out;
  }
  const Whitened w = model_.whiten(linear_, Scatter::nominal, 0);
  Squares all, tones, means, in_mg;
  double floor2_mg2 = 0;
  for (int fold = 0; fold < folds_of(model_.blocks()); ++fold) {
    const Fold left = leave_out(model_, w, fold);
    if (left.rows.empty()) {
      continue;
    }
    const Posterior nothing = model_.solve(left.others, {}).posterior();
    Posterior accepted = model_.solve(left.others, groups).posterior();
    for (std::size_t c = 0; c < counts.size(); ++c) {
      accepted.mean[static_cast<Eigen::Index>(c)] *= counts[c] ? 1 : 0;
    }
    for (const int row : left.rows) {
      const int feature = model_.feature_of_row(row);
      const double r0 = residual_of_row(w, row, nothing);
      const double r1 = residual_of_row(w, row, accepted);
      // Known too badly to count in mg are harmonics of tones that fold back, and what they fold
      // on.
      const double scale2 = nominal_variance_mg2(model_.block_of_row(row), feature);
      if (feature < kSecondHarmonic && scale2 <= kBadlyKnown_mg * kBadlyKnown_mg) {
        in_mg.add(r0, r1, scale2);
        floor2_mg2 += scale2;
      }
      all.add(r0, r1);
      (feature >= kToneAmplitude ? tones : means).add(r0, r1);
    }
  }
  out.rows = all.count;
  out.before_mg = in_mg.rms(in_mg.before);
  out.after_mg = in_mg.rms(in_mg.after);
  out.floor_mg = in_mg.rms(floor2_mg2);
  out.before_sigma = all.rms(all.before);
  out.after_sigma = all.rms(all.after);
  out.tone_before_sigma = tones.rms(tones.before);
  out.tone_after_sigma = tones.rms(tones.after);
  out.mean_before_sigma = means.rms(means.before);
  out.mean_after_sigma = means.rms(means.after);
  return out;
}

}  // namespace sixpoint::gap

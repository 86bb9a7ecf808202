#include "gap/explain/evidence.h"

#include <algorithm>

namespace sixpoint::gap {

bool Fit::contains(const std::string& effect) const {
  return std::any_of(groups.begin(), groups.end(),
                     [&](const ParameterGroup& g) { return g.effect == effect; });
}

EvidenceModel::EvidenceModel(const std::vector<Block>& blocks, EvidenceOptions options)
    : blocks_(blocks), options_(std::move(options)) {
  for (const ParameterGroup& group : parameter_groups(options_.learnt)) {
    if (group.effect == "gain" || group.effect == "offset" || allowed(group.effect)) {
      // Groups that differ in their prior size only share their columns.
      const auto same = std::find_if(groups_.begin(), groups_.end(), [&](const ParameterGroup& g) {
        return g.first == group.first && g.tau_s == group.tau_s && g.shape == group.shape;
      });
      first_column_.push_back(same == groups_.end()
                                  ? columns_
                                  : first_column(static_cast<int>(same - groups_.begin())));
      columns_ += same == groups_.end() ? group.count : 0;
      groups_.push_back(group);
    }
  }
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    row_block_.insert(row_block_.end(), static_cast<std::size_t>(blocks[b].size()),
                      static_cast<int>(b));
  }
}

std::vector<int> EvidenceModel::groups_of(const std::string& effect) const {
  std::vector<int> found;
  for (int g = 0; g < group_count(); ++g) {
    if (group(g).effect == effect) {
      found.push_back(g);
    }
  }
  return found;
}

int EvidenceModel::widest(int g) const {
  int found = g;
  const bool may_widen = !group(g).learnt && group(g).curve_sd == 0;
  for (int other = 0; other < group_count() && may_widen; ++other) {
    if (first_column(other) == first_column(g) && !group(other).learnt &&
        group(other).prior_sd > group(found).prior_sd) {
      found = other;
    }
  }
  return found;
}

void EvidenceModel::set_time_constant(int g, double tau_s) {
  for (int other = 0; other < group_count(); ++other) {
    if (first_column(other) == first_column(g)) {
      groups_[static_cast<std::size_t>(other)].tau_s = tau_s;
    }
  }
}

int EvidenceModel::feature_of_row(int row) const {
  const auto at = row_block_.begin() + row;
  return static_cast<int>(at - std::lower_bound(row_block_.begin(), at, *at));
}

ForwardState EvidenceModel::first_guess() const {
  // A weak pull to gain 1 (mg^2), so that a single pose gives a finite gain.
  constexpr double kPull_mg2 = 1e4;
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
    const double mean_x = n > 0 ? x / n : 0;
    const double mean_y = n > 0 ? y / n : 0;
    const double sxx = xx - n * mean_x * mean_x;
    const double sxy = xy - n * mean_x * mean_y;
    state.gain[a] = std::clamp((sxy + kPull_mg2) / (sxx + kPull_mg2), 0.2, 3.0);
    state.offset_mg[a] = mean_y - state.gain[a] * mean_x;
  }
  return state;
}

std::vector<int> with_nuisances(const std::vector<int>& groups) {
  std::vector<int> all = {0, 1};
  all.insert(all.end(), groups.begin(), groups.end());
  return all;
}

std::vector<int> with_group(std::vector<int> groups, int g) {
  groups.insert(std::upper_bound(groups.begin(), groups.end(), g), g);
  return groups;
}

Eigen::MatrixXd used_columns(const Eigen::MatrixXd& x, const Posterior& posterior) {
  return x(Eigen::all, posterior.columns);
}

Eigen::VectorXd residual_of(const Whitened& w, const Posterior& posterior) {
  Eigen::VectorXd residual = w.y;
  for (std::size_t k = 0; k < posterior.columns.size(); ++k) {
    residual -= w.x.col(posterior.columns[k]) * posterior.mean[static_cast<Eigen::Index>(k)];
  }
  return residual;
}

}  // namespace sixpoint::gap

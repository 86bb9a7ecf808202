// The values of all blocks as one Gaussian vector, the parameters of some groups integrated out:
// the evidence by way of the covariance of the values instead of the normal equations of the
// parameters.
#pragma once

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "gap/explain/evidence.h"
#include "gap/explain/scatter.h"

namespace sixpoint::tests {

struct Marginal {
  Eigen::VectorXd off;  // values less their prior mean
  Eigen::MatrixXd covariance;

  double nats() const {  // without the constant
    const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
    return -0.5 * off.dot(llt.solve(off)) - gap::half_log_determinant(llt);
  }
};

// Nuisances and `groups`; dwells alone, scatter nominal, a placement for each. `linear`: of
// linearise().
inline Marginal marginal(const gap::EvidenceModel& model, const Eigen::MatrixXd& linear,
                         const std::vector<int>& groups) {
  Marginal all{linear.col(model.columns()), Eigen::MatrixXd::Zero(model.rows(), model.rows())};
  for (Eigen::Index i = 0; i < model.rows(); i += 3) {
    const gap::Block& block = model.block_of_row(i);
    const Eigen::MatrixXd lever = gap::kNominalSeating_deg * gap::seating_lever(block);
    all.covariance.block<3, 3>(i, i) = block.white_mg2 + lever * lever.transpose();
  }
  for (const int g : gap::with_nuisances(groups)) {
    for (int k = 0; k < model.group(g).count; ++k) {
      const Eigen::VectorXd column = linear.col(model.first_column(g) + k);
      all.covariance += std::pow(model.group(g).sd_of(k), 2) * column * column.transpose();
      all.off -= model.group(g).mean_of(k) * column;
    }
  }
  return all;
}

}  // namespace sixpoint::tests

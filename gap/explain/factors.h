// What a parameter may change with during a recording: time, temperature, session, pose and others,
// as functions of the blocks that serve as regressors.
//
//   for (const Factor& factor : factors_of(blocks)) {
//     std::cout << factor.name << ": " << factor.value.cols() << " functions\n";
//   }
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "gap/explain/forward.h"

namespace sixpoint::gap {

struct Factor {
  std::string name;
  Eigen::MatrixXd value;       // block x function
  std::vector<double> weight;  // prior size of each function's coefficient
  bool in_time = false;
};

// `blocks` in the order of time, at least one. Factors that do not vary in them are left out.
std::vector<Factor> factors_of(const std::vector<Block>& blocks);

}  // namespace sixpoint::gap

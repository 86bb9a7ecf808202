#include "gap/explain/learnt_size.h"

#include <algorithm>
#include <cmath>

#include "gap/explain/decisions.h"

namespace sixpoint::gap {

double learnt_log_prior(const LearntSize& learnt) {
  const auto n = static_cast<double>(learnt.units);
  const double k = learnt.share_of_units * n;
  return std::clamp(std::log((k + 0.5) / (n - k + 0.5)), kLogPriorEffect, 0.0);
}

}  // namespace sixpoint::gap

#include "gap/adopt/mean_and_spread.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sixpoint::gap {

namespace {

struct Weighted {
  double mean = 0;
  double weight = 0;
  double chi = 0;
};

Weighted weighted(std::span<const double> values, std::span<const double> sd, double spread2) {
  Weighted out;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double w = 1 / (spread2 + sd[i] * sd[i]);
    out.weight += w;
    out.mean += w * values[i];
  }
  out.mean /= out.weight;
  for (std::size_t i = 0; i < values.size(); ++i) {
    out.chi += std::pow(values[i] - out.mean, 2) / (spread2 + sd[i] * sd[i]);
  }
  return out;
}

}  // namespace

MeanAndSpread mean_and_spread(std::span<const double> values,
                              std::span<const double> standard_uncertainty) {
  double most = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    most = std::max({most, std::abs(values[i]), standard_uncertainty[i]});
  }
  // Far below any uncertainty that means something.
  const double least = std::max(1e-9 * most, 1e-15);
  std::vector<double> sd(standard_uncertainty.begin(), standard_uncertainty.end());
  for (double& x : sd) {
    x = std::max(x, least);
  }
  MeanAndSpread out;
  out.units = values.size();
  const double freedom = static_cast<double>(values.size()) - 1;
  double spread2 = 0;
  if (freedom > 0) {
    double high = 0;
    for (const double v : values) {
      high = std::max(high, std::pow(v - values.front(), 2));
    }
    high *= 2 * static_cast<double>(values.size());
    // The sum of squares falls as the spread rises.
    if (weighted(values, sd, 0).chi > freedom) {
      double low = 0;
      constexpr int kHalvings = 200;
      for (int i = 0; i < kHalvings; ++i) {
        const double middle = (low + high) / 2;
        (weighted(values, sd, middle).chi > freedom ? low : high) = middle;
      }
      spread2 = (low + high) / 2;
    }
    out.spread = std::sqrt(spread2);
  }
  const Weighted all = weighted(values, sd, spread2);
  out.mean = all.mean;
  const bool without_any =
      spread2 == 0 && std::ranges::all_of(standard_uncertainty, [](double x) { return x == 0; });
  out.standard_uncertainty = without_any ? 0 : 1 / std::sqrt(all.weight);
  return out;
}

}  // namespace sixpoint::gap

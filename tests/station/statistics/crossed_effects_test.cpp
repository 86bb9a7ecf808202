#include "station/statistics/crossed_effects.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"

namespace sixpoint::station {
namespace {

// Runs of units crossed with places, weights of 1 and 2, two columns.
std::vector<CrossedRun> crossed_runs(Random& random) {
  std::vector<CrossedRun> runs;
  for (std::size_t unit = 0; unit < 7; ++unit) {
    for (std::size_t k = 0; k < 1 + unit % 3; ++k) {
      CrossedRun run;
      run.unit = unit;
      run.elements = {(unit + k) % 3, 3 + unit % 2};
      run.reading = Eigen::Vector2d(random.normal(), 3 + random.normal());
      run.weight = 1 + static_cast<double>(k % 2);
      runs.push_back(run);
    }
  }
  return runs;
}

using Table = std::vector<std::vector<double>>;

double acts(const CrossedRun& run, std::size_t element) {
  return std::find(run.elements.begin(), run.elements.end(), element) != run.elements.end() ? 1 : 0;
}

// The covariance of all readings of a column, with the elements that have a prior inside.
Table covariance_of(const std::vector<CrossedRun>& runs, const std::vector<HeldElement>& held,
                    const CrossedScatter& scatter) {
  Table out(runs.size(), std::vector<double>(runs.size()));
  for (std::size_t a = 0; a < runs.size(); ++a) {
    for (std::size_t b = 0; b < runs.size(); ++b) {
      out[a][b] = (runs[a].unit == runs[b].unit ? scatter.unit * scatter.unit : 0) +
                  (a == b ? scatter.run * scatter.run / runs[a].weight : 0);
      for (const HeldElement& each : held) {
        out[a][b] += acts(runs[a], each.element) * acts(runs[b], each.element) * *each.prior_sd *
                     *each.prior_sd;
      }
    }
  }
  return out;
}

// x with table * x = y, by elimination; the logarithm of the determinant is added to the last.
std::vector<double> solved(Table table, std::vector<double> y, double* log_determinant = nullptr) {
  const std::size_t size = y.size();
  for (std::size_t k = 0; k < size; ++k) {
    if (log_determinant != nullptr) {
      *log_determinant += std::log(table[k][k]);
    }
    for (std::size_t r = k + 1; r < size; ++r) {
      const double factor = table[r][k] / table[k][k];
      for (std::size_t c = k; c < size; ++c) {
        table[r][c] -= factor * table[k][c];
      }
      y[r] -= factor * y[k];
    }
  }
  for (std::size_t k = size; k-- > 0;) {
    for (std::size_t c = k + 1; c < size; ++c) {
      y[k] -= table[k][c] * y[c];
    }
    y[k] /= table[k][k];
  }
  return y;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

std::vector<double> column_of_readings(const std::vector<CrossedRun>& runs, int column) {
  std::vector<double> out;
  for (const CrossedRun& run : runs) {
    out.push_back(run.reading(column));
  }
  return out;
}

// Oracle: generalised least squares with the dense covariance of all runs (Aitken 1936).
TEST(CrossedEffects, EstimatesAreThoseOfGeneralisedLeastSquares) {
  Random random(5, 1);
  const std::vector<CrossedRun> runs = crossed_runs(random);
  const CrossedScatter scatter{0.7, 0.3};
  const CrossedEffects model(7, 5, runs);
  const std::vector<HeldElement> held = {{1, 0.5}, {4, 2.0}};
  const auto estimates = model.estimates(held, scatter);
  ASSERT_EQ(estimates.size(), 5U);
  for (std::size_t element = 0; element < 5; ++element) {
    std::vector<HeldElement> others = held;
    std::erase_if(others, [&](const HeldElement& each) { return each.element == element; });
    const Table covariance = covariance_of(runs, others, scatter);
    std::vector<double> column;
    for (const CrossedRun& run : runs) {
      column.push_back(acts(run, element));
    }
    const std::vector<double> weights = solved(covariance, column);
    const double variance = 1 / dot(column, weights);
    EXPECT_NEAR(estimates[element].variance / variance, 1, 1e-9) << element;
    for (const int c : {0, 1}) {
      EXPECT_NEAR(estimates[element].value(c), variance * dot(weights, column_of_readings(runs, c)),
                  1e-9)
          << element;
    }
  }
}

// Oracle: the density of a normal distribution with the dense covariance; weights and 2 pi are left
// out by the class, so differences between scatters are compared.
TEST(CrossedEffects, LikelihoodIsThatOfTheDenseCovariance) {
  Random random(6, 1);
  const std::vector<CrossedRun> runs = crossed_runs(random);
  const CrossedEffects model(7, 5, runs);
  const auto dense = [&](const std::vector<HeldElement>& held, const CrossedScatter& scatter) {
    double twice = 0;
    for (const int column : {0, 1}) {
      const std::vector<double> readings = column_of_readings(runs, column);
      twice += dot(readings, solved(covariance_of(runs, held, scatter), readings, &twice));
    }
    return -0.5 * twice;
  };
  const std::vector<HeldElement> held = {{0, 0.4}, {3, 1.5}};
  const double base = model.log_likelihood({}, {1, 1}) - dense({}, {1, 1});
  for (const CrossedScatter& scatter : {CrossedScatter{0.7, 0.3}, CrossedScatter{0.01, 2}}) {
    EXPECT_NEAR(model.log_likelihood({}, scatter) - dense({}, scatter), base, 1e-8);
    EXPECT_NEAR(model.log_likelihood(held, scatter) - dense(held, scatter), base, 1e-8);
  }
}

// Oracle: a balanced one-way analysis of variance, where REML is MSW and (MSB - MSW) / n (Searle,
// Casella and McCulloch 1992, 3.8). The prior is made so wide that it says nothing.
TEST(CrossedEffects, ScatterIsThatOfTheAnalysisOfVariance) {
  constexpr std::size_t kUnits = 40;
  constexpr std::size_t kRuns = 3;
  Random random(7, 1);
  std::vector<CrossedRun> runs;
  double within = 0;
  std::vector<double> means;
  double grand = 0;
  for (std::size_t u = 0; u < kUnits; ++u) {
    const double own = 2 * random.normal();
    std::vector<double> values;
    double mean = 0;
    for (std::size_t k = 0; k < kRuns; ++k) {
      values.push_back(5 + own + 0.5 * random.normal());
      mean += values.back() / kRuns;
      runs.push_back({u, {0}, Eigen::VectorXd::Constant(1, values.back()), 1});
    }
    for (const double value : values) {
      within += (value - mean) * (value - mean) / (kUnits * (kRuns - 1));
    }
    means.push_back(mean);
    grand += mean / kUnits;
  }
  double between = 0;
  for (const double mean : means) {
    between += kRuns * (mean - grand) * (mean - grand) / (kUnits - 1);
  }
  const CrossedScatter found =
      CrossedEffects(kUnits, 1, runs).learn_scatter({{0, std::nullopt}}, {{1, 1}, 1000});
  EXPECT_NEAR(found.run / std::sqrt(within), 1, 0.02);
  EXPECT_NEAR(found.unit / std::sqrt((between - within) / kRuns), 1, 0.02);
}

TEST(CrossedEffects, WithoutRepeatsThePriorStands) {
  const std::vector<CrossedRun> runs = {{0, {0}, Eigen::VectorXd::Constant(1, 3.0), 1}};
  const CrossedScatter found =
      CrossedEffects(1, 1, runs).learn_scatter({{0, std::nullopt}}, {{0.4, 0.02}, 1.5});
  EXPECT_NEAR(found.unit, 0.4, 0.4 * 0.05);
  EXPECT_NEAR(found.run, 0.02, 0.02 * 0.05);
}

// Two elements that act on the same runs: nothing is known of one beside the other without prior.
TEST(CrossedEffects, WhatCannotBeToldApartHasNoEstimate) {
  std::vector<CrossedRun> runs;
  for (std::size_t u = 0; u < 4; ++u) {
    runs.push_back({u, {0, 1}, Eigen::VectorXd::Constant(1, 1.0), 1});
  }
  const auto estimates = CrossedEffects(4, 3, runs).estimates({{0, std::nullopt}}, {1, 0.1});
  EXPECT_TRUE(std::isfinite(estimates[0].variance));
  EXPECT_TRUE(std::isinf(estimates[1].variance));
  EXPECT_TRUE(std::isinf(estimates[2].variance)) << "it acts on no run";
}

}  // namespace
}  // namespace sixpoint::station

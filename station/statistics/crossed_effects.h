// What readings of many units have in common: effects of places and groups, crossed with units.
//
//   CrossedEffects model(units, elements, std::move(runs));
//   const CrossedScatter scatter = model.learn_scatter(held, prior);
//   for (const ElementEstimate& each : model.estimates(held, scatter)) {
//     std::cout << each.value[0] << " +- " << std::sqrt(each.variance) << '\n';
//   }
//
// The model, for each of the columns of a reading alike and independently:
//
//     reading of a run = its unit's own value + the effects of its elements + scatter of the run
//
// Units' values are normal about 0 with one standard deviation, scatter with another, divided by
// the square root of the run's weight. An element (a jig, a station, a lot, the mean of all runs)
// is one unknown number a column. Elements that are `held` are in the model, with a normal prior or
// with none; all others are 0. The two standard deviations are learnt by the likelihood of the
// readings alone, with the elements integrated out (REML where they have no prior; Patterson and
// Thompson 1971, Biometrika 58, 545), times a prior that is normal in the logarithm: where nothing
// can be learnt, its median stands.
//
// Units are eliminated in closed form, so that only sums over each unit's runs are kept: the cost
// is linear in the runs, and there is a dense matrix of the held elements only. Immutable after the
// constructor; any thread.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

namespace sixpoint::station {

struct CrossedRun {
  std::size_t unit = 0;
  std::vector<std::size_t> elements;  // that act on it; each once
  Eigen::VectorXd reading;            // as many columns in every run
  double weight = 1;                  // placements that its reading is the mean of
};

struct HeldElement {
  std::size_t element = 0;
  std::optional<double> prior_sd;  // none: nothing is known of it beforehand
};

struct CrossedScatter {
  double unit = 1;  // standard deviation between units
  double run = 1;   // between runs of one unit, of weight 1
};
struct ScatterPrior {
  CrossedScatter median;
  double log_sd = 1.5;  // a factor of 4.5 either way: a few units are enough to overrule it
};

// An element as the readings alone have it, nothing known of it beforehand, with all other held
// elements in the model as they are. For one that is not held: if it were.
struct ElementEstimate {
  Eigen::VectorXd value;
  double variance = 0;  // of each column; infinite where the readings cannot tell it from others
};

class CrossedEffects {
 public:
  // Units and elements are numbered from 0. At least one run.
  CrossedEffects(std::size_t units, std::size_t elements, std::vector<CrossedRun> runs);

  // `near`: where the search begins; the prior's medians where nothing is known.
  CrossedScatter learn_scatter(const std::vector<HeldElement>& held, const ScatterPrior& prior,
                               const std::optional<CrossedScatter>& near = std::nullopt) const;
  // Of every element, in their order.
  std::vector<ElementEstimate> estimates(const std::vector<HeldElement>& held,
                                         const CrossedScatter& scatter) const;
  // The logarithm of the density of all readings, but for a constant of the runs and of the held
  // elements without prior.
  double log_likelihood(const std::vector<HeldElement>& held, const CrossedScatter& scatter) const;

 private:
  struct Share {  // of one element in one unit's runs: sums of weights and of weighted readings
    std::size_t element = 0;
    double weight = 0;
    Eigen::VectorXd sum;
  };
  struct Pair {
    std::size_t other = 0;
    double weight = 0;
  };
  struct Unit {
    double weight = 0;
    Eigen::VectorXd sum;
    std::vector<Share> shares;
  };
  struct Sums;
  Sums sums(const std::vector<HeldElement>& held, const CrossedScatter& scatter,
            bool of_all_elements) const;

  std::vector<Unit> units_;
  std::vector<std::vector<Pair>> together_;  // weight of the runs that two elements share
  Eigen::VectorXd squares_;                  // weighted sum of squares of each column
  std::size_t runs_ = 0;
  std::size_t columns_ = 0;
};

}  // namespace sixpoint::station

// What earlier units had of an effect: the prior for the next unit of the same kind, beside the
// catalogue's sizes.
//
//   const LearntSize tilt{.effect = "tilt", .units = 12, .mean = {0.3, 0.1}, .sd = {0.02, 0.02}};
//   const double nats = learnt_log_prior(tilt);  // 0: even odds
//
// Plain data. The numbers are those of the effect's first parameter in its own unit (catalogue.h);
// gap/adopt/learnt_sizes.h reads them from a scenario.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace sixpoint::gap {

struct LearntSize {
  std::string effect;
  std::size_t units = 0;      // behind the numbers
  double share_of_units = 1;  // of those, that have it
  std::vector<double> mean = {};
  std::vector<double> sd = {};  // of the next unit: spread, and uncertainty of the mean
};

// Prior log odds that the next unit has the effect with such a size. Even at the most: what the
// recording itself does not show is never named, however many units had it.
//
// | of the earlier units            | nats                                                 |
// |---------------------------------|------------------------------------------------------|
// | all had it                      | 0                                                    |
// | k of n had it                   | log((k + 1/2) / (n - k + 1/2)) (Jeffreys' prior of a |
// |                                 | share), at most 0                                    |
// | next to none had it             | no less than kLogPriorEffect, as for an effect that  |
// |                                 | nothing is known of                                  |
// | none stands behind it: a person | 0                                                    |
// | wrote what is expected          |                                                      |
double learnt_log_prior(const LearntSize& learnt);

}  // namespace sixpoint::gap

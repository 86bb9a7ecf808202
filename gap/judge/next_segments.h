// Which segment to record next: what each is expected to say about what is uncertain now.
//
//   const double nats = information_nats(0.5, 4);  // 0.56 of the 0.69 that "either" holds
//
// A question is whether an effect is there, or which of two that look alike. It has a probability
// now, and a segment adds weight of evidence if the answer is yes: the Kullback-Leibler divergence
// of what is expected with the effect from what is expected without it. For a size that is normal
// with mean m and covariance C now and C' after the segment this is
//     w = (tr(C'^-1 C) - k - log det(C'^-1 C) + m' (C'^-1 - C^-1) m) / 2   nats, k numbers
// (Kullback 1959, 9.1), both covariances beside everything else of the best explanation. The
// expected information of the segment is the sum over the questions (Lindley 1956, "On a measure of
// the information provided by an experiment"): questions count as independent.
//
// What a question is:
//
// | the effect                                        | probability           | weight      |
// |---------------------------------------------------|-----------------------|-------------|
// | not observable, and the means show it             | prior, given the found| w           |
// | not observable, samples show it (clock, range ...)| prior, given the found| beyond doubt|
// | observable, and the means show it                 | its own, below 0.99   | w           |
// | observable, with 0.99 and more                    | no question           |             |
// | named, another looks like it, means show both     | even odds             | w beside it |
// | named, another looks like it, samples show one    | even odds             | beyond doubt|
// | named beside another that leaves its size open:   | even odds             | beyond doubt|
// | the segment leaves a third of the uncertainty     |                       |             |
// | ... it leaves more                                | no question           |             |
// | what it needs is still missing with the segment   | no question           |             |
//
// Internal to gap/judge.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "gap/explain/explanation.h"
#include "gap/judge/diagnosis.h"
#include "gap/judge/findings.h"

namespace sixpoint::gap {

// What a segment consists of.
struct PlannedPiece {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // laboratory to sensor
  double pause_s = 6;                                      // before it
  double seconds = 10;
  bool placed = true;                        // anew; false: it follows in the same seat
  std::optional<double> temperature_c = {};  // none: as at the recording's end
  double vibration_g = 0;                    // of a tone along the vertical
  double frequency_hz = 0;                   // from half of the sample rate on it says nothing
};

// A segment that could be recorded, and what a protocol can do with it.
struct Offer {
  std::string name;
  unsigned gives = 0;  // of enum Ability
  std::vector<PlannedPiece> pieces;
  double minutes() const;
};
// Those of the engineering protocol, and `half_turn`: three faces once more, turned by half a turn
// about the vertical.
const std::vector<Offer>& standard_offers();

// Expected information about a question that is answered yes with this probability, nats: the
// mutual information with a normal reading whose log likelihood ratio is on average +-weight_nats
// (standard deviation sqrt(2 weight)). At most its entropy, which an infinite weight gives.
double information_nats(double probability, double weight_nats);

// Most nats per minute first; those that say nothing are left out. `abilities`: of enum Ability.
// `out` holds what is not observable.
std::vector<NextSegment> next_segments(const Request& request, unsigned abilities,
                                       const Explanation& explanation, const Findings& found,
                                       const Diagnosis& out);

}  // namespace sixpoint::gap

// What the steps of the diagnosis report: effects with their evidence, and alarms.
//
//   EffectFinding drift;
//   drift.name = "drift";
//   drift.nats = 8.1;
//   Findings found;
//   found.add(request, drift);                        // accepted: above kAccept_nats
//   found.test(6.2, "tone: residual at 20 Hz, 1 g");  // an alarm: above kAlarm_sd
//   all.append(std::move(found));
//
// Internal to gap/judge. Units: nats, standard deviations, mg^2.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "gap/explain/decisions.h"
#include "gap/judge/diagnose.h"

namespace sixpoint::gap {

// False for an effect that the options take out of the catalogue.
inline bool is_allowed(const DiagnoseOptions& options, const std::string& effect) {
  return options.without.count(effect) == 0;
}

// What is to be diagnosed. Refers to both, which must outlive it.
struct Request {
  const Bundle& bundle;
  const DiagnoseOptions& options;

  bool allowed(const std::string& effect) const { return is_allowed(options, effect); }
  double lsb_mg() const { return 1000 / bundle.accel_scale_lsb_per_g; }
  double segments() const { return static_cast<double>(bundle.segments.size()); }
};

// Something is not explained.
struct Alarm {
  double sd = 0;  // beyond chance
  std::string where;
  std::vector<UnknownPlace> places = {};  // that it is about, beside those of locate_unknown()
};

// What an effect adds to the gap that the means do not show.
struct OutsideMeans {
  std::string effect;
  double mg2 = 0;  // mean square per axis
};

struct Findings {
  std::vector<EffectFinding> effects;     // accepted ones
  std::vector<EffectFinding> candidates;  // all that were judged
  std::vector<Alarm> alarms;
  double worst_sd = 0;  // of all tests and other causes, alarms or not
  // EffectFinding::bound of every effect that has one, judged or not.
  std::map<std::string, double> bounds;
  // Of all that was found, named or not.
  std::vector<OutsideMeans> outside_means;

  // Sets the probability; an effect that is not allowed is left out.
  void add(const Request& request, EffectFinding finding);
  void alarm(double sd, std::string where, std::vector<UnknownPlace> places = {}) {
    alarms.push_back({sd, std::move(where), std::move(places)});
  }
  void test(double sd, const std::string& where, const std::vector<UnknownPlace>& places = {});
  // Log odds of a cause that the catalogue lacks, whether or not they are an alarm. On the scale of
  // the tests: at kUnknownWins_nats as much as a test at kAlarm_sd, a third of a standard deviation
  // for a nat (convention), so that even odds before the data (kLogPriorUnknown) are the 3 standard
  // deviations that the largest of forty tests has by chance.
  void suspect(double nats);
  void append(Findings later);
  bool accepted(const std::string& effect) const;
  // Accepts weaker candidates where the unit shows that it has a little of everything, or where
  // something is there for certain (`unnamed`: the means show much, and nothing of it is accepted)
  // and only its name is in doubt. `before`: how many effects other findings hold.
  //
  // | accepted effects, `before` and here | unnamed | a candidate is accepted above  |
  // |-------------------------------------|---------|--------------------------------|
  // | up to three                         | no      | kAccept_nats, 9 to 1           |
  // | up to three                         | yes     | kAcceptAmongMany_nats, even    |
  // | kManyEffects, four, and more        | either  | kAcceptAmongMany_nats, even    |
  void accept_likely(std::size_t before, bool unnamed);
};

// All that lies still, of one axis or of all (-1): where the noise is measured.
std::vector<UnknownPlace> noise_places(const Request& request, int axis = -1);

// Probability for log odds, kept within what the model can be trusted with: at most 1 - 1e-4.
double probability_of(double nats);

// Chi-square in standard deviations of a normal variable: its cube root is nearly normal (Wilson
// and Hilferty 1931). 0 without freedom.
double chi_to_sd(double chi, double freedom);

// An alarm for something whose log odds are known: a likelihood ratio of e^x is sqrt(2 x) standard
// deviations of one free number (Wilks 1938).
inline double nats_to_sd(double nats) { return std::sqrt(2 * nats); }

// The contract's name of the parameters that the forward model estimates; empty for other effects.
std::string parameter_name(const std::string& effect);

// Sets the share of the gap and the probability that it matters from each gap_mg2. The whole is
// what is named and what nothing named explains (unknown.size_mg), which is `gap` in other readings:
// of what is fully explained the shares add up to one. Where nothing is named it is the gap above the
// floor. A candidate's is what it would have of the same whole.
void set_shares(const Diagnosis& out, double matters_mg, std::vector<EffectFinding>& effects,
                std::vector<EffectFinding>& candidates);

// Completes the answer. Candidates for the whole catalogue, strongest evidence first; effects by
// what they close of the gap, largest first: evidence says only how sure they are. What is named is
// less probable the more evidence there is for something unknown:
//
// | strongest evidence for something unknown | its probability | a name's probability, times |
// |------------------------------------------|-----------------|-----------------------------|
// | far below kAlarm_sd                      | 0.03            | 1                           |
// | kAlarm_sd                                | 0.49            | 0.75                        |
// | far above                                | 0.95            | 0.5                         |
//
// | evidence and gap  | alarms | effects | verdict           |
// |-------------------|--------|---------|-------------------|
// | finite numbers    | none   | none    | no_gap            |
// | finite numbers    | none   | some    | explained         |
// | finite numbers    | some   | some    | partly_explained  |
// | finite numbers    | some   | none    | unexplained       |
// | one is not finite | either | either  | by inconclusive() |
void finish(const Request& request, Findings found, Diagnosis& out);
// The answer where the recording does not allow a diagnosis, for whatever reason (`why`), of every
// kind of recording. It keeps what `out` says of the recording itself.
//
// | verdict     | effects | unknown, candidates   | not_observable |
// |-------------|---------|-----------------------|----------------|
// | unexplained | none    | at most even odds     | the catalogue  |
Diagnosis inconclusive(const DiagnoseOptions& options, Findings found, const std::string& why,
                       Diagnosis out);

}  // namespace sixpoint::gap

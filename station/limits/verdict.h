// The verdict on a run: every quantity against its limits with a guard band, and all of them
// together (docs/verdicts.md).
//
//   const Measured zero{"zero_offset_mg", "x", 120.0, 0.8};
//   const Verdict verdict = judge_quantities({zero}, default_limits());
//   verdict.usable();  // true
//
// ILAC-G8:09/2019, 4.2.3 (non-binary statement with a guard band w). w is the expanded uncertainty
// times the decision rule's factor, and at least the limit's own guard band.
//
// | value                                                  | verdict          | constants | exit |
// |--------------------------------------------------------|------------------|-----------|------|
// | inside the limits by w or more                         | pass             | used      | 0    |
// | inside, but nearer                                     | conditional_pass | used      | 0    |
// | beyond a limit by less than w                          | conditional_fail | not used  | 1    |
// | beyond by w or more                                    | fail             | not used  | 1    |
// | not finite; or so uncertain that no value could pass,  | inconclusive     | not used  | 2    |
// | unless it is beyond its limit by w or more             |                  |           |      |
// | (the operator stopped the run)                         | stopped          | not used  | 3    |
//
// Pure functions and plain data; any thread.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "station/limits/limits.h"

namespace sixpoint::station {

enum class JigVerdict { pass, conditional_pass, conditional_fail, fail, inconclusive, stopped };
std::string_view to_string(JigVerdict verdict);  // "pass", "conditional_pass" ...
std::optional<JigVerdict> parse_jig_verdict(std::string_view text);
// May the constants of such a run be used?
inline bool is_passed(JigVerdict verdict) {
  return verdict == JigVerdict::pass || verdict == JigVerdict::conditional_pass;
}
int exit_code_of(JigVerdict verdict);

// A kind of failure, from a fixed catalogue.
struct FailureCode {
  std::string_view code;  // "zero_high": fixed, for programs and statistics
  std::string_view meaning;
  std::string_view cause;        // the probable one
  std::string_view next_action;  // for the person at the station
};
const std::vector<FailureCode>& failure_codes();
const FailureCode* find_failure_code(std::string_view code);
// What the person does next:
//
//   a run that was the last failure that the limits allow    the unit is kept back, and nothing else
//   any other                                                that of each code, once, in their order
std::vector<std::string> next_actions(const std::vector<std::string>& codes,
                                      bool is_last_failure = false);

// A value to be judged.
struct Measured {
  std::string name;  // of quantities()
  std::string axis;  // "x", "xy"; empty where the quantity has none
  double value = 0;
  double standard_uncertainty = 0;  // 0 for counts and for uncertainties themselves
};

struct JudgedQuantity {
  std::string name;
  std::string axis;
  double value = 0;
  double expanded_uncertainty = 0;
  std::optional<double> low;
  std::optional<double> high;
  double guard_band = 0;
  JigVerdict verdict = JigVerdict::pass;
  std::string code;  // empty where it passed without condition
};

struct Verdict {
  JigVerdict verdict = JigVerdict::inconclusive;
  std::vector<JudgedQuantity> quantities;
  std::vector<std::string> codes;    // of the catalogue, each once, worst first
  std::vector<std::string> reasons;  // one sentence for each quantity that did not pass

  std::string brief() const;
  bool usable() const { return is_passed(verdict); }
};
nlohmann::ordered_json to_json(const JudgedQuantity& quantity);
// Of a run's document; names that this program does not know are left out.
std::vector<JudgedQuantity> quantities_from_json(const nlohmann::ordered_json& json);

// One quantity against its limits, by the table above.
JudgedQuantity judge_quantity(const Measured& measured, const Limits& limits);
// All of them; the worst one is the verdict (inconclusive before conditional passes, after fails).
Verdict judge_quantities(const std::vector<Measured>& measured, const Limits& limits);

// --- retest policy ---

// An earlier run of the same unit. Runs that were stopped or inconclusive do not count.
struct EarlierRun {
  std::string id;
  JigVerdict verdict = JigVerdict::pass;
  std::vector<std::string> codes;
  bool released_after = false;  // an engineer released the unit after this run
};

struct RetestState {
  int failures_in_row = 0;  // since the last release or the last time it counted as passed
  int passes_needed = 1;    // until the unit counts as passed
  bool may_start = true;
  std::string retest_of;  // the run that the next one repeats; empty where it repeats none
  std::string reason;     // why it may not start, for people
  // That the limits still allow; nothing where failures do not count (check units, studies), or
  // nobody can say how many there were.
  std::optional<int> failures_left = {};
};
// `earlier`: oldest first.
RetestState retest_state(const std::vector<EarlierRun>& earlier, const RetestPolicy& policy);
// A pass that is not yet enough becomes conditional, with the code `retest`.
void apply_retest(Verdict& verdict, const RetestState& state);
// Was this run, behind `state`, the last failure that the limits allow?
bool is_last_failure(JigVerdict verdict, const RetestState& state);

}  // namespace sixpoint::station

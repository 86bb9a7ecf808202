// The verdict on a run: every quantity against its limits with a guard band, and all of them
// together (docs/verdicts.md).
//
// ILAC-G8:09/2019, 4.2.3 (non-binary statement with a guard band w): at a distance of w or more
// inside the limit a value passes; inside it, but nearer, it passes conditionally; beyond it by
// less than w it fails conditionally; beyond that it fails. w is the expanded uncertainty times the
// decision rule's factor, and at least the limit's own guard band.
//
// Where the expanded uncertainty is so large that no value could pass, the quantity is
// inconclusive, unless it is beyond its limit by more than that: nothing is said against the unit.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "station/limits.h"

namespace sixpoint::station {

struct JigReport;  // jig_report.h

enum class JigVerdict { pass, conditional_pass, conditional_fail, fail, inconclusive, stopped };
std::string_view to_string(JigVerdict verdict);  // "pass", "conditional_pass" ...
std::optional<JigVerdict> parse_jig_verdict(std::string_view text);
// The constants of such a run may be used.
inline bool is_passed(JigVerdict verdict) {
  return verdict == JigVerdict::pass || verdict == JigVerdict::conditional_pass;
}
// 0 passed, conditionally or not; 1 failed; 2 inconclusive; 3 stopped (the contract's exit codes).
int exit_code_of(JigVerdict verdict);

// What goes wrong, from a fixed catalogue.
struct FailureCode {
  std::string_view code;  // "zero_high": fixed, for programs and statistics
  std::string_view meaning;
  std::string_view cause;        // the probable one
  std::string_view next_action;  // for the person at the station
};
const std::vector<FailureCode>& failure_codes();
const FailureCode* find_failure_code(std::string_view code);
// What the person at the station does about a run's codes: each once, in their order.
std::vector<std::string> next_actions(const std::vector<std::string>& codes);

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
  std::vector<std::string> codes;  // of the catalogue, each once, worst first
  // One sentence for each quantity that did not pass.
  std::vector<std::string> reasons;

  std::string brief() const;
  bool usable() const { return is_passed(verdict); }
};
nlohmann::ordered_json to_json(const JudgedQuantity& quantity);
// Of a run's document; what is no quantity of this program is left out.
std::vector<JudgedQuantity> quantities_from_json(const nlohmann::ordered_json& json);

// One quantity against its limits. A value that is not finite is inconclusive. An uncertainty that
// is too large, of a quantity or judged by itself, makes the run inconclusive, not the unit bad.
JudgedQuantity judge_quantity(const Measured& measured, const Limits& limits);
// All of them; the worst one is the verdict (inconclusive before conditional passes, after fails).
Verdict judge_quantities(const std::vector<Measured>& measured, const Limits& limits);

// What a report of a complete run holds that has limits, with its standard uncertainty
// (docs/verdicts.md has the budget). Empty without a solution.
std::vector<Measured> measured_quantities(const JigReport& report);

// --- retest policy ---

// A run of the same unit that ended earlier. Runs that were stopped or inconclusive say nothing.
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
};
// `earlier`: oldest first.
RetestState retest_state(const std::vector<EarlierRun>& earlier, const RetestPolicy& policy);
// A pass that is not yet enough becomes conditional, with the code `retest`.
void apply_retest(Verdict& verdict, const RetestState& state);

}  // namespace sixpoint::station

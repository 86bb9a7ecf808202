// The gap over time: how far recordings were from the simulator before it learnt anything, and
// after each adoption.
//
//   SIXPOINT_ASSIGN(ScenarioHistory history, adoption_history(scenario_text));
//   ProgressRecorder recorder(std::move(history));
//   SIXPOINT_CHECK(recorder.add("unit7", recorded));
//   const GapProgress report = recorder.finish();
//   std::cout << report.brief() << '\n' << progress_html(report);
//
// Every figure is measured by re-simulation (resimulation.h). Recordings from which the scenario
// learnt and others are kept apart: only the others say what the next recording will show.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "gap/adopt/adopted_scenario.h"
#include "gap/adopt/resimulation.h"

namespace sixpoint::gap {

struct BundleProgress {
  std::string name;
  std::string serial;
  bool learnt_from = false;
  bool unknown = false;  // the diagnosis says that something is there that the catalogue lacks
  double before_mg = 0;
  std::vector<double> after_mg;  // after each adoption
  double floor_mg = 0;
};

// What was closed of the mean square before, above the floor (closed_of()):
//
// | the gap                                               | share     | in words                      |
// |-------------------------------------------------------|-----------|-------------------------------|
// | became wider                                          | none      | "wider by 5.62 mg"            |
// | was within 1.5 times the floor before: what is open   | none      | "next to nothing was open"    |
// | is chance                                             |           |                               |
// | otherwise                                             | 1 at most | "97.1 %"                      |
struct Closed {
  std::optional<double> fraction;
  double wider_mg = 0;

  std::string text() const;
};
// From `from_mg` to `to_mg`, of what was open at `before_mg`.
Closed closed_of(double from_mg, double to_mg, double before_mg, double floor_mg);

// Root mean squares over recordings.
struct ProgressSum {
  std::size_t bundles = 0;
  double before_mg = 0;
  std::vector<double> after_mg;
  double floor_mg = 0;
  Closed closed;  // by the last adoption
};

struct EffectProgress {
  std::string name;
  bool scatter = false;  // it can't be predicted, and closes nothing
  // The gap with everything of the last adoption but this effect.
  double without_mg = 0;
  Closed closed;  // by this effect
};

struct GapProgress {
  std::vector<PopulationState> history;
  std::vector<BundleProgress> bundles;  // in the order in which they were added
  ProgressSum all;
  ProgressSum new_ones;                 // from which the scenario has not learnt
  std::vector<EffectProgress> effects;  // strongest first; over all recordings
  std::vector<std::string> losses;

  std::string brief() const;  // a sentence for a person
  bool usable() const { return !bundles.empty() && !history.empty(); }
  nlohmann::ordered_json to_json() const;
};

class ProgressRecorder {
 public:
  explicit ProgressRecorder(ScenarioHistory history);
  // An inconclusive recording is a loss, not an error. Errors as gap_with().
  Status add(const std::string& name, const RecordedBundle& recorded);
  GapProgress finish() const;

 private:
  std::set<std::string> learnt_from_;
  GapProgress progress_;
  std::vector<std::vector<double>> without_mg_;  // per effect of the last state and bundle
};

// One page without other files.
std::string progress_html(const GapProgress& progress);

}  // namespace sixpoint::gap

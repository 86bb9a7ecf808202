// What repair makes of the files of a trial: is one of them worse than before, is a good repair
// refused?
//
//   const TrialResult result = run_trials(1, 300);   // a seed, and how many archives
//   result.of("wrong unit").worse;                   // 0
#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "db/store.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_file.h"
#include "repair/trial_files.h"

namespace sixpoint::tests {

struct TrialCount {
  int files = 0;
  int written = 0;
  int refused = 0;
  int worse = 0;            // by more than 1 mg RMS against the true motion
  double most_left_mg = 0;  // the largest still error of a file that was written
  double worst_mg = 0;      // the largest growth of the RMS error
  std::string examples;     // of what is worse or was refused
};

struct TrialResult {
  std::map<std::string, TrialCount> kinds;
  TrialCount of(const std::string& kind) const {
    const auto found = kinds.find(kind);
    return found == kinds.end() ? TrialCount{} : found->second;
  }
  int worse() const {
    int sum = 0;
    for (const auto& [kind, count] : kinds) {
      sum += count.worse;
    }
    return sum;
  }
};

inline void take(TrialResult& result, const std::string& kind, const Trial& trial,
                 FileSystem& files, const repair::RepairReport& report) {
  TrialCount& count = result.kinds[kind];
  ++count.files;
  if (report.output.empty()) {
    ++count.refused;
    if (count.refused <= 3 && kind == "good") {
      count.examples += "  refused: " + report.brief() + ": " +
                        (report.reasons.empty() ? "" : report.reasons.back()) + "\n";
    }
    return;
  }
  ++count.written;
  count.most_left_mg = std::max(count.most_left_mg, report.still_error_after_mg.value_or(0));
  const double growth_mg = trial.rms_mg(files, report.output) - trial.rms_mg(files, report.input);
  count.worst_mg = std::max(count.worst_mg, growth_mg);
  if (growth_mg > 1) {
    ++count.worse;
    count.examples += fmt::format("  worse by {:.1f} mg: {} ({} still blocks)\n", growth_mg,
                                  report.brief(), report.still_blocks);
  }
}

inline db::ConstantsRecord stored(const calib::ConstantsRecord& record, int day) {
  db::ConstantsRecord row;
  row.serial = record.serial;
  row.filter = "current";
  row.method = record.method;
  row.made_at = from_unix_seconds(1'700'000'000 + 86'400LL * day);
  row.document = calib::to_json(record).dump();
  return row;
}

inline void run_trial(std::uint64_t seed, std::uint64_t number, bool few, TrialResult& result) {
  Trial trial(seed, number, few);
  MemoryEnv memory;
  FileSystem& files = memory.files;
  const auto attempt = [&](const std::string& kind, const std::string& input,
                           const repair::ConstantsFinderOptions& options) {
    repair::ConstantsFinder finder(memory.env, options);
    const std::string output = fmt::format("out{}.gt3x", result.of(kind).files) + kind;
    take(result, kind, trial, files,
         repair::repair_file(memory.env, input, output, finder, repair::RepairOptions{}));
  };
  if (!trial.write_file(files, "in.gt3x") || !trial.write_corrected_file(files, "fixed.gt3x") ||
      !trial.write_swapped_calibration_file(files, "swapped.gt3x", false) ||
      !trial.write_swapped_calibration_file(files, "label.gt3x", true)) {
    ++result.kinds["not made"].worse;
    return;
  }
  auto store = db::Store::in_memory(memory.env).value();
  const auto good = store.add_constants(stored(trial.right(), 0), "").value();
  repair::ConstantsFinderOptions by_store;
  by_store.store = &store;
  by_store.store_named = true;
  attempt("good", "in.gt3x", by_store);
  attempt("already corrected", "fixed.gt3x", by_store);
  repair::ConstantsFinderOptions given;
  given.given = trial.wrong();
  attempt("wrong unit", "in.gt3x", given);
  repair::ConstantsFinderOptions swapped;
  swapped.calibration_file = "swapped.gt3x";
  attempt("swapped calibration file", "in.gt3x", swapped);
  swapped.calibration_file = "label.gt3x";
  attempt("wrongly labelled calibration file", "in.gt3x", swapped);
  const auto bad = store.add_constants(stored(trial.wrong(), 1), "").value();
  static_cast<void>(store.withdraw_constants(bad, "Ada", "of another unit"));
  attempt("withdrawn, a good set left", "in.gt3x", by_store);
  static_cast<void>(store.withdraw_constants(good, "Ada", "to be measured again"));
  attempt("all withdrawn", "in.gt3x", by_store);
}

inline TrialResult run_trials(std::uint64_t seed, std::uint64_t archives, bool few = false) {
  TrialResult result;
  for (std::uint64_t number = 0; number < archives; ++number) {
    run_trial(seed, number, few, result);
  }
  return result;
}

}  // namespace sixpoint::tests

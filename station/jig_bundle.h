// A stored jig run as a bundle of the production protocol, for the diagnosis of the gap.
//
// The run's report says what was read in which pose, the capture holds every sample. Each reading
// is found again in the samples by its exact sums; what lies between them is motion and left out.
// The counts are raw: the middle of each axis is taken off (a whole number, so that the counts stay
// what the sensor gave), its gain stays in, and the diagnosis is told so (`uncalibrated`).
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"
#include "db/store.h"
#include "gap/bundle.h"

namespace sixpoint::station {

struct StoredRun {
  std::string id;
  std::string serial;
  std::string kind;
  std::string station;
  std::string jig;
  std::string document;  // JSON: the report
};

// Oldest first, those of kind "jig".
Result<std::vector<StoredRun>> stored_jig_runs(db::Store& store);
// no_input where the store holds no such run, or the run no samples. The start of an id will do
// where it is the only one.
Result<StoredRun> stored_run(db::Store& store, const std::string& id);
Result<std::string> samples_of_run(db::Store& store, const std::string& id);

// bad_data where the report or the samples are not what a jig run leaves, or do not belong
// together.
Result<gap::Bundle> bundle_of_run(const StoredRun& run, std::string_view samples_csv);

}  // namespace sixpoint::station

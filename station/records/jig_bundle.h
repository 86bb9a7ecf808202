// A stored jig run as a recording bundle, for the diagnosis of the gap.
//
//   SIXPOINT_ASSIGN(const StoredRun run, stored_run(store, "1f0c"));
//   SIXPOINT_ASSIGN(const std::string csv, samples_of_run(store, run.id));
//   SIXPOINT_ASSIGN(const gap::Bundle bundle, bundle_of_run(run, csv));
//
// The report of the run says what was read in which pose; the capture holds all samples. Each
// reading is found in the samples by its exact sums. The samples between the readings are motion
// and are left out. The counts stay raw: the middle of each axis, rounded to a whole count, is
// subtracted, and the gain stays in.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "db/store.h"
#include "device/jig.h"
#include "gap/recording/bundle.h"

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
// `id` may be shortened to a beginning that is unique. no_input where the store has no such run, or
// the run has no samples.
Result<StoredRun> stored_run(db::Store& store, const std::string& id);
Result<std::string> samples_of_run(db::Store& store, const std::string& id);

// The mean of one still pose in a stored report.
struct StoredReading {
  device::Pose pose = device::Pose::plus_z;
  PerAxis<double> mean_lsb{};
  std::size_t samples = 0;
  bool half_turned = false;  // about the vertical (the table of station/run/jig_run.h)
};
// `list`: "poses" of a report, or another of its lists. bad_data where an entry is incomplete.
Result<std::vector<StoredReading>> stored_readings(const nlohmann::json& list);

// Of a unit that lies on `pose` as the table of station/run/jig_run.h says: the laboratory (z up, x to
// the right of the person in front of the jig) to the sensor.
Eigen::Matrix3d rotation_on_jig(device::Pose pose, bool half_turned = false);

// bad_data where report or samples are not those of a jig run, or do not belong together.
Result<gap::Bundle> bundle_of_run(const StoredRun& run, std::string_view samples_csv);

}  // namespace sixpoint::station

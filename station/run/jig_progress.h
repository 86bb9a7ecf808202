// A run's readings and its state as JSON: for the report, and for the disk that a run is resumed
// from.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "station/jig_run.h"

namespace sixpoint::station {

nlohmann::ordered_json to_json(const PoseReading& reading);
nlohmann::ordered_json to_json(const JigProgress& progress);
Result<JigProgress> parse_jig_progress(const nlohmann::ordered_json& json);  // bad_data

}  // namespace sixpoint::station

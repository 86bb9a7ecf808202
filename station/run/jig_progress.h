// A run's readings and its state as JSON: for the report, and for the file that a run goes on from.
//
//   SIXPOINT_ASSIGN(const JigProgress progress, parse_jig_progress(to_json(run.progress())));
//
// Readings in LSB, tilt in degrees.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "station/run/jig_run.h"

namespace sixpoint::station {

nlohmann::ordered_json to_json(const PoseReading& reading);
nlohmann::ordered_json to_json(const JigProgress& progress);
Result<JigProgress> parse_jig_progress(const nlohmann::ordered_json& json);  // bad_data

}  // namespace sixpoint::station

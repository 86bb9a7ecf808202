// A scenario with most of its keys given.
#pragma once

namespace sixpoint::tests {

inline constexpr const char* kWholeScenario = R"({
  "schema": "sixpoint/scenario/1", "seed": 7,
  "unit": {"serial": "MOS2A45130007", "firmware": "1.5.0", "calibrated": "2013-11-12",
           "constants": {"positive_lsb": [311, 310, 287], "negative_lsb": [-204, -216, -234],
                         "zero_lsb": [54, 47, 26]},
           "sensor": {"current": {"sensitivity_lsb_per_g": [237.7, 251.8, 242.3],
                                  "zero_lsb": [49.9, 95.8, 60.8]}}},
  "start": "2015-04-09T14:04:00Z", "rate_hz": 30,
  "motions": [{"kind": "still", "duration_s": 20, "pose": "+z"},
              {"kind": "shaker", "duration_s": 5, "direction_lab": [1, 0, 0], "frequency_hz": 4},
              {"kind": "free_living", "duration_s": 60}],
  "effects": [{"name": "clock_error", "parameters": {"ppm": 40}},
              {"name": "tilt", "parameters": {"rotation_vector_deg": [0.1, 0, 0]}}]
})";

}  // namespace sixpoint::tests

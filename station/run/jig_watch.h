// What is asked of the jig while a run goes on: turn, look for faults, agree with the unit.
//
//   JigWatch watch({0.25, 3});
//   SIXPOINT_CHECK(watch.place(jig, device::Pose::plus_x, JigPhase::measuring));
//   SIXPOINT_ASSIGN(const auto stands, watch.ask(jig, 12.5));  // a stop or a fault is an error
//
// A jig that a person turns is asked nothing: every answer is success, and no pose. The jig is not
// owned, and may be another one at each call, when the unit was plugged in again. One object
// belongs to one thread.
#pragma once

#include <optional>

#include "base/result.h"
#include "device/jig.h"
#include "station/run/jig_run.h"

namespace sixpoint::station {

struct JigWatchOptions {
  double poll_s = 0.25;  // between two questions to a motorised jig for faults
  // After so many tilted placements in a row that the jig calls exact, its position is not trusted.
  int most_disagreements = 3;
};

class JigWatch {
 public:
  explicit JigWatch(const JigWatchOptions& options) : options_(options) {}

  // Turns the jig, where a look at it permits that; in the phase `turning` half-turned.
  static Status place(device::Jig& jig, device::Pose pose, JigPhase phase);

  // Where it stands; none while it turns, or where it does not know. At most every poll_s, else its
  // last answer. Its stop or fault is an error that ends the run: no placement after it is certain.
  Result<std::optional<device::Pose>> ask(device::Jig& jig, double now_s);

  // The jig's own position against a placement that the unit's readings have judged:
  //
  // | the jig says                          | the unit's readings    | then                     |
  // |---------------------------------------|------------------------|--------------------------|
  // | stopped, or a fault                   | any                    | that error               |
  // | it does not know                      | any                    | success                  |
  // | another pose                          | accepted, tilted, or   | bad_data                 |
  // |                                       | its face is not wanted |                          |
  // | this pose                             | accepted, or not wanted| success                  |
  // | this pose                             | tilted, the first ones | success                  |
  // | this pose                             | tilted again and again | bad_data                 |
  // | any                                   | moved, between faces,  | success: they say nothing|
  // |                                       | too noisy, or an axis  | about the pose           |
  // |                                       | may be stuck           |                          |
  Status compare(device::Jig& jig, const JigAction& action);

 private:
  JigWatchOptions options_;
  std::optional<double> asked_s_;
  std::optional<device::Pose> stands_;  // its last answer
  int disagreements_ = 0;
};

}  // namespace sixpoint::station

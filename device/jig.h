// A jig turns a unit into its six poses: a person, a motor, or a program.
//
//   Status turn_up(Jig& jig) {
//     SIXPOINT_CHECK(check_jig(jig));  // neither stopped nor faulty
//     return jig.go_to(Pose::plus_z);
//   }
//
// A stop is a latch. The order in which a jig may move again:
//
//     what happened                    go_to() answers                     until
//     stop(), or the jig's own button  device_unavailable, nothing moves   release()
//     a fault of the jig               device_unavailable, nothing moves   the fault is gone, and
//                                                                          release()
//
// That the unit or the jig was unplugged and is back changes nothing of this. No program calls
// release() by itself: it is the operator's word that he saw the jig and that no hand is in it.
//
// A pose is named by the axis that points up and reads +1 g, or that points down and reads -1 g.
// Angles are in degrees. Errors: device_unavailable when the jig is gone or faulty.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "base/measure.h"
#include "base/result.h"

namespace sixpoint::device {

enum class Pose { plus_x, minus_x, plus_y, minus_y, plus_z, minus_z };

inline constexpr std::array<Pose, 6> kPoses = {Pose::plus_z,  Pose::minus_z, Pose::plus_x,
                                               Pose::minus_x, Pose::plus_y,  Pose::minus_y};

std::string_view to_string(Pose pose);           // "+x"
Result<Pose> parse_pose(std::string_view text);  // usage when it is none
std::size_t axis_of(Pose pose);
int sign_of(Pose pose);
Pose pose_of(std::size_t axis, int sign);
PerAxis<double> direction_of(Pose pose);  // specific force at rest, in g

// Where a jig stands, by its own measurement.
struct JigPosition {
  std::optional<Pose> pose;            // none while it moves, or when it does not know
  double angle_off_deg = 0;            // from that pose
  double angle_uncertainty_deg = 0.1;  // standard uncertainty of that angle
  std::string fault;                   // for people; empty where there is none
};

// One thread at a time, except stop(), which may come from any.
class Jig {
 public:
  virtual ~Jig() = default;
  virtual std::string name() const = 0;  // for certificates: kind and serial
  // True when go_to() turns the unit; false when a person must do it.
  virtual bool turns_by_itself() const = 0;
  // Begins to turn. The unit is in its pose some time later: watch the unit's own readings.
  virtual Status go_to(Pose pose) = 0;
  // True where a face can also be laid half a turn about the vertical from how go_to() lays it. A
  // person can; a motor that tips the unit from face to face cannot.
  virtual bool can_half_turn() const { return false; }
  // As go_to(), and turned so. usage, and nothing moves, where can_half_turn() is false.
  virtual Status go_to_half_turned(Pose pose);
  virtual Result<JigPosition> position() = 0;
  virtual Status stop() = 0;  // emergency stop: no movement until release()
  // The operator saw the jig and says that it is free. device_unavailable while its fault stays.
  virtual Status release() = 0;
};

// device_unavailable, with the reason, where the jig is stopped, faulty or silent.
Status check_jig(Jig& jig);

// A person turns the unit. go_to() does nothing: the station shows the prompt.
class ManualJig final : public Jig {
 public:
  std::string name() const override { return "manual"; }
  bool turns_by_itself() const override { return false; }
  Status go_to(Pose pose) override;
  bool can_half_turn() const override { return true; }
  Status go_to_half_turned(Pose pose) override;
  Result<JigPosition> position() override;
  Status stop() override;
  Status release() override;
};

}  // namespace sixpoint::device

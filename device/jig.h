// What turns a unit into its poses: a person, a motor, or a program.
//
// A pose is named by the axis that points up and therefore reads +1 g, or down (-1 g).
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

struct JigReport {
  std::optional<Pose> pose;  // where it stands; none while it moves or does not know
  double angle_off_deg = 0;  // from that pose, as the jig itself measures it
  double angle_uncertainty_deg = 0.1;
  std::string fault;  // empty while all is well
};

// One thread at a time, except stop(), which may come from any.
class Jig {
 public:
  virtual ~Jig() = default;
  virtual std::string name() const = 0;  // for certificates: kind and serial
  // True when go_to() turns the unit by itself; false when a person is to be asked.
  virtual bool turns_by_itself() const = 0;
  // Begins to turn; device_unavailable when the jig is gone or faulty. The unit is in its pose some
  // time later: whoever asked watches the unit's own readings.
  virtual Status go_to(Pose pose) = 0;
  virtual Result<JigReport> report() = 0;
  virtual Status stop() = 0;  // emergency stop: no movement until the next go_to()
};

// A person turns the unit. go_to() does nothing: the prompt is the station's business.
class ManualJig final : public Jig {
 public:
  std::string name() const override { return "manual"; }
  bool turns_by_itself() const override { return false; }
  Status go_to(Pose pose) override;
  Result<JigReport> report() override;
  Status stop() override;
};

}  // namespace sixpoint::device

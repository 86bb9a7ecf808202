// A person's hands on a virtual unit, by words that are typed at a terminal.
//
//   VirtualHands hands(plugged);
//   const Result<std::string> done = hands.obey("+z");  // "it lies on ..."
//
// | word              | what the hands do                                                        |
// |-------------------|--------------------------------------------------------------------------|
// | +x -x +y -y +z -z | turn the unit, that axis up (+) or down (-)                              |
// | +x+y-z            | stand it on a corner: x and y up, z down (any signs)                     |
// | +x turned         | as +x, half a turn about the vertical from how +x alone lays it          |
// | knock             | move it a little, and back                                               |
// | swap              | pull it out, and plug another one in after a second                      |
//
// Any thread.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <string_view>

#include "device/jig.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::mocks {

// What hands do to a unit whose mutex the caller holds; `up`: the direction that points up then.
Eigen::Vector3d up_of(device::Pose pose);
void turn_by_hand(PluggedUnit& plugged, const Eigen::Vector3d& up, double tilt_deg = 0,
                  bool half_turned = false);
void knock_by_hand(PluggedUnit& plugged, const Eigen::Vector3d& up, bool half_turned = false);

class VirtualHands {
 public:
  explicit VirtualHands(std::shared_ptr<PluggedUnit> plugged) : plugged_(std::move(plugged)) {}

  // One sentence about what was done; usage for another word.
  Result<std::string> obey(std::string_view word);

 private:
  std::shared_ptr<PluggedUnit> plugged_;
  Eigen::Vector3d up_ = up_of(device::Pose::plus_z);
  bool half_turned_ = false;
};

}  // namespace sixpoint::mocks

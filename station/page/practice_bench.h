// Virtual units that are turned and unplugged by buttons of the page, for practice. An interface,
// so that the station does not include the mocks; cli/station/practice_bench.h implements it.
//
//   if (bench.has("virtual:seed=7")) {
//     SIXPOINT_CHECK(bench.turn("virtual:seed=7", device::Pose::plus_x, 0));
//   }
//
// `device` is a device string. All functions may be called from any thread.
#pragma once

#include <string>

#include "base/result.h"
#include "device/jig.h"

namespace sixpoint::station {

class PracticeBench {
 public:
  virtual ~PracticeBench() = default;
  virtual bool has(const std::string& device) const = 0;
  // `usage` where has() is false.
  virtual Status turn(const std::string& device, device::Pose pose, double tilt_deg) = 0;
  virtual Status lean(const std::string& device) = 0;   // onto an edge, between two faces
  virtual Status knock(const std::string& device) = 0;  // moves it a little and back
  virtual Status set_plugged(const std::string& device, bool plugged) = 0;
  // Pulls it out and plugs in another unit with this serial number.
  virtual Status swap(const std::string& device, const std::string& serial) = 0;
};

}  // namespace sixpoint::station

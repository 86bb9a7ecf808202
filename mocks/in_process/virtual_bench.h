// Virtual units that stay plugged in when a program closes them, and can be turned.
//
//   VirtualBench bench;
//   bench.register_in(links);
//   SIXPOINT_ASSIGN(const device::Link link, links.open("virtual:seed=7", env));
//   SIXPOINT_CHECK(bench.turn("virtual:seed=7", device::Pose::plus_x));
//
// The `virtual:` scheme of in_process.h makes a new unit at every opening. A bench has one unit per
// address: it can be closed and opened again, turned, knocked, unplugged and swapped while a
// station works with it. For practice without hardware, and for tests of everything above the wire.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "device/jig.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::mocks {

// Safe to use from several threads. Outlives the registry that it was registered in.
class VirtualBench {
 public:
  // Registers "virtual:" so that it opens the bench's units. Unplugged ones answer
  // device_unavailable.
  void register_in(device::TransportRegistry& registry);

  // Actions on the unit of an address ("virtual:..."). usage where the bench has no such unit: it
  // was never opened.
  Status turn(const std::string& device, device::Pose pose, double tilt_deg = 0);
  Status lean(const std::string& device);                       // on an edge, between two faces
  Status knock(const std::string& device);                      // moves it a little and back
  Status set_plugged(const std::string& device, bool plugged);  // its RAM is lost, as by the cable
  // Pulls it out and plugs another in, which has this seed and serial number.
  Status swap(const std::string& device, std::uint64_t seed, const std::string& serial);
  bool has(const std::string& device) const;
  // The motor of its jig, and the operator who takes his hands out of it after a stop.
  Result<JigMotor> motor(const std::string& device) const;
  Status hands_out(const std::string& device);

 private:
  struct Place;
  Result<std::shared_ptr<PluggedUnit>> unit_of(const std::string& device) const;
  Status turn_up(const std::string& device, const Eigen::Vector3d& up, double tilt_deg) const;

  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Place>> places_;
};

}  // namespace sixpoint::mocks

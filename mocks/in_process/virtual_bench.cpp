#include "mocks/in_process/virtual_bench.h"

#include <utility>

#include <fmt/format.h>

#include "mocks/firmware/virtual_settings.h"
#include "mocks/in_process/scaled_clock.h"
#include "mocks/in_process/virtual_hands.h"

namespace sixpoint::mocks {

struct VirtualBench::Place {
  std::shared_ptr<PluggedUnit> plugged;
  bool with_jig = false;
  device::Pose pose = device::Pose::plus_z;
};

void VirtualBench::register_in(device::TransportRegistry& registry) {
  registry.add("virtual", "virtual:seed=7,jig=auto",
               [this](std::string_view rest, Env& env) -> Result<device::Link> {
                 const std::string address = fmt::format("virtual:{}", rest);
                 std::shared_ptr<Place> place;
                 {
                   const std::lock_guard lock(mutex_);
                   if (const auto found = places_.find(address); found != places_.end()) {
                     place = found->second;
                   }
                 }
                 if (!place) {
                   SIXPOINT_ASSIGN(VirtualSettings settings,
                                   parse_openable_settings(rest, fresh_seed(env)));
                   place = std::make_shared<Place>();
                   place->with_jig = settings.with_jig;
                   place->plugged = std::make_shared<PluggedUnit>(std::move(settings.unit),
                                                                  clock_of(settings, env.clock));
                   const std::lock_guard lock(mutex_);
                   place = places_.emplace(address, place).first->second;
                 }
                 const std::lock_guard lock(mutex_);
                 {
                   const std::lock_guard unit_lock(place->plugged->mutex);
                   if (place->plugged->unplugged) {
                     return fail(ErrorCode::device_unavailable, "no unit is plugged in", address,
                                 "plug it in");
                   }
                   place->plugged->cancelled = false;
                 }
                 device::Link link = link_to(place->plugged, place->with_jig);
                 link.address = address;
                 return link;
               });
}

bool VirtualBench::has(const std::string& device) const {
  const std::lock_guard lock(mutex_);
  return places_.contains(device);
}

Result<std::shared_ptr<PluggedUnit>> VirtualBench::unit_of(const std::string& device) const {
  const std::lock_guard lock(mutex_);
  const auto found = places_.find(device);
  if (found == places_.end()) {
    return fail(ErrorCode::usage, "this is no virtual unit of this bench", device,
                "only virtual units can be turned by program");
  }
  return found->second->plugged;
}

Status VirtualBench::turn_up(const std::string& device, const Eigen::Vector3d& up,
                             double tilt_deg) const {
  SIXPOINT_ASSIGN(const auto plugged, unit_of(device));
  const std::lock_guard lock(plugged->mutex);
  turn_by_hand(*plugged, up, tilt_deg);
  return {};
}

Status VirtualBench::turn(const std::string& device, device::Pose pose, double tilt_deg) {
  SIXPOINT_CHECK(turn_up(device, up_of(pose), tilt_deg));
  const std::lock_guard lock(mutex_);
  places_.at(device)->pose = pose;
  return {};
}

Status VirtualBench::lean(const std::string& device) {
  return turn_up(device, Eigen::Vector3d(1, 0, 1).normalized(), 0);
}

Status VirtualBench::knock(const std::string& device) {
  SIXPOINT_ASSIGN(const auto plugged, unit_of(device));
  Eigen::Vector3d up;
  {
    const std::lock_guard lock(mutex_);
    up = up_of(places_.at(device)->pose);
  }
  const std::lock_guard lock(plugged->mutex);
  knock_by_hand(*plugged, up);
  return {};
}

Status VirtualBench::set_plugged(const std::string& device, bool plugged_in) {
  SIXPOINT_ASSIGN(const auto plugged, unit_of(device));
  const std::lock_guard lock(plugged->mutex);
  if (plugged->unplugged != plugged_in) {
    return {};  // as it is already
  }
  plugged->unplugged = !plugged_in;
  if (plugged_in) {
    plugged->unit.restore_power(plugged->clock->elapsed());
  } else {
    plugged->unit.cut_power(plugged->clock->elapsed());
  }
  return {};
}

Result<JigMotor> VirtualBench::motor(const std::string& device) const {
  SIXPOINT_ASSIGN(const auto plugged, unit_of(device));
  const std::lock_guard lock(plugged->mutex);
  return plugged->motor;
}

Status VirtualBench::hands_out(const std::string& device) {
  SIXPOINT_ASSIGN(const auto plugged, unit_of(device));
  const std::lock_guard lock(plugged->mutex);
  plugged->motor.hands_out();
  return {};
}

Status VirtualBench::swap(const std::string& device, std::uint64_t seed,
                          const std::string& serial) {
  SIXPOINT_ASSIGN(const auto old, unit_of(device));
  sim::GivenProperties given;
  given.serial = serial;
  VirtualUnitOptions options;
  options.seed = seed;
  options.truth = sim::draw_unit(seed, given);
  {
    const std::lock_guard lock(old->mutex);
    old->unplugged = true;
  }
  const std::lock_guard lock(mutex_);
  places_.at(device)->plugged = std::make_shared<PluggedUnit>(std::move(options), old->clock);
  return {};
}

}  // namespace sixpoint::mocks

// Whether an order to start still holds when the lane comes to it: it belongs to one unit.
//
//   const auto dead = why_order_is_dead({"MOS2A45130007", 0.1, "MOS2A45130007"});
//
// | unit in the lane now | since the order       | answer                              |
// |----------------------|-----------------------|-------------------------------------|
// | the one it was for   | up to kOrderLife_s    | it holds: nothing                   |
// | the one it was for   | longer                | dead: no one expects it any more    |
// | another              | any                   | dead: no run, least of all a write  |
// | none                 | any                   | dead: it does not wait for a unit   |
//
// The lane also drops an order at once when its unit leaves. Times in seconds; pure functions.
//
// Likewise the operator's word that a motorised jig is free: it is about what the operator saw.
//
//   const auto why = why_release_is_dead({"emergency stop", 0.1, "emergency stop"});
//
// | fault that the jig shows now | since the word     | answer                                |
// |------------------------------|--------------------|---------------------------------------|
// | the one at the word          | up to kOrderLife_s | it holds: nothing                     |
// | the one at the word          | longer             | dead: no one looks at the jig any more |
// | another                      | any                | dead: no one has seen that            |
// | none                         | any                | dead: there is nothing to release     |
#pragma once

#include <optional>
#include <string>

namespace sixpoint::station {

inline constexpr double kOrderLife_s = 5;

struct OrderAndUnit {
  std::string ordered_for;  // serial number of the unit that was in the lane then
  double age_s = 0;
  std::optional<std::string> present;  // serial number, as the unit itself says now
};

struct ReleaseAndJig {
  std::string fault_then;  // that the lane showed when the operator said that the jig is free
  double age_s = 0;
  std::string fault_now;  // empty where it is free
};

// Why the order or the word is dropped, for people; nothing where it holds.
std::optional<std::string> why_order_is_dead(const OrderAndUnit& order);
std::optional<std::string> why_release_is_dead(const ReleaseAndJig& release);

}  // namespace sixpoint::station

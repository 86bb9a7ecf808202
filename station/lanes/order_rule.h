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
// The lane also drops an order at once when its unit leaves. Times in seconds; a pure function.
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

// Why the order is dropped, for people; nothing where it holds.
std::optional<std::string> why_order_is_dead(const OrderAndUnit& order);

}  // namespace sixpoint::station

#include "station/lanes/order_rule.h"

#include <fmt/format.h>

#include "base/result.h"

namespace sixpoint::station {

std::optional<std::string> why_order_is_dead(const OrderAndUnit& order) {
  const std::string whose = printable(order.ordered_for, 40);
  if (!order.present) {
    return fmt::format("not started: unit {} left before its run began", whose);
  }
  if (*order.present != order.ordered_for) {
    return fmt::format("not started: the start was for unit {}, and this is {}", whose,
                       printable(*order.present, 40));
  }
  if (order.age_s > kOrderLife_s) {
    return fmt::format("not started: the start was given {:.0f} s ago; start again", order.age_s);
  }
  return std::nullopt;
}

std::optional<std::string> why_release_is_dead(const ReleaseAndJig& release) {
  if (release.fault_now.empty()) {
    return "not released: the jig is free already";
  }
  if (release.fault_now != release.fault_then) {
    return fmt::format("not released: the jig shows another fault now: {}",
                       printable(release.fault_now, 100));
  }
  if (release.age_s > kOrderLife_s) {
    return fmt::format("not released: the jig was called free {:.0f} s ago; look at it again",
                       release.age_s);
  }
  return std::nullopt;
}

}  // namespace sixpoint::station

#include "gt3x/container/delivery.h"

#include <array>

namespace sixpoint::gt3x {

std::string_view to_string(Damage damage) {
  constexpr std::array<std::string_view, 10> kNames = {
      "none",       "wrong_crc",    "no_crc",  "wrong_length", "broken_stream",
      "lost_entry", "no_directory", "no_info", "no_samples",   "refused"};
  return kNames[static_cast<std::size_t>(damage)];
}

Delivery what_may_be_delivered(Damage damage, bool salvage) {
  switch (damage) {
    case Damage::none:
      return Delivery::all;
    case Damage::no_samples:
    case Damage::refused:
      return Delivery::nothing;
    default:
      return salvage ? Delivery::what_is_left : Delivery::nothing;
  }
}

std::string hint_about(Damage damage) {
  std::string hint = "download the recording from the unit again, or fetch an undamaged copy";
  if (what_may_be_delivered(damage, true) == Delivery::what_is_left) {
    hint += "; inspect, export and repair read what is left of it with --salvage";
  }
  return hint;
}

}  // namespace sixpoint::gt3x

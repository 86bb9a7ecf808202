// Turns a virtual unit as the program's prompts ask for, as a technician would.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "device/jig.h"
#include "usb/bench.h"

namespace sixpoint::tests {

class Technician {
 public:
  explicit Technician(BenchUnit& unit) : unit_(unit) {}
  void on_line(const std::string& line) {
    // "turn the unit to +x: ...", "lay the unit on -z ...", "take the unit off, ... turn it to +y
    // ...", and of a capture "side 2 of 6: -x - its x axis ..."
    constexpr std::array<std::string_view, 4> kPrompts = {"turn the unit to ", "lay the unit on ",
                                                          "turn it to ", " of 6: "};
    const bool off_first = line.starts_with("take the unit off");
    for (const std::string_view prompt : kPrompts) {
      const std::size_t at = line.find(prompt);
      if (at == std::string::npos) {
        continue;
      }
      const auto pose = device::parse_pose(line.substr(at + prompt.size(), 2));
      if (!pose) {
        continue;
      }
      turn(*pose, off_first);
      return;
    }
  }
  int turns = 0;

 private:
  void turn(device::Pose pose, bool off_first) {
    const auto up = device::direction_of(pose);
    const std::lock_guard lock(unit_.unit->mutex);
    auto now = unit_.clock->elapsed();
    if (off_first) {
      unit_.unit->unit.turn_to({up[1], up[2], up[0]}, now, 0.3);
      now += std::chrono::milliseconds(500);
    }
    unit_.unit->unit.turn_to({up[0], up[1], up[2]}, now, 0.3);
    ++turns;
  }

  BenchUnit& unit_;
};

}  // namespace sixpoint::tests

// A clock that runs a whole number of times faster than another.
//
//   ScaledClock clock(env.clock, 10);
//   clock.sleep(std::chrono::seconds(10));  // takes one second
#pragma once

#include <memory>

#include "base/env.h"

namespace sixpoint::mocks {

class ScaledClock final : public Clock {
 public:
  // `base` outlives it.
  ScaledClock(Clock& base, int factor)
      : base_(base), factor_(factor), start_(base.elapsed()), start_time_(base.now()) {}
  UtcTime now() override { return start_time_ + (elapsed() - start_); }
  std::chrono::nanoseconds elapsed() override {
    return start_ + (base_.elapsed() - start_) * factor_;
  }
  void sleep(std::chrono::nanoseconds duration) override { base_.sleep(duration / factor_); }

 private:
  Clock& base_;
  int factor_;
  std::chrono::nanoseconds start_;
  UtcTime start_time_;
};

struct VirtualSettings;
// The clock that the settings ask for (`pace`): real, N times that, or one that waiting moves.
std::shared_ptr<Clock> clock_of(const VirtualSettings& settings, Clock& machine);

}  // namespace sixpoint::mocks

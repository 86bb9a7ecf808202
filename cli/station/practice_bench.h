// The page's practice bench (station/page/practice_bench.h) over virtual units: `sixpoint station`
// gives it to the page, which may not know what a mock is.
//
//   mocks::VirtualBench bench;
//   VirtualPracticeBench practice(bench);  // `bench` must live longer
#pragma once

#include <functional>

#include "mocks/in_process/virtual_bench.h"
#include "station/page/practice_bench.h"

namespace sixpoint::cli {

class VirtualPracticeBench final : public station::PracticeBench {
 public:
  explicit VirtualPracticeBench(mocks::VirtualBench& bench) : bench_(bench) {}

  bool has(const std::string& device) const override { return bench_.has(device); }
  Status turn(const std::string& device, device::Pose pose, double tilt_deg) override {
    return bench_.turn(device, pose, tilt_deg);
  }
  Status lean(const std::string& device) override { return bench_.lean(device); }
  Status knock(const std::string& device) override { return bench_.knock(device); }
  Status set_plugged(const std::string& device, bool plugged) override {
    return bench_.set_plugged(device, plugged);
  }
  Status swap(const std::string& device, const std::string& serial) override {
    return bench_.swap(device, std::hash<std::string>{}(serial), serial);
  }

 private:
  mocks::VirtualBench& bench_;
};

}  // namespace sixpoint::cli

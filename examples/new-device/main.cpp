// Calibrates a unit that the program has never heard of: six sides, then three of them again.
//   example_new_device FOLDER   writes FOLDER/lines.txt, as the board would print it, and reads it
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "base/env.h"
#include "calib/poses/six_pose.h"
#include "lines_unit.h"

namespace {

using namespace sixpoint;

// The sensor on the board, known here because it is made here.
constexpr PerAxis<double> kZero_lsb = {12.4, -31.7, 55.2};
constexpr PerAxis<double> kSensitivity_lsb_per_g = {251.3, 263.8, 247.9};
constexpr int kSamplesPerPose = 320;
constexpr std::array<PerAxis<double>, 9> kPoses = {{{1, 0, 0},
                                                    {-1, 0, 0},
                                                    {0, 1, 0},
                                                    {0, -1, 0},
                                                    {0, 0, 1},
                                                    {0, 0, -1},
                                                    {1, 0, 0},
                                                    {0, 1, 0},
                                                    {0, 0, -1}}};

void write_lines(const std::string& path) {
  std::ofstream lines(path);
  std::mt19937 random(7);
  std::normal_distribution<double> noise_lsb(0, 1);
  for (const PerAxis<double>& up : kPoses) {
    for (int i = 0; i < kSamplesPerPose; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double value =
            kZero_lsb[axis] + kSensitivity_lsb_per_g[axis] * up[axis] + noise_lsb(random);
        lines << std::lround(value) << (axis == 2 ? '\n' : ' ');
      }
    }
  }
}

Result<calib::PoseMean> mean_of_pose(device::Unit& unit, const PerAxis<double>& up) {
  calib::PoseMean mean;
  mean.up = up;
  PerAxis<double> squares{};
  while (mean.samples < kSamplesPerPose) {
    SIXPOINT_ASSIGN(const auto block, unit.next_samples(std::chrono::seconds(1)));
    if (!block) {
      continue;
    }
    for (const device::RawCounts& counts : block->counts) {
      ++mean.samples;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        mean.mean_lsb[axis] += counts[axis];
        squares[axis] += static_cast<double>(counts[axis]) * counts[axis];
      }
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    mean.mean_lsb[axis] /= mean.samples;
    mean.sd_lsb[axis] =
        std::sqrt(squares[axis] / mean.samples - mean.mean_lsb[axis] * mean.mean_lsb[axis]);
  }
  return mean;
}

Result<calib::SixPoseReport> calibrate(const std::string& address) {
  device::UnitRegistry registry({}, {});
  example::register_lines(registry);
  SIXPOINT_ASSIGN(const auto unit, registry.open(address, posix_env()));
  SIXPOINT_CHECK(unit->start_stream(100));
  std::vector<calib::PoseMean> readings;
  for (const PerAxis<double>& up : kPoses) {
    SIXPOINT_ASSIGN(readings.emplace_back(), mean_of_pose(*unit, up));
  }
  SIXPOINT_CHECK(unit->stop_stream());
  return calib::solve_six_poses(std::span(readings).first(6), std::span(readings).last(3));
}

}  // namespace

int main(int count, char** words) {
  const std::string path = std::string(count > 1 ? words[1] : ".") + "/lines.txt";
  write_lines(path);
  const auto report = calibrate("lines:" + path);
  if (!report) {
    std::fprintf(stderr, "%s\n", report.error().brief().c_str());
    return 1;
  }
  std::printf("%s\n", report->brief().c_str());
  // Oracle: the constants that the lines were made with. The mean of 320 samples with 1 LSB of
  // noise is right to 0.06 LSB, six of them beyond that only once in a thousand.
  bool right = report->usable();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double zero_lsb = report->best().calibration.zero_lsb[axis];
    const double lsb_per_g = 1 / report->best().calibration.sensitivity_g_per_lsb[axis];
    std::printf("%c: zero %.2f LSB, %.2f LSB/g\n", "xyz"[axis], zero_lsb, lsb_per_g);
    right = right && std::abs(zero_lsb - kZero_lsb[axis]) < 0.25 &&
            std::abs(lsb_per_g - kSensitivity_lsb_per_g[axis]) < 0.25;
  }
  return right ? 0 : 1;
}

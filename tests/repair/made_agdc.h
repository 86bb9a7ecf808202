// An .agdc recording of a unit at rest, by a calibration that fits it.
//
//   MadeAgdc made;
//   made.calibrated = true;            // in g times 256, not raw counts
//   made.write(files, "in.agdc");
//
// The six-point entries are the vendor's placeholders (256, -256, 0), as one of the public files has
// them: who judges by them is more than 200 mg off.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "base/measure.h"
#include "base/random.h"
#include "gt3x/log/record.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording_writer.h"

namespace sixpoint::tests {

struct MadeAgdc {
  bool calibrated = false;
  bool coefficients = true;   // false: calibration.json says nothing of offset and matrix
  bool calibration = true;    // false: there is no calibration.json
  int scale_lsb_per_g = 256;  // of info.txt, where calibrated

  // Of CPW1C48210013 at 32 Hz: LSB, and hundredths of LSB/g as calibration.json has them.
  static constexpr PerAxis<int> kOffset = {32, 18, 89};
  static constexpr PerAxis<int> kDiagonal = {24608, 26084, 25302};
  static constexpr PerAxis<int> kCross = {-571, 67, 22};  // xy xz yz

  static double g_per_lsb(std::size_t row, std::size_t column) {
    return row == column ? 100.0 / kDiagonal[row]
                         : 1 / (250 + kCross[row + column - 1] / 100.0) - 1.0 / 250;
  }

  // g = matrix * (raw - offset), solved for raw by Jacobi's iteration.
  static PerAxis<double> raw_of(const PerAxis<double>& g) {
    PerAxis<double> above{};
    for (int step = 0; step < 50; ++step) {
      PerAxis<double> next{};
      for (std::size_t a = 0; a < kAxes; ++a) {
        next[a] = g[a];
        for (std::size_t b = 0; b < kAxes; ++b) {
          next[a] -= a == b ? 0 : g_per_lsb(a, b) * above[b];
        }
        next[a] /= g_per_lsb(a, a);
      }
      above = next;
    }
    return {kOffset[0] + above[0], kOffset[1] + above[1], kOffset[2] + above[2]};
  }

  // Twenty seconds each on the six sides, and on edges, where the cross-axis terms show.
  static std::vector<PerAxis<double>> poses() {
    const double half = std::sqrt(0.5);
    return {{1, 0, 0},        {-1, 0, 0},        {0, 1, 0},       {0, -1, 0},
            {0, 0, 1},        {0, 0, -1},        {half, half, 0}, {half, -half, 0},
            {-half, half, 0}, {-half, -half, 0}, {half, 0, half}, {0, half, -half}};
  }

  std::string json() const {
    std::string text = fmt::format(R"({{"calibrationMethod":2,"isCalibrated":{})", calibrated);
    for (std::size_t a = 0; coefficients && a < kAxes; ++a) {
      const char axis = "XYZ"[a];
      text += fmt::format(R"(,"offset{0}_32":{1},"sensitivity{0}{0}_32":{2})", axis, kOffset[a],
                          kDiagonal[a]);
      text += fmt::format(R"(,"positiveZeroGOffset{0}_32":256,"negativeZeroGOffset{0}_32":-256)"
                          R"(,"zeroGOffset{0}_32":0)",
                          axis);
      for (std::size_t b = a + 1; b < kAxes; ++b) {
        text += fmt::format(R"(,"sensitivity{}{}_32":{})", axis, "XYZ"[b], kCross[a + b - 1]);
      }
    }
    return text + "}";
  }

  Status write(FileSystem& files, const std::string& path) const {
    Random random(4);
    Bytes log;
    std::uint32_t time = 1'660'839'480;
    for (const PerAxis<double>& g : poses()) {
      PerAxis<double> mean = raw_of(g);
      if (calibrated) {
        mean = {256 * g[0], 256 * g[1], 256 * g[2]};
      }
      for (int second = 0; second < 20; ++second) {
        std::vector<gt3x::Counts> samples(32);
        for (gt3x::Counts& sample : samples) {
          for (std::size_t a = 0; a < kAxes; ++a) {
            sample[a] = static_cast<std::int16_t>(std::lround(mean[a] + 0.7 * random.normal()));
          }
        }
        Bytes payload;
        gt3x::append_activity3(payload, samples);
        gt3x::append_record(log, gt3x::RecordType::activity3, time++, payload);
      }
    }
    SIXPOINT_ASSIGN(auto out, gt3x::RecordingWriter::create(files, path));
    SIXPOINT_CHECK(out.add("log.bin", std::move(log)));
    SIXPOINT_CHECK(out.add("info.txt", std::string_view(fmt::format(
                                           "Serial Number: CPW1C48210013\r\nFirmware: 2.1.9\r\n"
                                           "Sample Rate: 32\r\nAcceleration Scale: {}\r\n",
                                           calibrated ? scale_lsb_per_g : 1))));
    if (calibration) {
      SIXPOINT_CHECK(out.add("calibration.json", std::string_view(json())));
    }
    return out.commit();
  }
};

}  // namespace sixpoint::tests

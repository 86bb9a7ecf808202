// The one real free-living day (20.7 h on a wrist, 30 Hz, a GT9X) and GGIR's measure of it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include <zlib.h>

#include "calib/constants.h"
#include "shared_data.h"

namespace sixpoint::tests {

// As the unit stored it: the file has g to three decimals, which 256 LSB/g makes whole again.
inline std::vector<std::array<std::int16_t, 3>> free_living_counts() {
  struct Close {
    void operator()(gzFile_s* file) const { gzclose(file); }
  };
  const std::unique_ptr<gzFile_s, Close> file(
      gzopen(shared_file("data/autocalibration/agcounts_20h_30hz.csv.gz").c_str(), "rb"));
  std::vector<std::array<std::int16_t, 3>> counts;
  std::array<char, 200> line{};
  while (file && gzgets(file.get(), line.data(), static_cast<int>(line.size())) != nullptr) {
    std::array<std::int16_t, 3> sample{};
    const char* at = line.data();
    std::size_t read = 0;
    for (; read < 3; ++read) {
      char* end = nullptr;
      const double mg = std::strtod(at, &end);
      if (end == at) {
        break;
      }
      sample[read] = static_cast<std::int16_t>(std::lround(mg * 0.256));
      at = *end == ',' ? end + 1 : end;
    }
    if (read == 3) {
      counts.push_back(sample);
    }
  }
  return counts;
}

// GGIR's windows: 10 s, standard deviation below 13 mg on every axis, mean below 2 g, from the
// first 20 hours. Mean counts.
inline std::vector<std::array<double, 3>> ggir_windows(
    const std::vector<std::array<std::int16_t, 3>>& samples) {
  constexpr std::size_t kWindow = 300;
  constexpr double kCountsPerMg = 0.256;
  std::vector<std::array<double, 3>> windows;
  const std::size_t end = std::min<std::size_t>(samples.size(), 20UL * 3600 * 30);
  for (std::size_t begin = 0; begin + kWindow <= end; begin += kWindow) {
    std::array<double, 3> mean{};
    bool still = true;
    for (std::size_t a = 0; a < 3; ++a) {
      double sum = 0;
      double squares = 0;
      for (std::size_t i = begin; i < begin + kWindow; ++i) {
        sum += samples[i][a];
        squares += static_cast<double>(samples[i][a]) * samples[i][a];
      }
      mean[a] = sum / kWindow;
      const double sd =
          std::sqrt(std::max(0.0, (squares - kWindow * mean[a] * mean[a]) / (kWindow - 1)));
      still = still && sd < 13 * kCountsPerMg && std::abs(mean[a]) < 2000 * kCountsPerMg;
    }
    if (still) {
      windows.push_back(mean);
    }
  }
  return windows;
}

// Mean of | |a| - 1 g | over the windows.
template <class ToG>
double mean_error_mg(const std::vector<std::array<double, 3>>& windows, const ToG& to_g) {
  double sum = 0;
  for (const auto& mean_lsb : windows) {
    const std::array<double, 3> g = to_g(mean_lsb);
    sum += std::abs(std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) - 1);
  }
  return 1000 * sum / static_cast<double>(windows.size());
}

// ggir_result.json: calibrated = offset + scale * measured.
inline calib::Calibration ggir_constants() {
  const std::array<double, 3> scale = {0.98795082, 0.99190162, 0.98241323};
  const std::array<double, 3> offset_g = {-0.01960784, 0.05068749, -0.00163188};
  calib::Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = scale[a] / 256;
    out.zero_lsb[a] = -256 * offset_g[a] / scale[a];
  }
  return out;
}

}  // namespace sixpoint::tests

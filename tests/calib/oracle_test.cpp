// The solvers against other people's: Ceres, a plain normal-equations fit, GGIR, the Xsens factory.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>

#include <ceres/ceres.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "calib/block_fit.h"
#include "calib/least_squares.h"
#include "calib/solve.h"
#include "calib/still_blocks.h"
#include "expect_result.h"
#include "shared_data.h"
#include "synthetic_unit.h"

namespace sixpoint::calib {
namespace {

using tests::Vector;

// |s (m - zero)| - g, with automatic derivatives.
struct CeresResidual {
  PerAxis<double> mean_lsb;
  double sigma_g;
  double gravity_g;
  template <class T>
  bool operator()(const T* counts_per_g, const T* zero, T* residual) const {
    T square = T(0);
    for (std::size_t a = 0; a < 3; ++a) {
      const T level = (mean_lsb[a] - zero[a]) / counts_per_g[a];
      square += level * level;
    }
    residual[0] = (sqrt(square) - gravity_g) / sigma_g;
    return true;
  }
};

Calibration by_ceres(const std::vector<GravityPoint>& points, const Calibration& start,
                     double gravity_g) {
  std::array<double, 3> counts_per_g{};
  std::array<double, 3> zero{};
  for (std::size_t a = 0; a < 3; ++a) {
    counts_per_g[a] = 1 / start.sensitivity_g_per_lsb[a];
    zero[a] = start.zero_lsb[a];
  }
  ceres::Problem problem;
  for (const GravityPoint& point : points) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CeresResidual, 1, 3, 3>(
                                 new CeresResidual{point.mean_lsb, point.sigma_g, gravity_g}),
                             nullptr, counts_per_g.data(), zero.data());
  }
  ceres::Solver::Options options;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-14;
  options.parameter_tolerance = 1e-14;
  options.max_num_iterations = 500;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = 1 / counts_per_g[a];
    out.zero_lsb[a] = zero[a];
  }
  return out;
}

// The ellipsoid without rotation, sum (A m^2 + B m) = 1, is linear in A and B: Gauss elimination on
// its normal equations. It minimises another error, so it agrees exactly without noise only.
Calibration by_normal_equations(const std::vector<GravityPoint>& points) {
  constexpr double kScale = 250;
  std::array<std::array<double, 7>, 6> m{};
  for (const GravityPoint& point : points) {
    std::array<double, 6> row{};
    for (std::size_t a = 0; a < 3; ++a) {
      const double v = point.mean_lsb[a] / kScale;
      row[a] = v * v;
      row[3 + a] = v;
    }
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = 0; j < 6; ++j) {
        m[i][j] += row[i] * row[j];
      }
      m[i][6] += row[i];
    }
  }
  for (std::size_t i = 0; i < 6; ++i) {
    std::size_t pivot = i;
    for (std::size_t k = i; k < 6; ++k) {
      pivot = std::abs(m[k][i]) > std::abs(m[pivot][i]) ? k : pivot;
    }
    std::swap(m[i], m[pivot]);
    for (std::size_t k = 0; k < 6; ++k) {
      if (k != i) {
        const double factor = m[k][i] / m[i][i];
        for (std::size_t j = i; j < 7; ++j) {
          m[k][j] -= factor * m[i][j];
        }
      }
    }
  }
  double radius = 1;
  std::array<double, 6> x{};
  for (std::size_t i = 0; i < 6; ++i) {
    x[i] = m[i][6] / m[i][i];
  }
  for (std::size_t a = 0; a < 3; ++a) {
    radius += x[3 + a] * x[3 + a] / (4 * x[a]);
  }
  Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.zero_lsb[a] = -x[3 + a] / (2 * x[a]) * kScale;
    out.sensitivity_g_per_lsb[a] = std::sqrt(x[a] / radius) / kScale;
  }
  return out;
}

std::vector<GravityPoint> made_points(unsigned seed, int count, double noise_g,
                                      tests::SyntheticUnit& unit) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> spread(-1, 1);
  std::normal_distribution<double> noise(0, 1);
  for (std::size_t a = 0; a < 3; ++a) {
    unit.counts_per_g[a] = 250 * (1 + 0.15 * spread(random));
    unit.zero_counts[a] = 80 * spread(random);
  }
  std::vector<GravityPoint> points;
  for (int i = 0; i < count; ++i) {
    const Vector up = tests::random_direction(random);
    GravityPoint point;
    point.sigma_g = 0.001 * (1 + i % 3);
    for (std::size_t a = 0; a < 3; ++a) {
      point.mean_lsb[a] =
          unit.zero_counts[a] + unit.counts_per_g[a] * (up[a] + noise_g * noise(random));
    }
    points.push_back(point);
  }
  return points;
}

const Calibration kNominal = {{0.004, 0.004, 0.004}, {0, 0, 0}};

TEST(LeastSquaresOracle, CeresFindsTheSameMinimum) {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    tests::SyntheticUnit unit;
    const auto points = made_points(seed, 12 + static_cast<int>(seed) * 3, 0.003, unit);
    const auto fit = least_squares(points, kNominal, {});
    ASSERT_OK(fit);
    EXPECT_TRUE(fit->converged) << seed;
    const Calibration other = by_ceres(points, kNominal, 1);
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(fit->calibration.sensitivity_g_per_lsb[a] / other.sensitivity_g_per_lsb[a], 1,
                  1e-8)
          << seed;
      EXPECT_NEAR(fit->calibration.zero_lsb[a], other.zero_lsb[a], 1e-5) << seed;
    }
  }
}

TEST(LeastSquaresOracle, NormalEquationsAgreeWithoutNoise) {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    tests::SyntheticUnit unit;
    const auto points = made_points(seed, 30, 0, unit);
    const auto fit = least_squares(points, kNominal, {});
    ASSERT_OK(fit);
    EXPECT_TRUE(fit->converged);
    const Calibration other = by_normal_equations(points);
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(fit->calibration.zero_lsb[a], other.zero_lsb[a], 1e-6);
      EXPECT_NEAR(fit->calibration.sensitivity_g_per_lsb[a] / other.sensitivity_g_per_lsb[a], 1,
                  1e-9);
      EXPECT_NEAR(fit->calibration.zero_lsb[a], unit.zero_counts[a], 1e-6);
    }
  }
}

// A rule that ends after one improving step stops here: from 45 % off, one step improves and is
// nowhere near.
TEST(LeastSquaresOracle, DoesNotStopAfterOneImprovingStep) {
  tests::SyntheticUnit unit;
  const auto points = made_points(77, 40, 0.001, unit);
  Calibration far = kNominal;
  for (double& sensitivity : far.sensitivity_g_per_lsb) {
    sensitivity *= 1.45;
  }
  LeastSquaresOptions once;
  once.starts = 1;
  once.max_iterations = 1;
  LeastSquaresOptions whole;
  whole.starts = 1;
  const auto one = least_squares(points, far, once);
  const auto all = least_squares(points, far, whole);
  ASSERT_OK(one);
  ASSERT_OK(all);
  EXPECT_FALSE(one->converged);
  EXPECT_TRUE(all->converged);
  EXPECT_GT(one->rms_mg, 3 * all->rms_mg);
  EXPECT_LT(difference_over_sphere(all->calibration, by_ceres(points, kNominal, 1)).worst_mg, 1e-4);
}

// Oracle: numerical differentiation of the fitted magnitude, cross-axis and temperature included.
TEST(LeastSquaresOracle, CrossAxisAndTemperatureAreRecovered) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.0002);
  std::uniform_real_distribution<double> warm(-10, 10);
  const Vector cross = {0.014, -0.006, 0.003};
  const Vector drift_lsb = {0.1, -0.05, 0.12};
  std::vector<GravityPoint> points;
  for (int i = 0; i < 400; ++i) {
    const Vector up = tests::random_direction(random);
    // u = (I + C)^-1 up, to second order.
    const auto turn = [&](const Vector& v) {
      return Vector{cross[0] * v[1] + cross[1] * v[2], cross[0] * v[0] + cross[2] * v[2],
                    cross[1] * v[0] + cross[2] * v[1]};
    };
    Vector u = up;
    for (int k = 0; k < 30; ++k) {
      const Vector c = turn(u);
      u = {up[0] - c[0], up[1] - c[1], up[2] - c[2]};
    }
    GravityPoint point;
    point.temperature_c = warm(random);
    for (std::size_t a = 0; a < 3; ++a) {
      point.mean_lsb[a] = 20 + drift_lsb[a] * point.temperature_c + 240 * (u[a] + noise(random));
    }
    points.push_back(point);
  }
  LeastSquaresOptions options;
  options.model = {true, true};
  const auto fit = least_squares(points, kNominal, options);
  ASSERT_OK(fit);
  EXPECT_TRUE(fit->converged);
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_NEAR(fit->cross_axis[a], cross[a], 2e-4);
    EXPECT_NEAR(fit->zero_lsb_per_c[a], drift_lsb[a], 0.003);
    EXPECT_NEAR(fit->calibration.zero_lsb[a], 20, 0.05);
    EXPECT_NEAR(1 / fit->calibration.sensitivity_g_per_lsb[a], 240, 0.1);
  }
}

struct GzClose {
  void operator()(gzFile_s* file) const { gzclose(file); }
};

std::vector<std::array<double, 4>> read_rows(const std::string& path, int columns, char separator) {
  std::unique_ptr<gzFile_s, GzClose> file(gzopen(path.c_str(), "rb"));
  std::vector<std::array<double, 4>> rows;
  std::array<char, 400> line{};
  while (file && gzgets(file.get(), line.data(), static_cast<int>(line.size())) != nullptr) {
    std::array<double, 4> row{};
    const char* at = line.data();
    int read = 0;
    for (; read < columns; ++read) {
      char* end = nullptr;
      row[static_cast<std::size_t>(read)] = std::strtod(at, &end);
      if (end == at) {
        break;
      }
      at = *end == separator ? end + 1 : end;
    }
    if (read == columns) {
      rows.push_back(row);
    }
  }
  return rows;
}

struct Sums {
  double values = 0;
  double squares = 0;
};
// Of value(begin) ... value(begin + count - 1).
template <class Value>
Sums sums_of(std::size_t begin, std::size_t count, const Value& value) {
  Sums sums;
  for (std::size_t i = begin; i < begin + count; ++i) {
    sums.values += value(i);
    sums.squares += value(i) * value(i);
  }
  return sums;
}

// GGIR's windows: 10 s, standard deviation below 13 mg on every axis, mean below 2 g. GGIR's error:
// mean of | |a| - 1 |.
TEST(PublishedOracle, GgirsErrorOnGgirsWindows) {
  SIXPOINT_NEED_SHARED("data/autocalibration/agcounts_20h_30hz.csv.gz");
  const auto rows =
      read_rows(tests::shared_file("data/autocalibration/agcounts_20h_30hz.csv.gz"), 3, ',');
  ASSERT_GT(rows.size(), 2'000'000U);
  std::vector<GravityPoint> points;
  const std::size_t twenty_hours = 20 * 3600 * 30;  // what GGIR used
  for (std::size_t begin = 0; begin + 300 <= std::min(rows.size(), twenty_hours); begin += 300) {
    GravityPoint point;
    bool still = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const Sums sums = sums_of(begin, 300, [&](std::size_t i) { return double{rows[i][a]}; });
      const double mean = sums.values / 300;
      const double sd = std::sqrt(std::max(0.0, (sums.squares - 300 * mean * mean) / 299));
      still = still && sd < 13 && std::abs(mean) < 2000;
      point.mean_lsb[a] = mean;
    }
    if (still) {
      points.push_back(point);
    }
  }
  const Calibration as_it_is = {{0.001, 0.001, 0.001}, {0, 0, 0}};
  const auto error_mg = [&](const Calibration& calibration) {
    double sum = 0;
    for (const GravityPoint& point : points) {
      sum += std::abs(magnitude_g(calibration, point.mean_lsb, {}) - 1);
    }
    return 1000 * sum / static_cast<double>(points.size());
  };
  const auto fit = least_squares(points, as_it_is, {});
  ASSERT_OK(fit);
  EXPECT_TRUE(fit->converged);
  std::printf("GGIR's windows: %zu, error before %.2f mg (GGIR 22.91), after %.2f mg (GGIR 3.94)\n",
              points.size(), error_mg(as_it_is), error_mg(fit->calibration));
  EXPECT_NEAR(error_mg(as_it_is), 22.91, 0.5);
  EXPECT_LE(error_mg(fit->calibration), 3.94);
}

// The same recording by the paper's blocks, to a verdict. GGIR: calibrated = offset + scale x.
TEST(PublishedOracle, FreeLivingIsVerifiedByThePapersBlocks) {
  SIXPOINT_NEED_SHARED("data/autocalibration/agcounts_20h_30hz.csv.gz");
  const auto rows =
      read_rows(tests::shared_file("data/autocalibration/agcounts_20h_30hz.csv.gz"), 3, ',');
  std::vector<StoredCounts> samples;
  for (const auto& row : rows) {
    samples.push_back({static_cast<std::int16_t>(row[0]), static_cast<std::int16_t>(row[1]),
                       static_cast<std::int16_t>(row[2])});
  }
  const auto reversal = Reversal::of_raw_counts(1000, RecordWidth::bits16);
  ASSERT_OK(reversal);
  auto finder = StillBlockFinder::make(*reversal, 30);
  ASSERT_OK(finder);
  finder->push(0, samples);
  const auto report = solve_from_still_blocks(finder->finish(), reversal->calibration());
  ASSERT_OK(report);
  std::printf("free living by the paper's blocks: %s\n", report->brief().c_str());
  for (const std::string& note : report->notes) {
    std::printf("  %s\n", note.c_str());
  }
  EXPECT_TRUE(report->verification.verified);
  // Over directions, every one equal; the six are the best for the time at rest (best_six_test).
  EXPECT_LT(*report->residual_after_mg, 0.7 * report->residual_before_mg);
  // By GGIR's measure, which counts blocks and not directions.
  std::printf("  mean error over blocks %.2f mg (GGIR's windows: 3.94 mg)\n",
              report->fit->mean_error_mg);
  EXPECT_LT(report->fit->mean_error_mg, 8.5);
  // GGIR fits six numbers to a sensor with 2 % of cross-axis, and weighs windows where this weighs
  // directions: they agree to 2 % and 25 mg, no better.
  const Vector scale = {0.98795082, 0.99190162, 0.98241323};
  const Vector offset = {-0.01960784, 0.05068749, -0.00163188};
  for (std::size_t a = 0; a < 3; ++a) {
    const double s = report->calibration->sensitivity_g_per_lsb[a];
    EXPECT_NEAR(s * 1000, scale[a], 0.025) << a;
    EXPECT_NEAR(-s * report->calibration->zero_lsb[a], offset[a], 0.025) << a;
  }
}

// imu_tk's Xsens recording against the factory's values.
TEST(PublishedOracle, XsensFactoryValues) {
  SIXPOINT_NEED_SHARED("data/multiposition/xsens_acc.txt.gz");
  const auto rows = read_rows(tests::shared_file("data/multiposition/xsens_acc.txt.gz"), 4, ' ');
  ASSERT_GT(rows.size(), 50'000U);
  constexpr double kGravity_m_per_s2 = 9.81744;
  constexpr double kMiddle = 32'768;  // counts are unsigned 16 bits
  std::vector<StoredCounts> samples;
  for (const auto& row : rows) {
    samples.push_back({static_cast<std::int16_t>(row[1] - kMiddle),
                       static_cast<std::int16_t>(row[2] - kMiddle),
                       static_cast<std::int16_t>(row[3] - kMiddle)});
  }
  const double nominal = 415 * kStandardGravity_m_per_s2;
  const auto reversal = Reversal::of_raw_counts(nominal, RecordWidth::bits16);
  ASSERT_OK(reversal);
  // 40 positions of a few seconds each: blocks of 1 s.
  StillBlockOptions one_second;
  one_second.block_s = 1;
  auto finder = StillBlockFinder::make(*reversal, 100, one_second);
  ASSERT_OK(finder);
  finder->push(0, samples);
  const auto blocks = finder->finish();
  BlockFitOptions options;
  options.gravity_g = kGravity_m_per_s2 / kStandardGravity_m_per_s2;
  const auto fit = fit_blocks(blocks, reversal->calibration(), options);
  ASSERT_OK(fit);
  // The factory states 0.01 to 0.02 of misalignment: the data must admit the cross-axis terms.
  ASSERT_TRUE(fit->richer.has_value());
  const LeastSquaresFit& found = fit->richer->fit;
  std::printf("Xsens: %zu blocks, %d directions, held out %.2f mg, cross-axis %.4f %.4f %.4f\n",
              fit->blocks_used, fit->directions, fit->richer->held_out_rms_mg, found.cross_axis[0],
              found.cross_axis[1], found.cross_axis[2]);
  EXPECT_LT(fit->richer->held_out_rms_mg, 3);
  const Vector scale = {415, 413, 415};
  const Vector bias = {33'123, 33'276, 32'360};
  for (std::size_t a = 0; a < 3; ++a) {
    const double counts_per_m_per_s2 =
        1 / (found.calibration.sensitivity_g_per_lsb[a] * kStandardGravity_m_per_s2);
    std::printf("  axis %zu: %.2f counts per m/s2 (factory %.0f), bias %.1f (factory %.0f)\n", a,
                counts_per_m_per_s2, scale[a], found.calibration.zero_lsb[a] + kMiddle, bias[a]);
    EXPECT_NEAR(counts_per_m_per_s2, scale[a], 0.005 * scale[a]);
    // 10 mg.
    EXPECT_NEAR(found.calibration.zero_lsb[a] + kMiddle, bias[a], 0.010 * nominal);
  }
}

// The numbers of the first matrix of a MATLAB 5 file whose elements are not compressed: enough for
// one file.
std::vector<double> read_matlab_doubles(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream content;
  content << file.rdbuf();
  const std::string bytes = content.str();
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    if (at + 4 <= bytes.size()) {
      std::memcpy(&value, bytes.data() + at, 4);
    }
    return value;
  };
  constexpr std::uint32_t kMatrix = 14;
  constexpr std::uint32_t kDouble = 9;
  std::vector<double> out;
  std::string plain;
  std::size_t at = 128;
  if (word(at) == 15) {  // compressed
    plain.resize(10'000'000);
    uLongf size = plain.size();
    const auto* source = reinterpret_cast<const Bytef*>(bytes.data() + at + 8);
    if (uncompress(reinterpret_cast<Bytef*>(plain.data()), &size, source, word(at + 4)) != Z_OK) {
      return out;
    }
    plain.resize(size);
  } else {
    plain = bytes.substr(at);
  }
  const auto plain_word = [&](std::size_t i) {
    std::uint32_t value = 0;
    if (i + 4 <= plain.size()) {
      std::memcpy(&value, plain.data() + i, 4);
    }
    return value;
  };
  if (plain_word(0) != kMatrix) {
    return out;
  }
  for (std::size_t i = 8; i + 8 <= plain.size();) {
    const bool small = plain_word(i) >> 16 != 0;
    const std::uint32_t type = small ? plain_word(i) & 0xFFFF : plain_word(i);
    const std::uint32_t size = small ? 4 : plain_word(i + 4);
    if (type == kDouble && !small && i + 8 + size <= plain.size()) {
      out.resize(size / 8);
      std::memcpy(out.data(), plain.data() + i + 8, out.size() * 8);
      break;
    }
    i += small ? 8 : 8 + (size + 7) / 8 * 8;
  }
  return out;
}

// A phone's accelerometer in 30 orientations: real data, two more solvers.
TEST(PublishedOracle, Lis3dhOrientationsAgainstCeresAndNormalEquations) {
  SIXPOINT_NEED_SHARED("data/multiposition/LIS3DH_30_orientations.mat");
  const auto values =
      read_matlab_doubles(tests::shared_file("data/multiposition/LIS3DH_30_orientations.mat"));
  ASSERT_EQ(values.size(), 8042U * 3);
  constexpr std::size_t kRows = 8042;
  double length = 0;
  for (std::size_t i = 0; i < kRows; ++i) {
    length += std::sqrt(std::pow(values[i], 2) + std::pow(values[kRows + i], 2) +
                        std::pow(values[2 * kRows + i], 2)) /
              kRows;
  }
  const double unit = length > 5 ? kStandardGravity_m_per_s2 : 1;  // m/s2 or g
  // Stretches of 50 samples in which nothing moved.
  std::vector<GravityPoint> points;
  for (std::size_t begin = 0; begin + 50 <= kRows; begin += 25) {
    GravityPoint point;
    bool still = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const Sums sums =
          sums_of(begin, 50, [&](std::size_t i) { return values[a * kRows + i] / unit * 250; });
      point.mean_lsb[a] = sums.values / 50;
      still = still && sums.squares / 50 - point.mean_lsb[a] * point.mean_lsb[a] < 25;  // 20 mg
    }
    if (still) {
      points.push_back(point);
    }
  }
  ASSERT_GT(points.size(), 100U);
  const auto fit = least_squares(points, kNominal, {});
  ASSERT_OK(fit);
  EXPECT_TRUE(fit->converged);
  double before = 0;
  for (const GravityPoint& point : points) {
    before += std::pow(magnitude_g(kNominal, point.mean_lsb, {}) - 1, 2);
  }
  before = 1000 * std::sqrt(before / static_cast<double>(points.size()));
  std::printf("LIS3DH: %zu stretches, %.2f mg before, %.2f mg after\n", points.size(), before,
              fit->rms_mg);
  EXPECT_LT(fit->rms_mg, 0.5 * before);
  const Calibration ceres = by_ceres(points, kNominal, 1);
  EXPECT_LT(difference_over_sphere(fit->calibration, ceres).worst_mg, 1e-3);
  // Another error measure, the same sensor.
  EXPECT_LT(difference_over_sphere(fit->calibration, by_normal_equations(points)).rms_mg, 2);
}

}  // namespace
}  // namespace sixpoint::calib

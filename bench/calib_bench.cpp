// The numbers of calib: accuracy over simulated units, honesty of the stated uncertainty, speed.
//
//   calib_bench [UNITS] [FIRST_SEED] [habits|confidence]    (1000 units and seed 1 by default)
//
// The generator of wear and noise is this file's own and shares no code with the solvers. The
// baseline is the closest-point iteration that is common in the field (van Hees 2014, as in GGIR's
// g.calibrate), stop rule included.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <time.h>

#include "calib/block_fit.h"
#include "calib/solve.h"
#include "calib/still_blocks.h"

namespace {

using namespace sixpoint;
using namespace sixpoint::calib;
using Vector = std::array<double, 3>;
// Time of this thread on its processor: what others do on the machine does not count.
struct Clock {
  static double now() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }
};

double seconds_since(double start) { return Clock::now() - start; }

struct Unit {
  Vector counts_per_g{};
  Vector zero{};
  Vector stored_counts_per_g{};
  Vector stored_zero{};
  Vector cross{};       // xy, xz, yz
  Vector drift_mg{};    // amplitude of the daily drift of each axis
  double sway_mg = 0;   // of a resting person, block by block
  double noise_mg = 4;  // per sample
  double rate_hz = 30;
};

Unit make_unit(std::mt19937_64& random) {
  std::uniform_real_distribution<double> spread(-1, 1);
  Unit unit;
  for (std::size_t a = 0; a < 3; ++a) {
    unit.stored_counts_per_g[a] = 257 * (1 + 0.05 * spread(random));
    unit.stored_zero[a] = 50 * spread(random);
    unit.counts_per_g[a] = unit.stored_counts_per_g[a] * (0.88 + 0.07 * spread(random));
    const double side = spread(random) > 0 ? 1 : -1;
    unit.zero[a] = unit.stored_zero[a] + side * 257 * (0.15 + 0.05 * spread(random));
  }
  return unit;
}

Vector normalised(Vector v) {
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  for (double& value : v) {
    value /= length;
  }
  return v;
}

Vector any_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return normalised({normal(random), normal(random), normal(random)});
}

Vector near(const Vector& direction, double radians, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0, radians);
  return normalised({direction[0] + normal(random), direction[1] + normal(random),
                     direction[2] + normal(random)});
}

Calibration stored_of(const Unit& unit) {
  Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = 1 / unit.stored_counts_per_g[a];
    out.zero_lsb[a] = unit.stored_zero[a];
  }
  return out;
}

// The mean over one 4 s block at rest.
StillBlock block_at(const Unit& unit, const Vector& up, double time_s, std::mt19937_64& random,
                    const Vector& zero_mg = {}) {
  std::normal_distribution<double> normal;
  StillBlock block;
  block.start_time_s = time_s;
  block.samples = static_cast<int>(4 * unit.rate_hz);
  const double noise_g = unit.noise_mg / 1000 / std::sqrt(block.samples);
  const double day = std::sin(2 * M_PI * time_s / 86'400);
  const double sway = unit.sway_mg / 1000 * normal(random);
  const double xy = unit.cross[0];
  const double xz = unit.cross[1];
  const double yz = unit.cross[2];
  Vector felt = {up[0] + xy * up[1] + xz * up[2], xy * up[0] + up[1] + yz * up[2],
                 xz * up[0] + yz * up[1] + up[2]};
  for (std::size_t a = 0; a < 3; ++a) {
    felt[a] +=
        (unit.drift_mg[a] * day + zero_mg[a]) / 1000 + up[a] * sway + noise_g * normal(random);
    block.mean_lsb[a] = unit.zero[a] + unit.counts_per_g[a] * felt[a];
    block.mean_g[a] = (block.mean_lsb[a] - unit.stored_zero[a]) / unit.stored_counts_per_g[a];
    block.sd_lsb[a] = unit.noise_mg / 1000 * unit.counts_per_g[a];
  }
  return block;
}

// Seven days on the wrist: nights in long bouts of few postures, days in short ones of many.
std::vector<StillBlock> week_on_wrist(const Unit& unit, std::mt19937_64& random) {
  std::vector<StillBlock> blocks;
  std::exponential_distribution<double> night_bout(1.0 / 1500);
  std::exponential_distribution<double> day_bout(1.0 / 30);
  for (int day = 0; day < 7; ++day) {
    const double midnight = day * 86'400.0;
    for (double time = midnight; time < midnight + 8 * 3600;) {
      const Vector posture = any_direction(random);
      const double end = std::min(time + night_bout(random), midnight + 8 * 3600.0);
      for (; time + 4 < end; time += 4) {
        blocks.push_back(block_at(unit, near(posture, 0.005, random), time, random));
      }
      time = end + 20;
    }
    for (double time = midnight + 8 * 3600; time < midnight + 86'400; time += 60) {
      const Vector posture = any_direction(random);
      const double end = time + day_bout(random);
      for (; time + 4 < end; time += 4) {
        blocks.push_back(block_at(unit, near(posture, 0.01, random), time, random));
      }
    }
  }
  return blocks;
}

// Seven days on the hip: nights on the bedside table, days mostly upright; on +x nothing but a few
// blocks that reach 0.34 g.
std::vector<StillBlock> week_on_hip(const Unit& unit, std::mt19937_64& random) {
  std::vector<StillBlock> blocks;
  std::exponential_distribution<double> bout(1.0 / 60);
  for (int day = 0; day < 7; ++day) {
    const double midnight = day * 86'400.0;
    const Vector table = normalised({-0.05, 0.1, random() % 2 == 0 ? 1.0 : -1.0});
    for (double time = midnight; time < midnight + 8 * 3600; time += 4) {
      blocks.push_back(block_at(unit, table, time, random));
    }
    for (double time = midnight + 8 * 3600; time < midnight + 86'400; time += 60) {
      Vector posture = any_direction(random);
      while (posture[0] > 0.34) {
        posture = any_direction(random);
      }
      const double end = time + bout(random);
      for (; time + 4 < end; time += 4) {
        blocks.push_back(block_at(unit, posture, time, random));
      }
    }
  }
  return blocks;
}

// |error of the magnitude| over 400 directions: mean and worst, in mg.
struct SphereError {
  double mean_mg = 0;
  double worst_mg = 0;
};
SphereError sphere_error(const Unit& unit, const Calibration& calibration) {
  SphereError out;
  constexpr int kCount = 400;
  for (int i = 0; i < kCount; ++i) {
    const double z = 1 - 2 * (i + 0.5) / kCount;
    const double turn = i * M_PI * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Vector up = {r * std::cos(turn), r * std::sin(turn), z};
    double square = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double raw = unit.zero[a] + unit.counts_per_g[a] * up[a];
      const double g = calibration.to_g(a, raw);
      square += g * g;
    }
    const double off = 1000 * std::abs(std::sqrt(square) - 1);
    out.mean_mg += off / kCount;
    out.worst_mg = std::max(out.worst_mg, off);
  }
  return out;
}

// The baseline: closest point on the sphere, a straight line per axis, weights by distance, until
// the residual changes by less than 1e-10 (GGIR's rule; its residual is divided by the number of
// windows).
Calibration closest_point(const Unit& unit, std::span<const StillBlock> blocks) {
  const auto n = static_cast<double>(blocks.size());
  Vector scale = {1, 1, 1};
  Vector offset{};
  std::vector<double> weight(blocks.size(), 1);
  double residual = HUGE_VAL;
  for (int iteration = 0; iteration < 1000; ++iteration) {
    std::array<std::array<double, 5>, 3> sums{};
    double next_residual = 0;
    double weights = 0;
    std::vector<double> next_weight(blocks.size());
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      Vector now{};
      double square = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        now[a] = offset[a] + scale[a] * blocks[i].mean_g[a];
        square += now[a] * now[a];
      }
      const double length = std::sqrt(square);
      double distance = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double closest = now[a] / length;
        distance += std::pow(now[a] - closest, 2);
        const double w = weight[i];
        sums[a][0] += w;
        sums[a][1] += w * now[a];
        sums[a][2] += w * closest;
        sums[a][3] += w * now[a] * now[a];
        sums[a][4] += w * now[a] * closest;
        next_residual += w * std::pow(now[a] - closest, 2);
      }
      weights += weight[i];
      next_weight[i] = std::min(1 / std::sqrt(distance), 100.0);
    }
    next_residual = 3 * next_residual / (3 * n) / weights;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto& s = sums[a];
      const double slope = (s[0] * s[4] - s[1] * s[2]) / (s[0] * s[3] - s[1] * s[1]);
      const double level = (s[2] - slope * s[1]) / s[0];
      offset[a] = level + offset[a] * slope;
      scale[a] *= slope;
    }
    weight = next_weight;
    if (std::abs(next_residual - residual) < 1e-10) {
      break;
    }
    residual = next_residual;
  }
  Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = scale[a] / unit.stored_counts_per_g[a];
    out.zero_lsb[a] = unit.stored_zero[a] - offset[a] / scale[a] * unit.stored_counts_per_g[a];
  }
  return out;
}

struct Statistics {
  double sum = 0;
  double worst = 0;
  int count = 0;
  void add(double value) {
    sum += value;
    worst = std::max(worst, value);
    ++count;
  }
  double mean() const { return count > 0 ? sum / count : 0; }
};

// The covariance at the Cramer-Rao bound: the information of the directions at the truth, relative
// sensitivity X Y Z and zero in g X Y Z, inverted by Gauss-Jordan.
using Matrix6 = std::array<std::array<double, 6>, 6>;
Matrix6 cramer_rao(std::span<const Vector> directions, double sigma_g) {
  double m[6][12] = {};
  for (const Vector& up : directions) {
    // d|q| / d(relative sensitivity) = up^2, d|q| / d(zero in g) = -up.
    const double row[6] = {up[0] * up[0], up[1] * up[1], up[2] * up[2], -up[0], -up[1], -up[2]};
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        m[i][j] += row[i] * row[j] / (sigma_g * sigma_g);
      }
    }
  }
  for (int i = 0; i < 6; ++i) {
    m[i][6 + i] = 1;
  }
  for (int i = 0; i < 6; ++i) {
    const double pivot = m[i][i];
    for (double& value : m[i]) {
      value /= pivot;
    }
    for (int k = 0; k < 6; ++k) {
      if (k == i) {
        continue;
      }
      const double factor = m[k][i];
      for (int j = 0; j < 12; ++j) {
        m[k][j] -= factor * m[i][j];
      }
    }
  }
  Matrix6 out{};
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      out[i][j] = m[i][6 + j];
    }
  }
  return out;
}

// The constants that an estimator exactly at the bound would have given: the truth and one normal
// draw of that covariance.
Calibration drawn_at_bound(const Unit& unit, const Matrix6& covariance, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Matrix6 root{};
  std::array<double, 6> white{};
  std::array<double, 6> off{};
  for (std::size_t i = 0; i < 6; ++i) {
    white[i] = normal(random);
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = covariance[i][j];
      for (std::size_t k = 0; k < j; ++k) {
        sum -= root[i][k] * root[j][k];
      }
      root[i][j] = i == j ? std::sqrt(sum) : sum / root[j][j];
      off[i] += root[i][j] * white[j];
    }
  }
  Calibration out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.sensitivity_g_per_lsb[a] = (1 + off[a]) / unit.counts_per_g[a];
    out.zero_lsb[a] = unit.zero[a] + off[3 + a] * unit.counts_per_g[a];
  }
  return out;
}

std::vector<Vector> directions_of(const Unit& unit, std::span<const StillBlock> blocks) {
  std::vector<Vector> out;
  out.reserve(blocks.size());
  for (const StillBlock& block : blocks) {
    Vector up{};
    for (std::size_t a = 0; a < 3; ++a) {
      up[a] = (block.mean_lsb[a] - unit.zero[a]) / unit.counts_per_g[a];
    }
    out.push_back(normalised(up));
  }
  return out;
}

template <class Wear>
void accuracy(const char* name, int units, unsigned seed, double rate_hz, double drift_mg,
              double wanted_mean, double wanted_worst, const Wear& wear) {
  Statistics mean, worst, baseline, plain, deployed, time, bound_mean, bound_worst;
  std::size_t blocks_seen = 0;
  constexpr int kJudged = 200;  // the genetic algorithm takes seven times as long as the rest
  int judged = 0, refused = 0, incomplete = 0, failed = 0, cross = 0;
  for (int i = 0; i < units; ++i) {
    std::mt19937_64 random(seed + static_cast<unsigned>(i));
    Unit unit = make_unit(random);
    unit.rate_hz = rate_hz;
    if (drift_mg > 0) {
      unit.cross = {0.004, -0.002, 0.002};
      unit.drift_mg = {drift_mg / 2, -drift_mg / 2, drift_mg / 2};
      unit.sway_mg = 2;
    }
    const auto blocks = wear(unit, random);
    blocks_seen += blocks.size();
    const auto start = Clock::now();
    const auto fit = fit_blocks(blocks, stored_of(unit));
    time.add(1000 * seconds_since(start));
    if (!fit || !fit->fit.converged) {
      ++failed;
      continue;
    }
    if (fit->richer) {
      ++cross;
      plain.add(sphere_error(unit, fit->fit.calibration).mean_mg);
    }
    const SphereError error = sphere_error(unit, fit->best().calibration);
    mean.add(error.mean_mg);
    worst.add(error.worst_mg);
    if (drift_mg == 0) {
      // White noise alone: the bound is known, and what one draw at it would have been off.
      const double sigma_g = unit.noise_mg / 1000 / std::sqrt(4 * unit.rate_hz);
      const SphereError bound = sphere_error(
          unit, drawn_at_bound(unit, cramer_rao(directions_of(unit, blocks), sigma_g), random));
      bound_mean.add(bound.mean_mg);
      bound_worst.add(bound.worst_mg);
    }
    if (i < kJudged) {
      const auto report = solve_from_still_blocks(blocks, stored_of(unit));
      ++judged;
      refused += report && report->usable() ? 0 : 1;
      if (report && report->calibration) {
        deployed.add(sphere_error(unit, *report->calibration).mean_mg);
      }
      // The paper's rule reads the file's own constants, and these are wrong by up to 0.2 g.
      incomplete += report && report->verification.verdict == Verdict::incomplete ? 1 : 0;
    }
    if (i < 50) {
      baseline.add(sphere_error(unit, closest_point(unit, blocks)).mean_mg);
    }
  }
  std::printf(
      "%-34s mean %.4f mg (wanted %.3f), worst direction %.4f mg on average, %.4f at most%s; "
      "cross-axis admitted %d (six parameters alone: %.4f mg); the six of the answer: %.4f mg; "
      "failed %d; refused %d of %d (%d by "
      "the 0.3 g rule); "
      "closest-point baseline "
      "%.4f mg, ratio "
      "%.1f; LS %.1f ms "
      "(%zu blocks), at most %.1f ms\n",
      name, mean.mean(), wanted_mean, worst.mean(), worst.worst,
      wanted_worst > 0 ? (" (wanted " + std::to_string(wanted_worst) + ")").c_str() : "", cross,
      plain.mean(), deployed.mean(), failed, refused, judged, incomplete, baseline.mean(),
      baseline.mean() / mean.mean(), time.mean(), blocks_seen / static_cast<std::size_t>(units),
      time.worst);
  if (bound_mean.count > 0) {
    std::printf(
        "%-34s at the Cramer-Rao bound of the same data: mean %.4f mg (ratio %.2f), worst "
        "direction "
        "%.4f mg on average (ratio %.2f), %.4f at most (ratio %.2f)\n",
        "", bound_mean.mean(), mean.mean() / bound_mean.mean(), bound_worst.mean(),
        worst.mean() / bound_worst.mean(), bound_worst.worst, worst.worst / bound_worst.worst);
  }
  std::fflush(stdout);
}

void efficiency(int units, unsigned seed) {
  std::array<double, 6> square{};
  int inside = 0;
  int all = 0;
  for (int i = 0; i < units; ++i) {
    std::mt19937_64 random(seed + static_cast<unsigned>(i));
    const Unit unit = make_unit(random);
    std::vector<StillBlock> blocks;
    std::vector<Vector> directions;
    for (int k = 0; k < 80; ++k) {
      const Vector up = any_direction(random);
      for (int j = 0; j < 1 + k % 7; ++j) {
        directions.push_back(near(up, 0.003, random));
        blocks.push_back(block_at(unit, directions.back(), 4.0 * (10 * k + j), random));
      }
    }
    const auto fit = fit_blocks(blocks, stored_of(unit));
    if (!fit) {
      std::printf("efficiency: seed %u failed\n", seed + static_cast<unsigned>(i));
      continue;
    }
    const auto bound = cramer_rao(directions, unit.noise_mg / 1000 / std::sqrt(4 * unit.rate_hz));
    const auto stated = fit->fit.standard_uncertainty();
    for (std::size_t a = 0; a < 3; ++a) {
      const double gain_off =
          fit->fit.calibration.sensitivity_g_per_lsb[a] * unit.counts_per_g[a] - 1;
      const double zero_off_g =
          (fit->fit.calibration.zero_lsb[a] - unit.zero[a]) / unit.counts_per_g[a];
      square[a] += gain_off * gain_off / bound[a][a] / units;
      square[3 + a] += zero_off_g * zero_off_g / bound[3 + a][3 + a] / units;
      inside += std::abs(gain_off) < 1.96 * stated.sensitivity_relative[a] ? 1 : 0;
      inside += std::abs(1000 * zero_off_g) < 1.96 * stated.zero_mg[a] ? 1 : 0;
      all += 2;
    }
  }
  std::printf(
      "LS efficiency: RMS error over the Cramer-Rao bound, sensitivity %.3f %.3f %.3f, zero "
      "%.3f %.3f %.3f (wanted <= 1.05; its own standard error is %.3f)\n",
      std::sqrt(square[0]), std::sqrt(square[1]), std::sqrt(square[2]), std::sqrt(square[3]),
      std::sqrt(square[4]), std::sqrt(square[5]), 1 / std::sqrt(2.0 * units));
  std::printf(
      "LS honesty: %.2f %% of the stated 95 %% intervals hold the truth (wanted 93 to 97)\n",
      100.0 * inside / all);
  std::fflush(stdout);
}

// Anything between six good sides and a hopeless file.
struct Mixed {
  Unit unit;
  double bad = 0;
  std::vector<StillBlock> blocks;
};
Mixed mixed_unit(unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  Mixed mixed;
  mixed.unit = make_unit(random);
  Unit& unit = mixed.unit;
  mixed.bad = uniform(random);
  const double bad = mixed.bad;
  if (bad < 0.3) {
    unit.sway_mg = 20 * uniform(random);
  }
  if (uniform(random) < 0.5) {
    unit.cross = {0.01 * uniform(random), -0.01 * uniform(random), 0.01 * uniform(random)};
  }
  unit.drift_mg = {3 * uniform(random), 3 * uniform(random), 3 * uniform(random)};
  const int poses = 1 + static_cast<int>(uniform(random) * 40);
  const double reach = 0.2 + 0.8 * uniform(random);
  for (int k = 0; k < poses + 6; ++k) {
    Vector up{};
    if (k < 6) {
      if (bad >= 0.8 && k == 0) {
        continue;
      }
      up[static_cast<std::size_t>(k / 2)] = k % 2 == 0 ? 1 : -1;
      up = near(up, 0.1 * uniform(random), random);
      if (bad > 0.6) {
        up = any_direction(random);
      }
    } else {
      up = any_direction(random);
      if (bad < 0.5) {
        for (std::size_t a = 0; a < 3; ++a) {
          up[a] = std::clamp(up[a], -reach, reach);
        }
        up = normalised(up);
      }
    }
    const int repeat = 1 + static_cast<int>(20 * uniform(random));
    for (int j = 0; j < repeat; ++j) {
      mixed.blocks.push_back(block_at(unit, up, 600.0 * k + 4 * j, random));
    }
  }
  return mixed;
}

// How often is a wrong answer called verified?
void confidence(int units, unsigned seed, SolveMethod method) {
  int verified = 0, wrong = 0, silent = 0, refused_bad = 0, refused_good = 0;
  double square = 0;
  int compared = 0;
  double largest = 0;
  for (int i = 0; i < units; ++i) {
    const auto [unit, bad, blocks] = mixed_unit(seed + static_cast<unsigned>(i));
    SolveOptions options;
    options.method = method;
    const auto report = solve_from_still_blocks(blocks, stored_of(unit), options);
    if (!report || !report->usable()) {
      if (!report || !report->calibration) {
        ++silent;
      } else {
        ++(sphere_error(unit, *report->calibration).worst_mg > 5 ? refused_bad : refused_good);
      }
      continue;
    }
    ++verified;
    const double off = sphere_error(unit, *report->calibration).worst_mg;
    largest = std::max(largest, off);
    // Wrong and confident: off by more than 10 mg, and by more than four times what it says of
    // itself.
    double stated = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      stated = std::max(stated, report->statistical.zero_mg[a]);
      stated = std::max(stated, 1000 * report->statistical.sensitivity_relative[a]);
    }
    if (off > 10 && off > 4 * stated) {
      ++wrong;
      std::printf("  wrong and confident: seed %u, %.1f mg, stated %.1f mg\n",
                  seed + static_cast<unsigned>(i), off, stated);
    }
    if (report->search && report->fit) {
      square += std::pow(
          difference_over_sphere(report->fit->fit.calibration, report->search->calibration).rms_mg,
          2);
      ++compared;
    }
  }
  std::printf(
      "%s over %d mixed units (seeds from %u): %d verified, %d wrong and confident (wanted "
      "0), largest error of a verified one %.1f mg; refused %.1f %%: %d without constants, %d with "
      "constants more than 5 mg off, %d with better ones; GA against LS %.2f mg RMS\n",
      std::string(to_string(method)).c_str(), units, seed, verified, wrong, largest,
      100.0 - 100.0 * verified / units, silent, refused_bad, refused_good,
      std::sqrt(square / std::max(1, compared)));
  std::fflush(stdout);
}

// How people record a calibration file: so long on each side, so long in the hand between two
// sides, the sides gone round so many times.
struct Habit {
  double rest_s = 60;
  double handling_s = 10;
  int rounds = 1;
  double tilt_rad = 0.03;  // each way
};

// Warmth in C, by time and by the length of the file.
using Warmth = double (*)(double time_s, double length_s);
double constant_c(double, double) { return 0; }
double rising_c(double time_s, double length_s) { return 20 * time_s / length_s - 10; }
double falling_c(double time_s, double length_s) { return 10 - 20 * time_s / length_s; }
double warm_up_c(double time_s, double length_s) {
  return 10 - 20 * std::exp(-time_s / (0.4 * length_s));
}
double quick_warm_up_c(double time_s, double length_s) {
  return 10 - 20 * std::exp(-time_s / (0.2 * length_s));
}
// A unit's own time, whatever the file's.
double ten_minutes_c(double time_s, double) { return 10 - 20 * std::exp(-time_s / 600); }

struct HabitFile {
  Unit unit;
  Vector drift_mg_per_c{};
  double mean_c = 0;
  std::vector<StillBlock> blocks;
};

HabitFile habit_file(const Habit& habit, Warmth warmth, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  HabitFile file;
  file.unit = make_unit(random);
  for (double& drift : file.drift_mg_per_c) {
    drift = (uniform(random) < 0.5 ? -1 : 1) * (0.5 + 0.2 * uniform(random));
  }
  std::array<std::size_t, 6> order = {0, 1, 2, 3, 4, 5};
  std::shuffle(order.begin(), order.end(), random);
  const double length_s = 6 * habit.rounds * (habit.rest_s + habit.handling_s);
  double start_s = 0;
  for (int side = 0; side < 6 * habit.rounds; ++side) {
    Vector up{};
    const std::size_t k = order[static_cast<std::size_t>(side % 6)];
    up[k / 2] = k % 2 == 0 ? 1 : -1;
    up = near(up, habit.tilt_rad, random);
    start_s += habit.handling_s * (0.5 + uniform(random));
    const double rest_s = habit.rest_s * (0.8 + 0.4 * uniform(random));
    for (double time_s = 0; time_s + 4 <= rest_s; time_s += 4) {
      const double celsius = warmth(start_s + time_s + 2, length_s);
      Vector zero_mg{};
      for (std::size_t a = 0; a < 3; ++a) {
        zero_mg[a] = file.drift_mg_per_c[a] * celsius;
      }
      file.mean_c += celsius;
      file.blocks.push_back(block_at(file.unit, up, start_s + time_s, random, zero_mg));
    }
    start_s += rest_s;
  }
  file.mean_c /= static_cast<double>(file.blocks.size());
  return file;
}

// The worst of the six constants, in mg at 1 g, against the unit as it is at the mean temperature
// of its still blocks.
double worst_constant_mg(const HabitFile& file, const Calibration& found) {
  double worst = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double counts_per_g = file.unit.counts_per_g[a];
    const double zero_mg = 1000 * (found.zero_lsb[a] - file.unit.zero[a]) / counts_per_g -
                           file.drift_mg_per_c[a] * file.mean_c;
    worst = std::max({worst, std::abs(zero_mg),
                      1000 * std::abs(found.sensitivity_g_per_lsb[a] * counts_per_g - 1)});
  }
  return worst;
}

// Refusals of good files, and wrong answers called verified where the temperature climbs by 20 C,
// with no temperature in the file.
void habits(int units, unsigned seed) {
  struct Shape {
    const char* name;
    Warmth warmth;
  };
  const Shape kShapes[] = {{"constant", constant_c},   {"rising", rising_c},
                           {"falling", falling_c},     {"warm-up", warm_up_c},
                           {"quick", quick_warm_up_c}, {"600 s", ten_minutes_c}};
  const Habit kHabits[] = {{60, 10},        {60, 30},     {60, 60},          {60, 90},
                           {60, 120},       {60, 240},    {60, 540},         {40, 5},
                           {30, 10},        {120, 30},    {120, 60},         {180, 120},
                           {300, 15},       {300, 600},   {20, 580},         {60, 10, 2},
                           {60, 240, 2},    {60, 540, 2}, {60, 20, 1, 0.02}, {60, 20, 1, 0.05},
                           {60, 20, 1, 0.1}};
  std::printf(
      "calibration files, %d units each: refused of the good ones; then, with 20 C of change in "
      "the "
      "file, wrong by more than 5 mg and verified / verified at all (largest error of these)\n",
      units);
  for (const Habit& habit : kHabits) {
    std::printf("rest %3.0f s, handling %3.0f s, rounds %d, tilt %.2f:", habit.rest_s,
                habit.handling_s, habit.rounds, habit.tilt_rad);
    for (const Shape& shape : kShapes) {
      int verified = 0;
      int wrong = 0;
      double largest = 0;
      double stated = 0;
      double hidden = 0;
      for (int i = 0; i < units; ++i) {
        const auto file = habit_file(habit, shape.warmth, seed + static_cast<unsigned>(i));
        const auto report = solve_from_still_blocks(file.blocks, stored_of(file.unit));
        if (report) {
          hidden += report->verification.hidden_drift_mg.value_or(0) / units;
        }
        if (!report || !report->usable()) {
          continue;
        }
        ++verified;
        const double off = worst_constant_mg(file, *report->calibration);
        largest = std::max(largest, off);
        wrong += off > 5 ? 1 : 0;
        stated += report->verification.worst_direction_mg;
      }
      if (shape.warmth == constant_c) {
        std::printf(
            " refused %.1f %% of good files (largest error %.1f mg, stated %.1f, hidden %.1f);",
            100.0 - 100.0 * verified / units, largest, stated / std::max(1, verified), hidden);
      } else {
        std::printf(" %s %.1f/%.1f (%.1f mg)", shape.name, 100.0 * wrong / units,
                    100.0 * verified / units, largest);
      }
    }
    std::printf("\n");
    std::fflush(stdout);
  }
}

void genetic_speed(int units, unsigned seed) {
  Statistics time;
  double square = 0;
  int unsettled = 0;
  for (int i = 0; i < units; ++i) {
    std::mt19937_64 random(seed + static_cast<unsigned>(i));
    const Unit unit = make_unit(random);
    const auto blocks = week_on_wrist(unit, random);
    const auto start = Clock::now();
    GeneticOptions options;
    options.seed = seed + static_cast<unsigned>(i);
    const auto found = genetic(blocks, stored_of(unit), options);
    time.add(seconds_since(start));
    const auto fit = fit_blocks(blocks, stored_of(unit));
    if (!found || !fit) {
      continue;
    }
    unsettled += found->settled ? 0 : 1;
    square += std::pow(difference_over_sphere(fit->fit.calibration, found->calibration).rms_mg, 2);
  }
  std::printf(
      "GA on a week of still blocks: %.0f ms, at most %.0f ms (wanted 1000); against LS %.3f "
      "mg RMS (wanted 1); not settled %d of %d\n",
      1000 * time.mean(), 1000 * time.worst, std::sqrt(square / units), unsettled, units);
  std::fflush(stdout);
}

void finder_speed() {
  const StoredConstants stored{{311, 310, 287}, {-204, -216, -234}, {54, 47, 26}};
  const auto reversal = Reversal::make(stored, 256, RecordWidth::bits12);
  for (const double rate : {30.0, 100.0}) {
    for (const int kind : {0, 1, 2}) {
      std::mt19937_64 random(1);
      std::normal_distribution<double> normal;
      std::vector<StoredCounts> samples;
      constexpr std::size_t kSamples = 4'000'000;
      double phase = 0;
      for (std::size_t i = 0; i < kSamples; ++i) {
        const bool moving = kind == 1 || (kind == 2 && (i / 30'000) % 2 == 0);
        phase += moving ? 0.02 : 0;
        samples.push_back({static_cast<std::int16_t>(80 * std::sin(phase) + normal(random)),
                           static_cast<std::int16_t>(60 * std::cos(1.3 * phase) + normal(random)),
                           static_cast<std::int16_t>(-220 + normal(random))});
      }
      auto finder = StillBlockFinder::make(*reversal, rate);
      const auto start = Clock::now();
      const auto second = static_cast<std::size_t>(rate);
      for (std::size_t i = 0; i + second <= kSamples; i += second) {
        finder->push(static_cast<double>(i) / rate, std::span(samples).subspan(i, second));
      }
      const double seconds = seconds_since(start);
      std::printf(
          "still periods, %.0f Hz, %s: %.0f million samples per minute (wanted 200), %zu "
          "blocks\n",
          rate,
          kind == 0   ? "all at rest"
          : kind == 1 ? "all moving"
                      : "mixed",
          static_cast<double>(kSamples) / seconds * 60 / 1e6, finder->blocks().size());
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int units = argc > 1 ? std::max(1, std::atoi(argv[1])) : 1000;
  const auto seed = static_cast<unsigned>(argc > 2 ? std::max(0, std::atoi(argv[2])) : 1);
  const std::string only = argc > 3 ? argv[3] : "";
  if (only == "habits") {
    habits(units, seed);
    return 0;
  }
  if (only == "confidence") {
    confidence(units, seed, SolveMethod::least_squares);
    confidence(units, seed, SolveMethod::genetic);
    return 0;
  }
  std::printf("%d units, seeds %u to %u\n", units, seed, seed + static_cast<unsigned>(units) - 1);
  finder_speed();
  efficiency(units, seed);
  accuracy("wrist, 30 Hz, white noise", units, seed, 30, 0, 0.01, 0, week_on_wrist);
  accuracy("wrist, 100 Hz, white noise", units, seed, 100, 0, 0.01, 0, week_on_wrist);
  accuracy("hip, +x to 0.34 g, white noise", units, seed, 30, 0, 0.02, 0.06, week_on_hip);
  // Drift from the coldest to the warmest hour of the day; the second line is twice as much.
  accuracy("wrist, 3 mg drift, 0.4 %, 2 mg", units, seed, 30, 3, 0.45, 0, week_on_wrist);
  accuracy("wrist, 6 mg drift, 0.4 %, 2 mg", units / 4 + 1, seed, 30, 6, 0.9, 0, week_on_wrist);
  genetic_speed(std::min(units, 50), seed);
  confidence(units, seed, SolveMethod::least_squares);
  confidence(units, seed, SolveMethod::genetic);
  habits(std::min(units, 300), seed);
  return 0;
}

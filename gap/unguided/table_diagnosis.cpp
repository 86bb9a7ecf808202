// The diagnosis of a table of readings (readings_table.h).
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/unguided/findings.h"
#include "gap/unguided/length_fit.h"
#include "gap/unguided/readings_table.h"

namespace sixpoint::gap {
namespace {

constexpr double kLost_mg = 12;  // lengths this far off after all fit no linear sensor
constexpr std::size_t kFewestDirections = 16;
constexpr double kDatasheet = 0.015;  // cross-axis terms: ADXL362, 1 % typical
constexpr const char* kEffect = "non_orthogonality";

struct Placement {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::size_t direction = 0;  // those of one direction are held out together
};

// Four placements of a direction at most, spread over the time: a night on a table must not
// outweigh all others. They are not averaged, since a mean of two directions is shorter than both.
std::vector<Placement> placements_of(const std::vector<RestingReading>& rests) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300);
  Eigen::Vector3d high = -low;
  for (const RestingReading& rest : rests) {
    low = low.cwiseMin(rest.mean);
    high = high.cwiseMax(rest.mean);
  }
  const Eigen::Vector3d middle = 0.5 * (low + high);
  const Eigen::Vector3d half = 0.5 * (high - low).cwiseMax(1e-300);
  std::map<std::array<long, 3>, std::vector<Eigen::Vector3d>> bins;
  for (const RestingReading& rest : rests) {
    const Eigen::Vector3d u = 8 * (rest.mean - middle).cwiseQuotient(half);
    bins[{std::lround(u[0]), std::lround(u[1]), std::lround(u[2])}].push_back(rest.mean);
  }
  constexpr std::size_t kMost = 4;
  std::vector<Placement> placements;
  std::size_t direction = 0;
  for (const auto& [key, means] : bins) {
    const std::size_t taken = std::min(kMost, means.size());
    for (std::size_t i = 0; i < taken; ++i) {
      placements.push_back({means[i * means.size() / taken], direction});
    }
    ++direction;
  }
  return placements;
}

std::vector<Eigen::Vector3d> means_of(const std::vector<Placement>& placements) {
  std::vector<Eigen::Vector3d> means;
  means.reserve(placements.size());
  for (const Placement& placement : placements) {
    means.push_back(placement.mean);
  }
  return means;
}

double length_error(const LengthFit& fit, const Eigen::Vector3d& raw) {
  return (fit.sensitivity * (raw - fit.zero)).norm() - 1;
}

struct HeldOut {
  std::vector<double> square, cross;  // errors of length with three and six terms
  double gain_nats = 0;
};

// Each direction is judged by constants that were fitted without it.
std::optional<HeldOut> hold_out(const std::vector<Placement>& placements) {
  constexpr std::size_t kFolds = 8;
  HeldOut out;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    std::vector<Eigen::Vector3d> others;
    for (const Placement& placement : placements) {
      if (placement.direction % kFolds != fold) {
        others.push_back(placement.mean);
      }
    }
    const auto square = fit_lengths(others, 1, CrossAxis::none);
    const auto cross = fit_lengths(others, 1, CrossAxis::symmetric);
    if (!square || !cross || !(square->residual > 0) || !(cross->residual > 0)) {
      return std::nullopt;
    }
    const auto n = static_cast<double>(others.size());
    const double square_sd = square->residual * std::sqrt(n / (n - 6));
    const double cross_sd = cross->residual * std::sqrt(n / (n - 9));
    for (const Placement& placement : placements) {
      if (placement.direction % kFolds != fold) {
        continue;
      }
      out.square.push_back(length_error(*square, placement.mean));
      out.cross.push_back(length_error(*cross, placement.mean));
      const auto nats = [](double error, double sd) {
        return -0.5 * std::pow(error / sd, 2) - std::log(sd);
      };
      out.gain_nats += nats(out.cross.back(), cross_sd) - nats(out.square.back(), square_sd);
    }
  }
  return out;
}

double root_mean_square_mg(const std::vector<double>& errors_g) {
  double sum = 0;
  for (const double e : errors_g) {
    sum += e * e;
  }
  return 1000 * std::sqrt(sum / static_cast<double>(errors_g.size()));
}

// Removes the placements that were not at rest after all: off by more than five times the scatter
// of the others. Returns how many.
std::size_t leave_out_strays(std::vector<Placement>& placements, const LengthFit& fit) {
  std::vector<double> sizes;
  sizes.reserve(placements.size());
  for (const Placement& placement : placements) {
    sizes.push_back(std::abs(length_error(fit, placement.mean)));
  }
  auto sorted = sizes;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  constexpr double kSdPerMedian = 1.4826;  // of the size of a normal variable
  const double most = 5 * kSdPerMedian * *middle;
  std::size_t used = 0;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (sizes[i] <= most) {
      placements[used++] = placements[i];
    }
  }
  const std::size_t left_out = placements.size() - used;
  placements.resize(used);
  return left_out;
}

// All that the judgement rests on.
struct Fits {
  LengthFit square, cross;  // without and with cross-axis terms
  HeldOut held_out;
  std::vector<Eigen::Vector3d> means;

  // Schwarz: three more constants for that much less scatter.
  double nats() const {
    const auto n = static_cast<double>(means.size());
    return n * std::log(square.residual / cross.residual) - 1.5 * std::log(n) + kLogPriorEffect;
  }
  bool accepted() const { return nats() > kAccept_nats && held_out.gain_nats > 0; }
};

// Nothing where the placements do not determine nine constants. Notes what it left out.
std::optional<Fits> fit_placements(std::vector<Placement> placements, Diagnosis& out) {
  std::vector<Eigen::Vector3d> means = means_of(placements);
  auto cross = fit_lengths(means, 1, CrossAxis::symmetric);
  if (cross) {
    if (const std::size_t strays = leave_out_strays(placements, *cross); strays > 0) {
      out.losses.push_back(fmt::format(
          "{} of {} placements do not fit the others and were left out", strays, means.size()));
      means = means_of(placements);
      cross = fit_lengths(means, 1, CrossAxis::symmetric);
    }
  }
  const auto square = fit_lengths(means, 1, CrossAxis::none);
  const std::size_t directions =
      placements.empty() ? 0 : placements.back().direction + 1 - placements.front().direction;
  const auto held_out = directions >= kFewestDirections ? hold_out(placements) : std::nullopt;
  if (!cross || !square || !held_out) {
    out.inconclusive = true;
    out.unknown.why = {
        fmt::format("{} directions at rest, which do not settle nine constants; rest the sensor "
                    "in sixteen and more, all round",
                    directions)};
    return std::nullopt;
  }
  return Fits{*square, *cross, *held_out, std::move(means)};
}

EffectFinding finding_of(const Fits& fits) {
  EffectFinding out;
  out.name = kEffect;
  out.nats = fits.nats();
  out.probability = probability_of(out.nats);
  out.held_out_gain_nats = fits.held_out.gain_nats;
  // The effect acts on the way to the reading, the fit on the way back.
  NamedValue terms{"yz_xz_xy", {}, {}};
  for (Eigen::Index a = 0; a < 3; ++a) {
    terms.value.push_back(-fits.cross.cross[a]);
    terms.sd.push_back(fits.cross.cross_sd[a]);
  }
  out.outside_datasheet = fits.cross.cross.cwiseAbs().maxCoeff() > kDatasheet;
  out.parameters.push_back(std::move(terms));
  return out;
}

// Noise of a mean of a rest, in g, on average over the rests.
double noise_g(const std::vector<RestingReading>& rests, const LengthFit& fit) {
  double sum = 0;
  for (const RestingReading& rest : rests) {
    sum += (fit.sensitivity.diagonal().cwiseProduct(rest.sd)).norm() / std::sqrt(3.0) /
           std::sqrt(rest.readings) / static_cast<double>(rests.size());
  }
  return sum;
}

GapSize gap_of(const Fits& fits, bool explained, double floor_mg) {
  GapSize gap;
  gap.before_mg = root_mean_square_mg(fits.held_out.square);
  gap.after_mg = explained ? root_mean_square_mg(fits.held_out.cross) : gap.before_mg;
  gap.floor_mg = floor_mg;
  const double spread = std::sqrt(2.0 / static_cast<double>(fits.means.size()));
  gap.after_interval_mg = {gap.after_mg * (1 - spread), gap.after_mg * (1 + spread)};
  set_sigmas(gap);
  gap.by_feature[0] = {gap.before_sigma, gap.after_sigma};
  gap.closed_fraction = explained ? closed_fraction(gap) : 0;
  return gap;
}

// What the square axes leave, by axis.
std::vector<Location> locations_of(const Fits& fits, double floor_mg) {
  std::vector<Location> where;
  for (int axis = 0; axis < 3; ++axis) {
    double sum = 0;
    double weight = 0;
    for (const auto& m : fits.means) {
      const Eigen::Vector3d u = (fits.square.sensitivity * (m - fits.square.zero)).normalized();
      sum += u[axis] * u[axis] * std::pow(length_error(fits.square, m), 2);
      weight += u[axis] * u[axis];
    }
    const double residual_mg = 1000 * std::sqrt(sum / std::max(weight, 1e-9));
    where.push_back({axis, "rest", "pose", residual_mg, residual_mg / floor_mg});
  }
  std::stable_sort(where.begin(), where.end(),
                   [](const Location& a, const Location& b) { return a.sigma > b.sigma; });
  return where;
}

void judge(const Fits& fits, const std::vector<RestingReading>& rests,
           const DiagnoseOptions& options, Diagnosis& out) {
  const bool allowed = is_allowed(options, kEffect);
  const bool explained = allowed && fits.accepted();
  if (allowed) {
    out.candidates.push_back(finding_of(fits));
    out.candidates.back().gap_mg2 =
        std::max(0.0, std::pow(root_mean_square_mg(fits.held_out.square), 2) -
                          std::pow(root_mean_square_mg(fits.held_out.cross), 2));
  }
  if (explained) {
    out.effects = out.candidates;
  } else if (fits.accepted()) {
    out.unknown.why.emplace_back("mean: lengths at rest depend on pairs of axes");
  }
  const double floor_mg = 1000 * noise_g(rests, fits.cross);
  out.gap = gap_of(fits, explained, floor_mg);
  if (out.gap.after_mg > kLost_mg) {
    out.unknown.why.emplace_back("mean: lengths at rest fit no linear sensor");
  }
  out.unknown.present = !out.unknown.why.empty();
  out.where = locations_of(fits, floor_mg);
}

}  // namespace

Result<Diagnosis> diagnose_table(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options,
                                 const ReadingsTableOptions& table_options) {
  SIXPOINT_ASSIGN(const ReadingsTable table, read_readings_table(files, path, table_options));
  Diagnosis out;
  out.bundle = path;
  out.protocol = kNoProtocol;
  out.seed = options.seed;
  out.losses.emplace_back(
      "a table of readings: gain and zero are the sensor's own, only lengths at rest are judged");
  if (const auto fits = fit_placements(placements_of(table.rests), out)) {
    judge(*fits, table.rests, options, out);
  }
  finish(out, options);
  return out;
}

}  // namespace sixpoint::gap

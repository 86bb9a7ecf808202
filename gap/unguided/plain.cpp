#include "gap/unguided/plain.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "base/measure.h"
#include "gap/unguided/findings.h"
#include "gap/unguided/rests.h"
#include "sim/firmware.h"

namespace sixpoint::gap {
namespace {

using Means = std::vector<Eigen::Vector3d>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// What units are like whose constants belong to the mode in force (domain figures), beside kGainSd.
constexpr double kOffsetSd_g = kOffsetSd_mg / kMgPerG;
constexpr double kLength_sd = 0.006;  // temperature, curvature, gravity at an unknown place
// And under the other mode (16CPAN03): a common gain, and offsets of 0.1 to 0.2 g of either sign.
constexpr double kLowestGain = 0.79;
constexpr double kGainRange = 0.18;
constexpr double kMismatchOffsetSd_g = 0.14;
constexpr double kGainStated_sd = 0.03;  // of the answer, per parameter
// Taken off the evidence where it stands for a held-out gain: a convention.
constexpr double kNotHeldOut_nats = 3;
// The header can make the mismatch as likely as not, never certain or impossible: a convention.
constexpr double kHeaderFits_nats = -2;
constexpr double kHeaderContradicts_nats = 3.5;
constexpr double kFloor_mg = 6;  // of a length: kLength_sd
// Evidence that something is there although the effect was taken out of the catalogue.
constexpr double kSurely_nats = 8;
// One unit in a thousand.
constexpr double kFar_sigma = 3.3;
constexpr double kNeitherMode_mg = 40;

// The mean of each direction that was met in two blocks or more. Directions are bins of a quarter.
Means directions_of(const std::vector<Rest>& rests) {
  struct Sum {
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    double n = 0;
  };
  std::map<std::array<long, 3>, Sum> bins;
  for (const Rest& rest : rests) {
    if (rest.quiet) {
      const Eigen::Vector3d u = rest.mean_g.normalized();
      Sum& bin = bins[{std::lround(4 * u[0]), std::lround(4 * u[1]), std::lround(4 * u[2])}];
      bin.g += rest.mean_g;
      bin.n += 1;
    }
  }
  Means means;
  for (const auto& [key, bin] : bins) {
    if (bin.n >= 2) {
      means.push_back(bin.g / bin.n);
    }
  }
  return means;
}

// Gains and offsets about a common gain: length - common = sum u_a^2 gain_a + u_a offset_a.
struct LengthModel {
  double common = 1;
  Vector6 estimate = Vector6::Zero();  // gain X Y Z, offset X Y Z in g
  double nats = 0;                     // log evidence of the lengths

  double residual_g(const Eigen::Vector3d& mean) const {
    const Eigen::Vector3d u = mean.normalized();
    return mean.norm() - common - u.cwiseAbs2().dot(estimate.head<3>()) - u.dot(estimate.tail<3>());
  }
};

// Both Gaussian, so the evidence is one of a multivariate normal.
LengthModel fit_model(const Means& means, double common, double gain_sd, double offset_sd_g) {
  const auto n = static_cast<Eigen::Index>(means.size());
  Eigen::MatrixXd x(n, 6);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d& m = means[static_cast<std::size_t>(i)];
    const Eigen::Vector3d u = m.normalized();
    x.row(i) << u[0] * u[0], u[1] * u[1], u[2] * u[2], u[0], u[1], u[2];
    y[i] = m.norm() - common;
  }
  Vector6 prior;
  prior << gain_sd, gain_sd, gain_sd, offset_sd_g, offset_sd_g, offset_sd_g;
  const Eigen::MatrixXd xs = x * prior.asDiagonal();
  const Eigen::MatrixXd v =
      xs * xs.transpose() + kLength_sd * kLength_sd * Eigen::MatrixXd::Identity(n, n);
  const Eigen::LLT<Eigen::MatrixXd> llt(v);
  const Eigen::VectorXd z = llt.solve(y);
  LengthModel model;
  model.common = common;
  model.estimate = prior.asDiagonal() * (xs.transpose() * z);
  model.nats = -0.5 * y.dot(z) - llt.matrixLLT().diagonal().array().log().sum();
  return model;
}

// The other mode at the best of a grid of common gains; its evidence is the grid's mean.
LengthModel fit_mismatch(const Means& means) {
  constexpr int kSteps = 32;
  constexpr double kNone = -1e300;
  LengthModel best;
  best.nats = kNone;
  double sum = kNone;
  for (int k = 0; k < kSteps; ++k) {
    const double common = kLowestGain + kGainRange * (k + 0.5) / kSteps;
    const LengthModel model = fit_model(means, common, kGainSd * common, kMismatchOffsetSd_g);
    if (model.nats > best.nats) {
      best = model;
    }
    sum = sum == kNone
              ? model.nats
              : std::max(sum, model.nats) + std::log1p(std::exp(-std::abs(sum - model.nats)));
  }
  best.nats = sum - std::log(static_cast<double>(kSteps));
  return best;
}

// What the header says of the filter:
//
//   constants' date | its filter and the recording's | nats
//   known           | the same                       | kHeaderFits_nats
//   known           | different                      | kHeaderContradicts_nats
//   unknown         | not a MOS unit: only one       | kHeaderFits_nats
//   unknown         | MOS unit                       | 0
double header_nats(const RecordingRests& recording) {
  if (!recording.calibration_time) {
    return recording.serial.starts_with("MOS") ? 0 : kHeaderFits_nats;
  }
  const bool fits =
      sim::filter_of_constants(recording.serial, *recording.calibration_time) ==
      sim::filter_of_recording(recording.serial, recording.firmware, *recording.calibration_time);
  return fits ? kHeaderFits_nats : kHeaderContradicts_nats;
}

// Of lengths at rest, about 1 g.
double square_mg2(const Means& means, const LengthModel& model) {
  double square_g2 = 0;
  for (const Eigen::Vector3d& m : means) {
    square_g2 += std::pow(model.residual_g(m), 2);
  }
  return 1e6 * square_g2 / static_cast<double>(means.size());
}

void add(Diagnosis& out, EffectFinding finding) {
  finding.probability = probability_of(finding.nats);
  if (finding.nats > kAccept_nats) {
    out.effects.push_back(finding);
  }
  out.candidates.push_back(std::move(finding));
}

// A length farther from 1 g than units' own gains and offsets make it. A finding and no
// explanation, also where too few directions were met to give one.
void find_far_length(const Means& means, Diagnosis& out) {
  double farthest_sigma = 0;
  double length_g = 1;
  for (const Eigen::Vector3d& m : means) {
    const Eigen::Vector3d u = m.normalized();
    const double sd = std::sqrt(kGainSd * kGainSd * u.cwiseAbs2().squaredNorm() +
                                kOffsetSd_g * kOffsetSd_g + kLength_sd * kLength_sd);
    const double sigma = std::abs(m.norm() - 1) / sd;
    if (sigma > farthest_sigma) {
      farthest_sigma = sigma;
      length_g = m.norm();
    }
  }
  if (farthest_sigma > kFar_sigma) {
    out.unknown.why.push_back(
        fmt::format("mean: a length at rest of {:.3f} g is {:.1f} standard deviations from what "
                    "units read; more sides would say why",
                    length_g, farthest_sigma));
  }
}

// The gap before and after; gain and offset within their priors are the unit's own, no gap.
void set_gap(const Means& means, const LengthModel& model, bool mismatch, GapSize& gap) {
  gap.after_mg = std::sqrt(square_mg2(means, model));
  gap.before_mg = mismatch ? std::sqrt(square_mg2(means, LengthModel())) : gap.after_mg;
  gap.floor_mg = kFloor_mg;
  set_sigmas(gap);
  gap.by_feature[0] = {gap.before_sigma, gap.after_sigma};
  gap.after_interval_mg = {0.7 * gap.after_mg, 1.5 * gap.after_mg};
  gap.closed_fraction = mismatch && gap.before_mg > kFloor_mg ? closed_fraction(gap) : 0;
}

// Which acquisition mode the lengths at rest fit.
void judge_lengths(const Means& means, const RecordingRests& recording,
                   const DiagnoseOptions& options, Diagnosis& out) {
  const bool allowed = is_allowed(options, "filter_mismatch");
  const LengthModel nominal = fit_model(means, 1, kGainSd, kOffsetSd_g);
  const LengthModel other = fit_mismatch(means);
  const double header = header_nats(recording);
  if (header == kHeaderContradicts_nats) {
    out.losses.push_back(
        "the header says: constants of before 2014-03-24 under a firmware that does not set "
        "their filter configuration (16CPAN03)");
  }
  const double gain_nats = other.nats - nominal.nats;
  const double nats = gain_nats + kLogPriorEffect + header;
  if (allowed) {
    EffectFinding finding{"filter_mismatch", 0, nats, {}, gain_nats - kNotHeldOut_nats, false, {}};
    const Vector6& e = other.estimate;
    finding.gap_mg2 = std::max(0.0, square_mg2(means, LengthModel()) - square_mg2(means, other));
    finding.parameters.push_back({"gain", {other.common}, {kGainStated_sd}});
    finding.parameters.push_back(
        {"offset_g", {e[3], e[4], e[5]}, {kGainStated_sd, kGainStated_sd, kGainStated_sd}});
    add(out, std::move(finding));
  } else if (gain_nats > kSurely_nats) {
    out.unknown.why.push_back("mean: lengths at rest are far from 1 g");
  }
  const bool mismatch = allowed && nats > kAccept_nats;
  const LengthModel& model = mismatch ? other : nominal;
  set_gap(means, model, mismatch, out.gap);
  if (!mismatch && allowed) {
    find_far_length(means, out);
  }
  if (out.gap.after_mg > kNeitherMode_mg) {
    out.unknown.why.push_back("mean: lengths at rest fit neither acquisition mode");
  }
  out.unknown.present = !out.unknown.why.empty();
  for (int a = 0; a < 3; ++a) {
    out.where.push_back({a, "still periods", "pose", 1000 * std::abs(model.estimate[3 + a]), 0});
  }
}

// Zero against temperature, from poses that were held long enough for it to change. Only slopes
// within a pose count, so that the direction of the pose does not matter.
constexpr double kMoved_g = 0.012;  // temperature moves a mean by less in seconds
constexpr double kPause_s = 600;
constexpr std::size_t kFewestRests = 30;  // of a pose: two minutes
constexpr double kLeastRange_c = 5;
// Periods follow one another: their scatter about the line is not independent; a tenth counts.
constexpr double kIndependentShare = 0.1;
// The mean of a period: 5 mg of noise over four seconds at 30 Hz and more.
constexpr double kPeriodFloor_mg = 0.5;

// Of one pose about its own means: x is the temperature in C, y the reading in mg.
struct PoseSums {
  double n = 0;
  double xx = 0;
  Eigen::Vector3d xy = Eigen::Vector3d::Zero();
  Eigen::Vector3d yy = Eigen::Vector3d::Zero();
};

using Pose = std::vector<const Rest*>;

PoseSums sums_of(const Pose& pose) {
  PoseSums out;
  out.n = static_cast<double>(pose.size());
  double mean_c = 0;
  Eigen::Vector3d mean_g = Eigen::Vector3d::Zero();
  for (const Rest* rest : pose) {
    mean_c += *rest->temperature_c / out.n;
    mean_g += rest->mean_g / out.n;
  }
  for (const Rest* rest : pose) {
    const double x = *rest->temperature_c - mean_c;
    const Eigen::Vector3d y_mg = 1000 * (rest->mean_g - mean_g);
    out.xx += x * x;
    out.xy += x * y_mg;
    out.yy += y_mg.cwiseAbs2();
  }
  return out;
}

// The poses that hold enough periods with a temperature. A pose ends where the mean jumps.
std::vector<PoseSums> poses_of(const std::vector<Rest>& rests) {
  std::vector<Pose> poses;
  for (const Rest& rest : rests) {
    if (!rest.temperature_c) {
      continue;
    }
    const Rest* before = poses.empty() ? nullptr : poses.back().back();
    if (before == nullptr || (rest.mean_g - before->mean_g).norm() > kMoved_g ||
        rest.time_s - before->time_s > kPause_s) {
      poses.emplace_back();
    }
    poses.back().push_back(&rest);
  }
  std::vector<PoseSums> sums;
  for (const Pose& pose : poses) {
    if (pose.size() >= kFewestRests) {
      sums.push_back(sums_of(pose));
    }
  }
  return sums;
}

PoseSums total_of(const std::vector<PoseSums>& poses) {
  PoseSums total;
  for (const PoseSums& pose : poses) {
    total.n += pose.n;
    total.xx += pose.xx;
    total.xy += pose.xy;
    total.yy += pose.yy;
  }
  return total;
}

double temperature_range_c(const std::vector<Rest>& rests) {
  double coldest = 1e9;
  double hottest = -1e9;
  for (const Rest& rest : rests) {
    coldest = std::min(coldest, rest.temperature_c.value_or(coldest));
    hottest = std::max(hottest, rest.temperature_c.value_or(hottest));
  }
  return hottest - coldest;
}

struct ZeroTempco {
  Eigen::Vector3d mg_per_c;
  Eigen::Vector3d sd_mg_per_c;
  double gap_mg2 = 0;  // that it adds to the periods of a pose, per axis
};

// Nothing where the temperature changed by 5 C or less, or too few periods have one.
std::optional<ZeroTempco> zero_tempco(const std::vector<Rest>& rests) {
  if (!(temperature_range_c(rests) > kLeastRange_c)) {
    return std::nullopt;
  }
  const PoseSums total = total_of(poses_of(rests));
  if (!(total.xx > 0 && total.n > 60)) {
    return std::nullopt;
  }
  const Eigen::Vector3d slope = total.xy / total.xx;
  return ZeroTempco{slope,
                    ((total.yy - total.xx * slope.cwiseAbs2()).cwiseMax(0) /
                     (kIndependentShare * total.n * total.xx))
                        .cwiseSqrt(),
                    total.xx * slope.squaredNorm() / (3 * total.n)};
}

// How far the means of a pose move with temperature, and how far after the slopes of the other
// poses are taken off: a pose is judged by poses that it was not part of. Leaves `gap` as it is
// where there is a single pose.
void measure_tempco_gap(const std::vector<Rest>& rests, GapSize& gap) {
  const std::vector<PoseSums> poses = poses_of(rests);
  const PoseSums total = total_of(poses);
  double before = 0;
  double after = 0;
  double n = 0;
  for (const PoseSums& own : poses) {
    const double others_xx = total.xx - own.xx;
    if (!(others_xx > 0)) {
      continue;
    }
    const Eigen::Vector3d slope = (total.xy - own.xy) / others_xx;
    before += own.yy.sum();
    after += (own.yy - 2 * slope.cwiseProduct(own.xy) + own.xx * slope.cwiseAbs2()).sum();
    n += 3 * own.n;
  }
  if (n == 0 || poses.size() < 2 || !(before > 0)) {
    return;
  }
  gap.before_mg = std::sqrt(before / n);
  gap.after_mg = std::sqrt(std::max(after, 0.0) / n);
  gap.floor_mg = kPeriodFloor_mg;
  set_sigmas(gap);
  gap.after_interval_mg = {0.8 * gap.after_mg, 1.25 * gap.after_mg};
  gap.closed_fraction = closed_fraction(gap);
  gap.by_feature[0] = {gap.before_sigma, gap.after_sigma};
}

void judge_tempco(const std::vector<Rest>& rests, Diagnosis& out) {
  const auto tempco = zero_tempco(rests);
  if (!tempco) {
    return;
  }
  const Eigen::Vector3d& slope = tempco->mg_per_c;
  const Eigen::Vector3d& sd = tempco->sd_mg_per_c;
  double nats = kLogPriorEffect;
  for (Eigen::Index a = 0; a < 3; ++a) {
    nats += 0.5 * std::pow(slope[a] / std::max(1e-6, sd[a]), 2) -
            std::log1p(0.5 / std::max(1e-6, sd[a]));
  }
  constexpr double kDatasheet_mg_per_c = 1;
  EffectFinding finding{"offset_tempco",
                        0,
                        nats,
                        {},
                        nats - kLogPriorEffect - kNotHeldOut_nats,
                        slope.cwiseAbs().maxCoeff() > kDatasheet_mg_per_c,
                        {"sensitivity_tempco"}};
  finding.gap_mg2 = tempco->gap_mg2;
  finding.parameters.push_back({"mg_per_c", {slope[0], slope[1], slope[2]}, {sd[0], sd[1], sd[2]}});
  add(out, std::move(finding));
  if (nats > kAccept_nats && out.effects.size() == 1) {
    measure_tempco_gap(rests, out.gap);
  }
}

}  // namespace

Result<Diagnosis> diagnose_plain(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options) {
  SIXPOINT_ASSIGN(const RecordingRests recording, read_rests(files, path));
  Diagnosis out;
  out.bundle = path;
  out.protocol = kNoProtocol;
  out.serial = recording.serial;
  out.firmware = recording.firmware;
  out.seed = options.seed;
  out.losses.emplace_back(
      "no protocol: poses and motion are unknown, only lengths at rest and temperatures are "
      "judged");
  const Means means = directions_of(recording.rests);
  if (means.empty()) {
    out.inconclusive = true;
    out.unknown.why = {"the recording holds no still period of four seconds"};
  } else {
    judge_lengths(means, recording, options, out);
  }
  if (is_allowed(options, "offset_tempco")) {
    judge_tempco(recording.rests, out);
  }
  finish(out, options);
  const auto by_evidence = [](const EffectFinding& a, const EffectFinding& b) {
    return a.nats > b.nats;
  };
  std::stable_sort(out.candidates.begin(), out.candidates.end(), by_evidence);
  std::stable_sort(out.effects.begin(), out.effects.end(), by_evidence);
  return out;
}

}  // namespace sixpoint::gap

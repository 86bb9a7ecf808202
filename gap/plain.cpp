#include "gap/plain.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "gap/catalogue.h"
#include "gt3x/agdc.h"
#include "gt3x/parameters.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"
#include "sim/firmware.h"

namespace sixpoint::gap {
namespace {

constexpr double kBlock_s = 4;  // paper, Step 2
constexpr double kSlope_g_per_sample = 5e-4;
constexpr double kNoise_g = 0.009;  // of the noisiest axis, rounding included
constexpr double kHum_g = 0.04;     // the fan of a climate chamber
constexpr double kLogPrior = -3.5;
constexpr double kAccept = 2.2;
constexpr double kGainSd = 0.02;
constexpr double kOffsetSd_g = 0.035;
constexpr double kLength_sd = 0.006;  // temperature, curvature, gravity at an unknown place

struct Rest {
  double time_s = 0;
  Eigen::Vector3d mean_g = Eigen::Vector3d::Zero();
  std::optional<double> temperature_c;
  bool quiet = true;  // noise alone; else something hums (a climate chamber), and means still count
};

// Cuts a stream of samples into blocks and keeps those at rest.
class RestFinder {
 public:
  explicit RestFinder(double rate_hz)
      : length_(static_cast<std::size_t>(std::max(20.0, std::round(kBlock_s * rate_hz)))) {}

  void push(double time_s, const Eigen::Vector3d& g, std::optional<double> temperature_c) {
    if (run_.empty()) {
      start_s_ = time_s;
    }
    run_.push_back(g);
    temperature_c_ = temperature_c;
    if (run_.size() == length_) {
      judge();
      run_.clear();
    }
  }
  void break_run() { run_.clear(); }
  std::vector<Rest> take() { return std::move(found_); }
  std::size_t blocks() const { return blocks_; }

 private:
  void judge() {
    ++blocks_;
    const auto n = static_cast<double>(length_);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    bool zero = true;
    for (const auto& g : run_) {
      mean += g / n;
      zero = zero && g.isZero();
    }
    Eigen::Vector3d slope = Eigen::Vector3d::Zero();
    Eigen::Vector3d square = Eigen::Vector3d::Zero();
    double xx = 0;
    for (std::size_t i = 0; i < length_; ++i) {
      const double x = static_cast<double>(i) - (n - 1) / 2;
      slope += x * (run_[i] - mean);
      xx += x * x;
    }
    slope /= xx;
    for (std::size_t i = 0; i < length_; ++i) {
      const double x = static_cast<double>(i) - (n - 1) / 2;
      square += (run_[i] - mean - x * slope).cwiseAbs2() / n;
    }
    const bool held = square.isZero();  // one value repeated is no measurement
    if (!zero && !held && slope.cwiseAbs().maxCoeff() < kSlope_g_per_sample &&
        std::sqrt(square.maxCoeff()) < kHum_g && found_.size() < 200'000) {
      found_.push_back({start_s_, mean, temperature_c_, std::sqrt(square.maxCoeff()) < kNoise_g});
    }
  }

  std::size_t length_;
  std::size_t blocks_ = 0;
  double start_s_ = 0;
  std::vector<Eigen::Vector3d> run_;
  std::optional<double> temperature_c_;
  std::vector<Rest> found_;
};

struct Contents {
  std::string serial, firmware;
  std::optional<UtcTime> calibration_time;
  double rate_hz = 0;
  std::vector<Rest> rests;
  std::size_t blocks = 0;
  std::size_t samples = 0;
  bool zeros = false;
  bool has_temperature = false;
};

Result<std::string> entry_text(gt3x::Recording& recording, const std::string& name) {
  SIXPOINT_ASSIGN(auto source, recording.open_entry(name));
  std::string text;
  std::array<std::uint8_t, 4096> piece{};
  for (;;) {
    SIXPOINT_ASSIGN(const std::size_t n, source->read(piece));
    if (n == 0) {
      return text;
    }
    text.append(reinterpret_cast<const char*>(piece.data()), n);
    if (text.size() > (1U << 20U)) {
      return fail(ErrorCode::bad_data, "an entry that should be small is not", name,
                  "download the recording again");
    }
  }
}

Result<Contents> read_contents(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  Contents contents;
  contents.serial = recording.info().serial();
  contents.firmware = recording.info().firmware();
  contents.rate_hz = recording.info().sample_rate_hz().value_or(0);
  if (!(contents.rate_hz >= 1 && contents.rate_hz <= 1000)) {
    return fail(ErrorCode::bad_data, "info.txt gives no sample rate that can be", path,
                "download the recording again");
  }
  std::optional<gt3x::AgdcCalibration> agdc;
  std::optional<gt3x::TemperatureCalibration> thermometer;
  if (recording.has_entry("calibration.json")) {
    SIXPOINT_ASSIGN(const std::string json, entry_text(recording, "calibration.json"));
    if (auto calibration = gt3x::parse_agdc_calibration(json, static_cast<int>(contents.rate_hz))) {
      agdc = *calibration;
    }
  }
  if (recording.has_entry("temperature_calibration.json")) {
    SIXPOINT_ASSIGN(const std::string json, entry_text(recording, "temperature_calibration.json"));
    if (auto calibration = gt3x::parse_temperature_calibration(json)) {
      thermometer = *calibration;
    }
  }
  RestFinder finder(contents.rate_hz);
  SIXPOINT_ASSIGN(auto log, recording.open_log());
  std::optional<gt3x::Parameters> parameters;
  std::optional<double> temperature_c;
  std::optional<std::uint32_t> last;
  std::vector<gt3x::Counts> samples;
  double scale = gt3x::accel_scale_lsb_per_g(recording.info(), nullptr).value_or(256);
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      break;
    }
    if (item->kind != gt3x::LogItem::Kind::record || !item->record.checksum_ok) {
      if (item->kind != gt3x::LogItem::Kind::stray) {
        finder.break_run();
      }
      continue;
    }
    const gt3x::Record& record = item->record;
    if (record.is(gt3x::RecordType::parameters)) {
      if (auto parsed = gt3x::parse_parameters(record.payload)) {
        parameters = *std::move(parsed);
        if (!contents.calibration_time) {
          contents.calibration_time = parameters->calibration_time;
        }
        scale = gt3x::accel_scale_lsb_per_g(recording.info(), &*parameters).value_or(scale);
      }
      continue;
    }
    if (static_cast<int>(record.type) == 30) {
      if (const auto reading = gt3x::parse_temperature(record.payload); reading && thermometer) {
        if (reading->accelerometer_adc) {
          temperature_c = thermometer->accelerometer_c(*reading->accelerometer_adc);
          contents.has_temperature = true;
        } else if (reading->processor_adc && !contents.has_temperature) {
          temperature_c = thermometer->processor_c(*reading->processor_adc);
        }
      }
      continue;
    }
    const bool raw = record.is(gt3x::RecordType::activity3);
    if (record.payload.size() <= 1) {
      finder.break_run();
      continue;
    }
    if (record.is(gt3x::RecordType::activity)) {
      gt3x::unpack_activity(record.payload, samples);
    } else if (record.is(gt3x::RecordType::activity2)) {
      gt3x::unpack_activity2(record.payload, samples);
    } else if (raw) {
      gt3x::unpack_activity3(record.payload, samples);
    } else {
      continue;
    }
    if (last && record.unix_time != *last + 1) {
      finder.break_run();
    }
    last = record.unix_time;
    contents.samples += samples.size();
    const double step_s = samples.empty() ? 0 : 1.0 / static_cast<double>(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      Eigen::Vector3d g;
      if (raw && agdc) {
        const PerAxis<double> applied = agdc->apply(samples[i]);
        g = Eigen::Vector3d(applied[0], applied[1], applied[2]);
      } else {
        g = Eigen::Vector3d(samples[i][0], samples[i][1], samples[i][2]) / (raw ? 256 : scale);
      }
      contents.zeros = contents.zeros || samples[i] == gt3x::Counts{};
      finder.push(static_cast<double>(record.unix_time) + static_cast<double>(i) * step_s, g,
                  temperature_c);
    }
  }
  contents.blocks = finder.blocks();
  contents.rests = finder.take();
  return contents;
}

// One direction: many blocks that point the same way count once, with the scatter of a pose.
struct Direction {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0;
};

std::vector<Eigen::Vector3d> directions_of(const std::vector<Rest>& rests) {
  std::map<std::array<long, 3>, Direction> bins;
  for (const Rest& rest : rests) {
    if (!rest.quiet) {
      continue;
    }
    const Eigen::Vector3d u = rest.mean_g.normalized();
    Direction& bin = bins[{std::lround(4 * u[0]), std::lround(4 * u[1]), std::lround(4 * u[2])}];
    bin.sum += rest.mean_g;
    bin.n += 1;
  }
  std::vector<Eigen::Vector3d> means;
  for (const auto& [key, bin] : bins) {
    if (bin.n >= 2) {
      means.push_back(bin.sum / bin.n);
    }
  }
  return means;
}

// Log evidence of the lengths: length - 1 = sum u_a^2 (gain - 1) + u_a offset, both Gaussian.
double length_nats(const std::vector<Eigen::Vector3d>& means, double common, double gain_sd,
                   double offset_sd, Eigen::Matrix<double, 6, 1>* estimate) {
  const auto n = static_cast<Eigen::Index>(means.size());
  Eigen::MatrixXd x(n, 6);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d& m = means[static_cast<std::size_t>(i)];
    const Eigen::Vector3d u = m.normalized();
    x.row(i) << u[0] * u[0], u[1] * u[1], u[2] * u[2], u[0], u[1], u[2];
    y[i] = m.norm() - common;
  }
  Eigen::Matrix<double, 6, 1> prior;
  prior << gain_sd, gain_sd, gain_sd, offset_sd, offset_sd, offset_sd;
  const Eigen::MatrixXd xs = x * prior.asDiagonal();
  const Eigen::MatrixXd v =
      xs * xs.transpose() + kLength_sd * kLength_sd * Eigen::MatrixXd::Identity(n, n);
  const Eigen::LLT<Eigen::MatrixXd> llt(v);
  const Eigen::VectorXd z = llt.solve(y);
  if (estimate != nullptr) {
    *estimate = prior.asDiagonal() * (xs.transpose() * z);
  }
  return -0.5 * y.dot(z) - llt.matrixLLT().diagonal().array().log().sum();
}

// The direction whose length is farthest from 1 g by what units' gains and offsets are like: how
// many standard deviations, and its length.
struct Farthest {
  double sigma = 0;
  double length_g = 1;
};
Farthest farthest_length(const std::vector<Eigen::Vector3d>& means) {
  Farthest out;
  for (const Eigen::Vector3d& m : means) {
    const Eigen::Vector3d u = m.normalized();
    const double sd = std::sqrt(kGainSd * kGainSd * u.cwiseAbs2().squaredNorm() +
                                kOffsetSd_g * kOffsetSd_g + kLength_sd * kLength_sd);
    const double sigma = std::abs(m.norm() - 1) / sd;
    if (sigma > out.sigma) {
      out = {sigma, m.norm()};
    }
  }
  return out;
}

// How far the means of a pose move with temperature, and how far after the slopes of the other
// poses are taken off: a pose is judged by what it did not teach. Nothing with a single pose.
void measure_tempco_gap(const std::vector<std::vector<const Rest*>>& poses, GapSize& gap) {
  struct Sums {
    double xx = 0, n = 0;
    Eigen::Vector3d xy = Eigen::Vector3d::Zero();
    Eigen::Vector3d yy = Eigen::Vector3d::Zero();
  };
  std::vector<Sums> of_pose;
  Sums all;
  for (const auto& list : poses) {
    if (list.size() < 30) {
      continue;
    }
    const auto n = static_cast<double>(list.size());
    double mean_c = 0;
    Eigen::Vector3d mean_g = Eigen::Vector3d::Zero();
    for (const Rest* rest : list) {
      mean_c += *rest->temperature_c / n;
      mean_g += rest->mean_g / n;
    }
    Sums sums;
    sums.n = n;
    for (const Rest* rest : list) {
      const double x = *rest->temperature_c - mean_c;
      const Eigen::Vector3d y_mg = 1000 * (rest->mean_g - mean_g);
      sums.xx += x * x;
      sums.xy += x * y_mg;
      sums.yy += y_mg.cwiseAbs2();
    }
    all.xx += sums.xx;
    all.xy += sums.xy;
    all.n += sums.n;
    of_pose.push_back(sums);
  }
  double before = 0;
  double after = 0;
  double n = 0;
  for (const Sums& own : of_pose) {
    const double others_xx = all.xx - own.xx;
    if (!(others_xx > 0)) {
      continue;
    }
    const Eigen::Vector3d slope = (all.xy - own.xy) / others_xx;
    before += own.yy.sum();
    after += (own.yy - 2 * slope.cwiseProduct(own.xy) + own.xx * slope.cwiseAbs2()).sum();
    n += 3 * own.n;
  }
  if (n == 0 || of_pose.size() < 2 || !(before > 0)) {
    return;
  }
  // The mean of a block: 5 mg of noise over four seconds at 30 Hz and more.
  constexpr double kFloor_mg = 0.5;
  gap.before_mg = std::sqrt(before / n);
  gap.after_mg = std::sqrt(std::max(after, 0.0) / n);
  gap.floor_mg = kFloor_mg;
  gap.before_sigma = gap.before_mg / kFloor_mg;
  gap.after_sigma = gap.after_mg / kFloor_mg;
  gap.after_interval_mg = {0.8 * gap.after_mg, 1.25 * gap.after_mg};
  gap.closed_fraction = std::clamp(1 - std::pow(gap.after_mg / gap.before_mg, 2), 0.0, 1.0);
  gap.by_feature[0] = {gap.before_sigma, gap.after_sigma};
}

}  // namespace

Result<Diagnosis> diagnose_plain(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options) {
  SIXPOINT_ASSIGN(const Contents contents, read_contents(files, path));
  const auto allowed = [&](const std::string& name) { return options.without.count(name) == 0; };
  Diagnosis out;
  out.bundle = path;
  out.protocol = "none";
  out.serial = contents.serial;
  out.firmware = contents.firmware;
  out.seed = options.seed;
  out.losses.emplace_back(
      "no protocol: poses and motion are unknown, only lengths at rest and temperatures are "
      "judged");
  const auto means = directions_of(contents.rests);
  std::set<std::string> seen;
  const auto find = [&](EffectFinding f) {
    f.probability = 1 / (1 + std::exp(-std::clamp(f.nats, -40.0, 9.0)));
    seen.insert(f.name);
    if (f.nats > kAccept) {
      out.effects.push_back(f);
    }
    out.candidates.push_back(std::move(f));
  };
  if (means.empty()) {
    out.inconclusive = true;
    out.losses.push_back("the recording holds no still period of four seconds");
  } else {
    double square = 0;
    for (const Eigen::Vector3d& m : means) {
      square += std::pow(m.norm() - 1, 2);
    }
    out.gap.before_mg = 1000 * std::sqrt(square / static_cast<double>(means.size()));
    Eigen::Matrix<double, 6, 1> nominal_estimate;
    const double nominal = length_nats(means, 1, kGainSd, kOffsetSd_g, &nominal_estimate);
    double wrong = -1e300;
    double best = -1e300;
    double common = 1;
    Eigen::Matrix<double, 6, 1> estimate;
    constexpr int kSteps = 32;
    for (int k = 0; k < kSteps; ++k) {
      const double c = 0.79 + 0.18 * (k + 0.5) / kSteps;
      Eigen::Matrix<double, 6, 1> own;
      const double nats = length_nats(means, c, kGainSd * c, 0.14, &own);
      if (nats > best) {
        best = nats;
        common = c;
        estimate = own;
      }
      wrong = wrong == -1e300
                  ? nats
                  : std::max(wrong, nats) + std::log1p(std::exp(-std::abs(wrong - nats)));
    }
    wrong -= std::log(static_cast<double>(kSteps));
    // The header is evidence: it can make the mismatch as likely as not, never certain or
    // impossible.
    double header = 0;
    const bool mos = contents.serial.starts_with("MOS");
    if (contents.calibration_time) {
      const bool fits =
          sim::filter_of_constants(contents.serial, *contents.calibration_time) ==
          sim::filter_of_recording(contents.serial, contents.firmware, *contents.calibration_time);
      header = fits ? -2 : 3.5;
      if (!fits) {
        out.losses.push_back(
            "the header says: constants of before 2014-03-24 under a firmware that does not set "
            "their filter configuration (16CPAN03)");
      }
    } else if (!mos) {
      header = -2;
    }
    const double nats = wrong - nominal + kLogPrior + header;
    if (allowed("filter_mismatch")) {
      EffectFinding f{"filter_mismatch", 0, nats, {}, wrong - nominal - 3, false, {}};
      f.parameters.push_back({"gain", {common}, {0.03}});
      f.parameters.push_back(
          {"offset_g", {estimate[3], estimate[4], estimate[5]}, {0.03, 0.03, 0.03}});
      find(std::move(f));
    } else if (wrong - nominal > 8) {
      out.unknown.present = true;
      out.unknown.where.push_back("mean: lengths at rest are far from 1 g");
    }
    // What is left of the lengths with the better of both.
    const bool mismatch = nats > kAccept && allowed("filter_mismatch");
    double left = 0;
    for (const Eigen::Vector3d& m : means) {
      const Eigen::Vector3d u = m.normalized();
      const auto& e = mismatch ? estimate : nominal_estimate;
      left += std::pow(
          m.norm() - (mismatch ? common : 1) - u.cwiseAbs2().dot(e.head<3>()) - u.dot(e.tail<3>()),
          2);
    }
    out.gap.after_mg = 1000 * std::sqrt(left / static_cast<double>(means.size()));
    out.gap.floor_mg = 6;
    out.gap.before_sigma = out.gap.before_mg / out.gap.floor_mg;
    out.gap.after_sigma = out.gap.after_mg / out.gap.floor_mg;
    out.gap.after_interval_mg = {0.7 * out.gap.after_mg, 1.5 * out.gap.after_mg};
    out.gap.closed_fraction =
        mismatch && out.gap.before_mg > 6
            ? std::clamp(1 - std::pow(out.gap.after_mg / out.gap.before_mg, 2), 0.0, 1.0)
            : 0;
    if (!mismatch) {
      // Gain and offset within their priors are the unit's own, no gap.
      out.gap.before_mg = std::max(out.gap.after_mg, 0.0);
      out.gap.before_sigma = out.gap.after_sigma;
    }
    // A gain or offset far outside of what units have is a finding and no explanation, also where
    // too few directions were met to say what it is: one unit in a thousand.
    constexpr double kFar_sigma = 3.3;
    const Farthest farthest = farthest_length(means);
    if (!mismatch && allowed("filter_mismatch") && farthest.sigma > kFar_sigma) {
      out.unknown.present = true;
      out.unknown.where.push_back(
          fmt::format("mean: a length at rest of {:.3f} g is {:.1f} standard deviations from what "
                      "units read; more sides would say why",
                      farthest.length_g, farthest.sigma));
    }
    if (out.gap.after_mg > 40) {
      out.unknown.present = true;
      out.unknown.where.push_back("mean: lengths at rest fit neither acquisition mode");
    }
    for (int a = 0; a < 3; ++a) {
      out.where.push_back({a, "still periods", "pose",
                           1000 * std::abs(mismatch ? estimate[3 + a] : nominal_estimate[3 + a]),
                           0});
    }
  }
  // Zero against temperature, in the poses that were kept long: slopes within a pose only.
  double coldest = 1e9, hottest = -1e9;
  // A pose ends where the mean jumps: temperature moves it by less than 12 mg in seconds.
  std::vector<std::vector<const Rest*>> poses;
  const Rest* before = nullptr;
  for (const Rest& rest : contents.rests) {
    if (!rest.temperature_c) {
      continue;
    }
    coldest = std::min(coldest, *rest.temperature_c);
    hottest = std::max(hottest, *rest.temperature_c);
    if (before == nullptr || (rest.mean_g - before->mean_g).norm() > 0.012 ||
        rest.time_s - before->time_s > 600) {
      poses.emplace_back();
    }
    poses.back().push_back(&rest);
    before = &rest;
  }
  if (hottest - coldest > 5 && allowed("offset_tempco")) {
    double sxx = 0;
    Eigen::Vector3d sxy = Eigen::Vector3d::Zero();
    Eigen::Vector3d syy = Eigen::Vector3d::Zero();
    double n = 0;
    for (const auto& list : poses) {
      if (list.size() < 30) {
        continue;
      }
      double mt = 0;
      Eigen::Vector3d mg = Eigen::Vector3d::Zero();
      for (const Rest* r : list) {
        mt += *r->temperature_c / static_cast<double>(list.size());
        mg += r->mean_g / static_cast<double>(list.size());
      }
      for (const Rest* r : list) {
        const double x = *r->temperature_c - mt;
        sxx += x * x;
        sxy += x * 1000 * (r->mean_g - mg);
        syy += (1000 * (r->mean_g - mg)).cwiseAbs2();
        n += 1;
      }
    }
    if (sxx > 0 && n > 60) {
      const Eigen::Vector3d slope = sxy / sxx;
      // Blocks follow one another: their scatter about the line is not independent; a tenth counts.
      const Eigen::Vector3d sd =
          ((syy - sxx * slope.cwiseAbs2()).cwiseMax(0) / (0.1 * n * sxx)).cwiseSqrt();
      double nats = kLogPrior;
      for (Eigen::Index a = 0; a < 3; ++a) {
        nats += 0.5 * std::pow(slope[a] / std::max(1e-6, sd[a]), 2) -
                std::log1p(0.5 / std::max(1e-6, sd[a]));
      }
      EffectFinding f{
          "offset_tempco",       0, nats, {}, nats - kLogPrior - 3, slope.cwiseAbs().maxCoeff() > 1,
          {"sensitivity_tempco"}};
      f.parameters.push_back({"mg_per_c", {slope[0], slope[1], slope[2]}, {sd[0], sd[1], sd[2]}});
      const bool accepted = f.nats > kAccept;
      find(std::move(f));
      if (accepted && out.effects.size() == 1) {
        measure_tempco_gap(poses, out.gap);
      }
    }
  }
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string name(entry.name);
    if (allowed(name) && seen.count(name) == 0) {
      EffectFinding f;
      f.name = name;
      f.nats = kLogPrior;
      f.probability = 0.03;
      out.candidates.push_back(std::move(f));
      out.not_observable.emplace_back(name,
                                      entry.segment.empty() ? "none" : std::string(entry.segment));
    }
  }
  out.next_segments.push_back(
      {"faces", 1.7, 0.135 * 12, {"misalignment", "second_order", "settling"}});
  std::stable_sort(out.candidates.begin(), out.candidates.end(),
                   [](const auto& a, const auto& b) { return a.nats > b.nats; });
  std::stable_sort(out.effects.begin(), out.effects.end(),
                   [](const auto& a, const auto& b) { return a.nats > b.nats; });
  out.unknown.probability = out.unknown.present ? 0.95 : 0.1;
  out.verdict = out.unknown.present
                    ? (out.effects.empty() ? Verdict::unexplained : Verdict::partly_explained)
                    : (out.effects.empty() ? Verdict::no_gap : Verdict::explained);
  return out;
}

Result<LengthFit> fit_lengths(const std::vector<Eigen::Vector3d>& raw, double gravity,
                              CrossAxis cross_axis) {
  const auto n = static_cast<Eigen::Index>(raw.size());
  if (n < 12 || !(gravity > 0)) {
    return fail(ErrorCode::bad_data, "fewer than twelve positions", {},
                "rest the unit in more directions");
  }
  // Start: an axis-aligned ellipsoid by linear least squares, (raw - z)' D (raw - z) = g^2.
  Eigen::Vector3d low = raw.front();
  Eigen::Vector3d high = raw.front();
  for (const Eigen::Vector3d& r : raw) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  if (!((high - low).minCoeff() > 0)) {
    return fail(ErrorCode::bad_data, "the positions do not span all directions", {},
                "rest the unit on every side");
  }
  LengthFit fit;
  fit.zero = 0.5 * (low + high);
  fit.sensitivity = Eigen::Matrix3d::Zero();
  fit.sensitivity.diagonal() = (2 * gravity * (high - low).cwiseInverse());
  using Vector9 = Eigen::Matrix<double, 9, 1>;
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  Matrix9 a;
  const double scale = fit.sensitivity.diagonal().mean();
  for (int round = 0; round < 50; ++round) {
    a.setZero();
    Vector9 b = Vector9::Zero();
    double square = 0;
    for (const Eigen::Vector3d& r : raw) {
      const Eigen::Vector3d d = r - fit.zero;
      const Eigen::Vector3d g = fit.sensitivity * d;
      const double length = g.norm();
      const Eigen::Vector3d u = g / length;
      Vector9 row;  // S xx yy zz yz xz xy in units of `scale`, then zero in counts
      row << scale * u[0] * d[0], scale * u[1] * d[1], scale * u[2] * d[2],
          scale * (u[1] * d[2] + u[2] * d[1]), scale * (u[0] * d[2] + u[2] * d[0]),
          scale * (u[0] * d[1] + u[1] * d[0]), 0, 0, 0;
      row.tail<3>() = -fit.sensitivity * u;
      if (cross_axis == CrossAxis::none) {
        row.segment<3>(3).setZero();
      }
      const double miss = gravity - length;
      a += row * row.transpose();
      b += row * miss;
      square += miss * miss;
    }
    fit.residual = std::sqrt(square / static_cast<double>(n));
    if (cross_axis == CrossAxis::none) {
      a.diagonal().segment<3>(3).setOnes();  // no step there
    }
    const Eigen::LDLT<Matrix9> solver(a);
    const Vector9 step = solver.solve(b);
    if (!step.allFinite()) {
      return fail(ErrorCode::bad_data, "the positions do not span all directions", {},
                  "rest the unit on every side");
    }
    fit.sensitivity.diagonal() += scale * step.head<3>();
    fit.sensitivity(1, 2) += scale * step[3];
    fit.sensitivity(0, 2) += scale * step[4];
    fit.sensitivity(0, 1) += scale * step[5];
    fit.sensitivity(2, 1) = fit.sensitivity(1, 2);
    fit.sensitivity(2, 0) = fit.sensitivity(0, 2);
    fit.sensitivity(1, 0) = fit.sensitivity(0, 1);
    fit.zero += step.tail<3>();
    if (step.head<6>().norm() < 1e-12) {
      break;
    }
  }
  const auto& s = fit.sensitivity;
  fit.cross = Eigen::Vector3d(2 * s(1, 2) / (s(1, 1) + s(2, 2)), 2 * s(0, 2) / (s(0, 0) + s(2, 2)),
                              2 * s(0, 1) / (s(0, 0) + s(1, 1)));
  const double variance = fit.residual * fit.residual * static_cast<double>(n) /
                          std::max<double>(1, static_cast<double>(n) - 9);
  fit.cross_sd =
      (variance * a.inverse().diagonal().segment<3>(3)).cwiseSqrt() * scale / s.diagonal().mean();
  return fit;
}

}  // namespace sixpoint::gap

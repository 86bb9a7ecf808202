#include "sim/protocol_run.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include <fmt/format.h>

namespace sixpoint::sim {

namespace {

constexpr std::array<std::string_view, 4> kSegmentKindNames = {"still", "vibration", "ramp",
                                                               "soak"};

constexpr std::uint64_t kNoiseStream = 0x6E6F6973;
constexpr std::uint64_t kSeatingStream = 0x73656174;
constexpr std::uint64_t kMostSamples = 100'000'000;
constexpr std::size_t kBlock = 512;
constexpr std::uint64_t kRunIn = 64;  // samples
constexpr double kLow12 = -2048;
constexpr double kHigh12 = 2047;

bool same_pose(const ProtocolSegment& a, const ProtocolSegment& b) {
  return (a.rotation - b.rotation).cwiseAbs().maxCoeff() < 1e-6;
}

// Time from the nominal end of `before` to the start of `next`.
double pause_s(const ProtocolSegment& before, const ProtocolSegment& next, double rate_hz) {
  return next.host_start_s - before.host_start_s - static_cast<double>(before.samples) / rate_hz;
}

// What lost or repeated samples and a clock that is off can make of a segment's duration.
double allowance_s(const ProtocolSegment& segment, double rate_hz) {
  return 0.5 + 0.02 * static_cast<double>(segment.samples) / rate_hz;
}

Status check(const ProtocolRun& run) {
  const auto bad = [](std::string what, std::size_t segment) {
    return fail(ErrorCode::bad_data, std::move(what), fmt::format("segment {}", segment),
                "the segments must follow one another in the order of their samples");
  };
  if (!(run.rate_hz > 0 && run.rate_hz <= 10'000 && run.accel_scale_lsb_per_g > 0 &&
        std::isfinite(run.accel_scale_lsb_per_g) && std::isfinite(run.gravity_g) &&
        run.seating_sd_deg >= 0 && run.seating_sd_deg < 360)) {
    return fail(ErrorCode::bad_data, "rate, scale, gravity or seating scatter are impossible", {},
                "rate and scale are positive, the seating scatter is not negative");
  }
  if (!all_finite(run.gain, run.offset_g, run.noise_mg) || std::ranges::min(run.noise_mg) < 0) {
    return fail(ErrorCode::bad_data, "gain, offset or noise are no finite numbers", {},
                "noise must not be negative");
  }
  std::uint64_t end = 0;
  for (std::size_t i = 0; i < run.segments.size(); ++i) {
    const ProtocolSegment& segment = run.segments[i];
    if (segment.first_sample < end || segment.first_sample > kMostSamples ||
        segment.samples > kMostSamples - segment.first_sample) {
      return bad("the segment overlaps another one, is out of order or is too long", i);
    }
    end = segment.first_sample + segment.samples;
    bool finite = std::isfinite(segment.host_start_s) && segment.rotation.allFinite();
    if (segment.vibration) {
      const Tone& tone = *segment.vibration;
      finite = finite && tone.direction_lab.allFinite() &&
               all_finite(tone.frequency_hz, tone.amplitude_g, tone.phase_rad);
    }
    if (!finite) {
      return bad("the segment holds a number that is not finite", i);
    }
  }
  for (const EffectSpec& effect : run.effects) {
    if (effect.kind == nullptr) {
      return fail(ErrorCode::bad_data, "an effect has no kind", {}, "take it from find_effect");
    }
  }
  return {};
}

Eigen::Matrix3d small_rotation(Random& random, double sd_deg) {
  const double sd_rad = sd_deg * std::numbers::pi / 180;
  const Eigen::Vector3d vector =
      Eigen::Vector3d(random.normal(), random.normal(), random.normal()) * sd_rad;
  const double angle = vector.norm();
  return angle == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                    : Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

// The log, read by rising times.
class Thermometer {
 public:
  explicit Thermometer(const std::vector<TemperaturePoint>& points) : points_(points) {}

  double at(double time_s) {
    if (points_.empty()) {
      return 25;
    }
    while (next_ > 0 && points_[next_ - 1].host_time_s > time_s) {
      --next_;
    }
    while (next_ < points_.size() && points_[next_].host_time_s <= time_s) {
      ++next_;
    }
    if (next_ == 0) {
      return points_.front().temperature_c;
    }
    if (next_ == points_.size()) {
      return points_.back().temperature_c;
    }
    const TemperaturePoint& a = points_[next_ - 1];
    const TemperaturePoint& b = points_[next_];
    return a.temperature_c + (b.temperature_c - a.temperature_c) * (time_s - a.host_time_s) /
                                 (b.host_time_s - a.host_time_s);
  }

 private:
  const std::vector<TemperaturePoint>& points_;
  std::size_t next_ = 0;
};

class Runner {
 public:
  Runner(const ProtocolRun& run, ProtocolRecord& record, bool with_times)
      : run_(run),
        record_(record),
        with_times_(with_times),
        effects_(make_effects(run.effects, run.seed)),
        noise_(run.seed, kNoiseStream),
        seating_(run.seed, kSeatingStream),
        thermometer_(run.temperature) {
    const std::uint64_t samples =
        run.segments.empty() ? 0 : run.segments.back().first_sample + run.segments.back().samples;
    record_.counts.resize(samples);
    if (with_times_) {
      record_.sample_time_s.resize(samples);
    }
    RecordingPlan plan{run.rate_hz, samples, {}};
    for (const ProtocolSegment& segment : run.segments) {
      if (!segment.vibration) {
        plan.rests.push_back({segment.first_sample, segment.samples});
      }
    }
    for (const auto& effect : effects_) {
      effect->on_digital(format_);
      effect->on_recording(plan);
      run_in_ = run_in_ || effect->needs_run_in();
    }
  }

  Status problem() const { return check_effects(effects_); }

  void run() {
    const ProtocolSegment* before = nullptr;
    for (const ProtocolSegment& segment : run_.segments) {
      const bool contiguous =
          before != nullptr && follows_without_pause(*before, segment, run_.rate_hz);
      Placement placement;
      placement.start_s =
          contiguous && run_.contiguous_segments_follow ? next_sample_s_ : segment.host_start_s;
      placement.rotation = segment.rotation;
      placement.previous = before == nullptr ? segment.rotation : before->rotation;
      placement.anew = before == nullptr || !same_placement(*before, segment, run_.rate_hz);
      placement.contiguous = contiguous;
      record_.host_start_s.push_back(placement.start_s);
      run_segment(segment, placement);
      before = &segment;
    }
  }

 private:
  void run_segment(const ProtocolSegment& segment, const Placement& placement) {
    if (placement.anew) {
      seated_ = small_rotation(seating_, run_.seating_sd_deg);
    }
    for (const auto& effect : effects_) {
      effect->on_placement(placement);
    }
    rotation_ = seated_ * segment.rotation;
    tone_ = segment.vibration;
    if (tone_) {
      const double length = tone_->direction_lab.norm();
      if (length > 0) {
        tone_->direction_lab /= length;
      }
      for (const auto& effect : effects_) {
        effect->on_tone(*tone_);
      }
    }
    block_.clock_start_s = placement.start_s;
    tone_start_s_ = placement.start_s;
    if (run_in_ && !placement.contiguous) {
      make_block(segment.first_sample, -static_cast<std::int64_t>(kRunIn), kRunIn, false);
    }
    for (std::uint64_t done = 0; done < segment.samples;) {
      const std::size_t count =
          static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, segment.samples - done));
      make_block(segment.first_sample + done, static_cast<std::int64_t>(done), count, true);
      std::copy_n(
          block_.stored.begin(), count,
          record_.counts.begin() + static_cast<std::ptrdiff_t>(segment.first_sample + done));
      if (with_times_) {
        std::copy_n(block_.time_s.begin(), count,
                    record_.sample_time_s.begin() +
                        static_cast<std::ptrdiff_t>(segment.first_sample + done));
      }
      done += count;
      next_sample_s_ = block_.time_s.back() + 1 / run_.rate_hz;
    }
  }

  // Samples `offset` ... of the segment. A run-in (keep = false) is felt by the front end only.
  void make_block(std::uint64_t first_sample, std::int64_t offset, std::size_t count, bool keep) {
    block_.first_sample = first_sample;
    block_.time_s.resize(count);
    block_.motion.resize(count);
    block_.true_g.resize(count);
    block_.temperature_c.resize(count);
    block_.stored.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      block_.time_s[i] = block_.clock_start_s +
                         static_cast<double>(offset + static_cast<std::int64_t>(i)) / run_.rate_hz;
    }
    if (keep) {
      for (const auto& effect : effects_) {
        effect->on_sampling(block_);
      }
    }
    set_stimulus();
    sense();
    if (keep) {
      store();
    }
  }

  void set_stimulus() {
    for (std::size_t i = 0; i < block_.size(); ++i) {
      block_.motion[i] = {rotation_, Eigen::Vector3d(0, 0, run_.gravity_g)};
      block_.temperature_c[i] = thermometer_.at(block_.time_s[i]);
    }
    if (tone_) {
      const double omega = 2 * std::numbers::pi * tone_->frequency_hz;
      for (std::size_t i = 0; i < block_.size(); ++i) {
        block_.motion[i].force_lab_g +=
            tone_->amplitude_g *
            std::sin(omega * (block_.time_s[i] - tone_start_s_) + tone_->phase_rad) *
            tone_->direction_lab;
      }
    }
    for (const auto& effect : effects_) {
      effect->on_stimulus(block_);
    }
  }

  void sense() {
    for (std::size_t i = 0; i < block_.size(); ++i) {
      block_.true_g[i] = block_.motion[i].rotation * block_.motion[i].force_lab_g;
    }
    block_.sensed_g = block_.true_g;
    for (const auto& effect : effects_) {
      effect->on_sensor(block_);
    }
    for (Eigen::Vector3d& sensed : block_.sensed_g) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        sensed[static_cast<Eigen::Index>(axis)] += run_.noise_mg[axis] / kMgPerG * noise_.normal();
      }
    }
    for (const auto& effect : effects_) {
      effect->on_analog(block_);
    }
  }

  void store() {
    bool clipped = false;
    for (std::size_t i = 0; i < block_.size(); ++i) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        const double g = run_.gain[axis] * block_.sensed_g[i][static_cast<Eigen::Index>(axis)] +
                         run_.offset_g[axis];
        block_.stored[i][axis] = static_cast<std::int16_t>(format_.to_integer(
            format_.limited(g) * run_.accel_scale_lsb_per_g, kLow12, kHigh12, clipped));
      }
    }
    for (const auto& effect : effects_) {
      effect->on_firmware(block_);
    }
  }

  const ProtocolRun& run_;
  ProtocolRecord& record_;
  bool with_times_;
  std::vector<std::unique_ptr<Effect>> effects_;
  Random noise_;
  Random seating_;
  Thermometer thermometer_;
  NumberFormat format_;
  bool run_in_ = false;
  SimulatedBlock block_;
  Eigen::Matrix3d seated_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();
  std::optional<Tone> tone_;
  double tone_start_s_ = 0;
  double next_sample_s_ = 0;
};

Result<ProtocolRecord> record(const ProtocolRun& run, bool with_times) {
  SIXPOINT_CHECK(check(run));
  ProtocolRecord made;
  Runner runner(run, made, with_times);
  SIXPOINT_CHECK(runner.problem());
  runner.run();
  return made;
}

}  // namespace

std::string_view to_string(SegmentKind kind) {
  return kSegmentKindNames[static_cast<std::size_t>(kind)];
}

std::optional<SegmentKind> parse_segment_kind(std::string_view name) {
  const auto found = std::ranges::find(kSegmentKindNames, name);
  return found == kSegmentKindNames.end()
             ? std::nullopt
             : std::optional(static_cast<SegmentKind>(found - kSegmentKindNames.begin()));
}

bool follows_without_pause(const ProtocolSegment& before, const ProtocolSegment& next,
                           double rate_hz) {
  return same_pose(before, next) && before.kind == next.kind &&
         std::abs(pause_s(before, next, rate_hz)) <= allowance_s(before, rate_hz);
}

PerAxis<double> nominal_noise_mg(double rate_hz) {
  PerAxis<double> noise_mg = ProtocolRun().noise_mg;
  for (double& axis_mg : noise_mg) {
    axis_mg *= std::sqrt(rate_hz / ProtocolRun().rate_hz);
  }
  return noise_mg;
}

bool same_placement(const ProtocolSegment& before, const ProtocolSegment& next, double rate_hz) {
  constexpr double kBetweenTones_s = 3;
  return follows_without_pause(before, next, rate_hz) ||
         (same_pose(before, next) && before.vibration && next.vibration &&
          std::abs(pause_s(before, next, rate_hz)) <=
              kBetweenTones_s + allowance_s(before, rate_hz));
}

Result<std::vector<gt3x::Counts>> run_protocol(const ProtocolRun& run) {
  SIXPOINT_ASSIGN(ProtocolRecord made, record(run, false));
  return std::move(made.counts);
}

Result<ProtocolRecord> record_protocol(const ProtocolRun& run) { return record(run, true); }

}  // namespace sixpoint::sim

#include "gap/recording/clean.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "gap/recording/median.h"

namespace sixpoint::gap {
namespace {

using gt3x::Counts;

constexpr int kFullScaleLow = -2048;  // the stored number's 12 bits
constexpr int kFullScaleHigh = 2047;
constexpr double kTurn = 4096;  // what an overflow takes away

// The longest run of one value that noise makes: with the noise of these units two samples agree on
// all axes with probability below 0.02, a tenth below for a low-pass of 12.5 Hz; runs of 20 do not
// happen by chance in any recording.
constexpr std::size_t kStuckRun = 20;

void note_segment(const Bundle& bundle, std::size_t first, std::size_t last, RunTally& tally) {
  for (std::size_t i = 0; i < bundle.segments.size(); ++i) {
    const Segment& segment = bundle.segments[i];
    if (first < segment.first_sample + segment.samples && last >= segment.first_sample &&
        (tally.segments.empty() || tally.segments.back() < i)) {
      tally.segments.push_back(i);
    }
  }
}

void find_runs(const Bundle& bundle, CleanSamples& clean) {
  const auto& x = bundle.samples;
  const auto held_run = static_cast<std::size_t>(std::lround(0.95 * bundle.rate_hz));
  for (std::size_t first = 0; first < x.size();) {
    std::size_t last = first;
    while (last + 1 < x.size() && x[last + 1] == x[first]) {
      ++last;
    }
    const std::size_t length = last - first + 1;
    const bool zero = x[first] == Counts{};
    const auto mark = [&](std::uint8_t flag, RunTally& tally) {
      ++tally.runs;
      tally.samples += length;
      note_segment(bundle, first, last, tally);
      for (std::size_t i = first; i <= last; ++i) {
        clean.flags[i] |= flag;
      }
    };
    if (zero && length >= kZeroRun) {
      mark(kSampleZero, clean.zeros);
    } else if (length >= held_run) {
      mark(kSampleHeld, clean.held);
    } else if (length >= kStuckRun) {
      mark(kSampleHeld, clean.stuck);
    }
    first = last + 1;
  }
}

// Histogram bin of a stored count.
std::size_t bin_of(int value) {
  const std::ptrdiff_t bin = std::clamp(value, kFullScaleLow, kFullScaleHigh);
  return static_cast<std::size_t>(bin - kFullScaleLow);
}

// All 48 signed permutations.
std::vector<Eigen::Matrix3i> signed_permutations() {
  std::vector<Eigen::Matrix3i> all;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3i m = Eigen::Matrix3i::Zero();
      for (int row = 0; row < 3; ++row) {
        m(row, order[static_cast<std::size_t>(row)]) = ((signs >> row) & 1) != 0 ? -1 : 1;
      }
      all.push_back(m);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return all;
}

// Gravity in the sensor's frame in one segment at rest, in g: as recorded, and as the protocol has
// it.
struct Pose {
  Eigen::Vector3d recorded_g;
  Eigen::Vector3d expected_g;
};

std::vector<Pose> recorded_poses(const Bundle& bundle, const CleanSamples& clean) {
  constexpr std::size_t kSamples = 500;  // per segment: the median of them is off by 0.1 LSB
  constexpr std::size_t kLeast = 20;
  std::vector<Pose> poses;
  for (const Segment& segment : bundle.segments) {
    if (!segment.at_rest()) {
      continue;
    }
    std::vector<std::size_t> usable;
    const std::size_t stride = std::max<std::size_t>(1, segment.samples / kSamples);
    for (std::size_t i = 0; i < segment.samples; i += stride) {
      if (clean.usable(segment.first_sample + i)) {  // clipped samples are not marked yet
        usable.push_back(segment.first_sample + i);
      }
    }
    if (usable.size() < kLeast) {
      continue;
    }
    Pose pose{Eigen::Vector3d::Zero(), bundle.gravity_in_sensor(segment)};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<int> values;
      values.reserve(usable.size());
      for (const std::size_t i : usable) {
        values.push_back(bundle.samples[i][axis]);
      }
      pose.recorded_g[static_cast<Eigen::Index>(axis)] =
          upper_median(values) / bundle.accel_scale_lsb_per_g;
    }
    poses.push_back(pose);
  }
  return poses;
}

double rms_g(const std::vector<Pose>& poses, const Eigen::Matrix3i& axes) {
  double sum = 0;
  for (const Pose& pose : poses) {
    sum += (pose.recorded_g - axes.cast<double>() * pose.expected_g).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(poses.size()));
}

void turn_back(CleanSamples& clean) {
  const Eigen::Matrix3i back = clean.axis_matrix.transpose();
  for (Counts& sample : clean.samples) {
    const Eigen::Vector3i right = back * Eigen::Vector3i(sample[0], sample[1], sample[2]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sample[axis] = static_cast<std::int16_t>(
          std::clamp(right[static_cast<Eigen::Index>(axis)], -32768, 32767));
    }
  }
}

void find_axes(const Bundle& bundle, CleanSamples& clean) {
  // Neighbouring permutations differ by more than 0.8 g rms over six poses; offsets and gains of a
  // wrong filter mode reach 0.3 g.
  constexpr double kApart_g = 0.25;
  constexpr double kFits_g = 0.45;
  const std::vector<Pose> poses = recorded_poses(bundle, clean);
  if (poses.empty()) {
    return;
  }
  const Eigen::Matrix3i identity = Eigen::Matrix3i::Identity();
  const double as_is = rms_g(poses, identity);
  double best = as_is;
  double second = std::numeric_limits<double>::max();
  Eigen::Matrix3i chosen = identity;
  for (const Eigen::Matrix3i& axes : signed_permutations()) {
    const double rms = axes == identity ? as_is : rms_g(poses, axes);
    if (rms < best) {
      second = best;
      best = rms;
      chosen = axes;
    } else if (axes != identity) {
      second = std::min(second, rms);
    }
  }
  clean.axes_decidable = second - best > kApart_g;
  clean.axes_gain_g = as_is - best;
  // Where others fit alike, none of them is known: the recording is in other poses, and that is all.
  clean.axes_turned = clean.axes_decidable && clean.axes_gain_g > kApart_g && best < kFits_g;
  clean.pose_error_g = clean.axes_turned ? best : as_is;
  if (clean.axes_turned) {
    clean.axis_matrix = chosen;
    turn_back(clean);
  }
}

// One axis during one vibration, as the protocol has it: level + amplitude cos(w i + phase), LSB.
struct DrivenAxis {
  const Segment* segment;
  std::size_t axis;
  double level_lsb;
  double amplitude_lsb;  // with its sign
  double w;              // radians per sample

  double peak_lsb() const { return std::abs(amplitude_lsb) + std::abs(level_lsb); }
  double at(std::size_t i, double gain, double phase) const {
    return gain * (level_lsb + amplitude_lsb * std::cos(w * static_cast<double>(i) + phase));
  }
};

std::vector<DrivenAxis> driven_axes(const Bundle& bundle) {
  std::vector<DrivenAxis> driven;
  for (const Segment& segment : bundle.segments) {
    if (!segment.vibration) {
      continue;
    }
    const Eigen::Vector3d along = segment.rotation * segment.vibration->direction_lab;
    const Eigen::Vector3d rest = bundle.gravity_in_sensor(segment);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      driven.push_back({&segment, static_cast<std::size_t>(axis),
                        rest[axis] * bundle.accel_scale_lsb_per_g,
                        along[axis] * segment.vibration->amplitude_g * bundle.accel_scale_lsb_per_g,
                        2 * M_PI * segment.vibration->frequency_hz / bundle.rate_hz});
    }
  }
  return driven;
}

struct ToneGuess {
  double gain = 1;
  double phase = 0;
  double rms_lsb = 0;
};

// The likeliest gain and phase of samples [first, last), compared on the circle of 4096: blind to
// whether a number wrapped.
ToneGuess guess_tone(const DrivenAxis& driven, const CleanSamples& clean, std::size_t first,
                     std::size_t last) {
  ToneGuess guess;
  double least = std::numeric_limits<double>::max();
  for (const double gain : {1.0, 0.95, 0.9, 0.85, 0.8}) {  // down to a filter mismatch's
    for (int step = 0; step < 60; ++step) {
      const double phase = step * M_PI / 30;
      double sum = 0;
      for (std::size_t i = first; i < last; ++i) {
        const double stored = clean.samples[driven.segment->first_sample + i][driven.axis];
        const double d = std::remainder(stored - driven.at(i, gain, phase), kTurn);
        sum += d * d;
      }
      if (sum < least) {
        least = sum;
        guess = {gain, phase, std::sqrt(sum / static_cast<double>(last - first))};
      }
    }
  }
  return guess;
}

// A number that overflowed lies 4096 away from where its known tone has it. Only where the protocol
// drives the axis near or beyond full scale.
void undo_wrap(const Bundle& bundle, CleanSamples& clean) {
  constexpr double kNearFullScale = 0.9 * kFullScaleHigh;  // gains and zeros are off by less
  constexpr std::size_t kPiece = 50;  // short enough that a slip of the clock spoils few pieces
  // How far off a piece may be: times that scatter bring a tone this far off (2 ms at 19 Hz and 11
  // g).
  constexpr double kJitters_lsb = 600;
  // A unit that clips does not overflow: near half of such a dwell stands at its limits. Of numbers
  // that overflow one in a thousand does.
  constexpr std::size_t kClips = 50;  // one sample of so many
  for (const DrivenAxis& driven : driven_axes(bundle)) {
    if (driven.peak_lsb() < kNearFullScale) {
      continue;
    }
    const std::size_t n = driven.segment->samples;
    const std::span dwell(clean.samples.data() + driven.segment->first_sample, n);
    const auto at_limit = std::ranges::count_if(dwell, [&](const gt3x::Counts& counts) {
      return std::abs(counts[driven.axis]) >= kFullScaleHigh;
    });
    if (kClips * static_cast<std::size_t>(at_limit) > n) {
      continue;
    }
    for (std::size_t first = 0; first + kPiece <= n; first += kPiece) {
      const ToneGuess tone = guess_tone(driven, clean, first, first + kPiece);
      if (tone.rms_lsb > kJitters_lsb) {
        continue;
      }
      const std::size_t last = first + 2 * kPiece > n ? n : first + kPiece;
      for (std::size_t i = first; i < last; ++i) {
        const std::size_t at = driven.segment->first_sample + i;
        std::int16_t& stored = clean.samples[at][driven.axis];
        const double turns = std::round((driven.at(i, tone.gain, tone.phase) - stored) / kTurn);
        if (turns != 0 && std::abs(stored) < kFullScaleHigh) {
          stored = static_cast<std::int16_t>(stored + kTurn * turns);
          clean.flags[at] |= kSampleWrapped;
          ++clean.wrapped_samples;
        }
      }
    }
  }
}

constexpr double kDriven_g = 2;  // convention: the catalogue's saturation begins at 5 g

// Whether a plateau can be told from the crest of the tone. A tone that repeats after a few samples
// (20 Hz at 100 Hz: five) has one of them at its crest, so that all of its crest is one value.
bool crest_is_spread(const Segment& segment, double rate_hz) {
  constexpr int kFewPhases = 50;    // 6 g of so many: neighbours of the crest 12 LSB below it
  constexpr double kWanders = 0.5;  // of the distance between two phases, over the dwell
  const double cycles = segment.vibration->frequency_hz / rate_hz;
  for (int samples = 1; samples < kFewPhases; ++samples) {
    if (std::abs(std::remainder(samples * cycles, 1)) * static_cast<double>(segment.samples) <
        kWanders) {
      return false;
    }
  }
  return true;
}

double driven_g(const Bundle& bundle) {
  double most_lsb = 0;
  for (const DrivenAxis& driven : driven_axes(bundle)) {
    if (std::abs(driven.amplitude_lsb) >= kDriven_g * bundle.accel_scale_lsb_per_g &&
        crest_is_spread(*driven.segment, bundle.rate_hz)) {
      most_lsb = std::max(most_lsb, std::min<double>(driven.peak_lsb(), kFullScaleHigh));
    }
  }
  return most_lsb / bundle.accel_scale_lsb_per_g;
}

// Counts of one axis in the vibrations that drive it by so much and show it; empty where none does.
std::vector<std::size_t> driven_histogram(const Bundle& bundle, const CleanSamples& clean,
                                          std::size_t axis) {
  std::vector<std::size_t> histogram;
  for (const Segment& segment : bundle.segments) {
    if (!segment.vibration || !crest_is_spread(segment, bundle.rate_hz)) {
      continue;
    }
    const Eigen::Vector3d along = segment.rotation * segment.vibration->direction_lab;
    if (std::abs(along[static_cast<Eigen::Index>(axis)]) * segment.vibration->amplitude_g <
        kDriven_g) {
      continue;
    }
    histogram.resize(4096 + 2, 0);
    for (std::size_t i = segment.first_sample; i < segment.first_sample + segment.samples; ++i) {
      if ((clean.flags[i] & kSampleWrapped) == 0) {
        ++histogram[bin_of(clean.samples[i][axis])];
      }
    }
  }
  return histogram;
}

// A plateau: the largest value of an axis, stored many times, while its neighbours are nearly
// empty; inside the record's range and reached in a vibration that should have gone further.
void find_plateau(const std::vector<std::size_t>& histogram, std::size_t axis, bool high,
                  CleanSamples& clean) {
  // A sine piles up at its crest too, spread by noise of about one LSB: five values share it. A
  // plateau holds it all in one value (two, where rounding sits on the edge).
  constexpr std::size_t kLeast = 12;
  constexpr std::size_t kOverInside = 3;
  constexpr int kInside = 16;    // values that follow the two at the edge
  constexpr int kStuckBits = 3;  // LSB: a stuck bit ends the range early
  int edge = high ? kFullScaleHigh : kFullScaleLow;
  const int step = high ? -1 : 1;
  while (edge != 0 && histogram[bin_of(edge)] == 0) {
    edge += step;
  }
  const std::size_t at_edge = histogram[bin_of(edge)];
  if (std::abs(edge) >= kFullScaleHigh - kStuckBits) {
    clean.full_scale_samples += at_edge;
    return;
  }
  std::size_t inside = 0;
  for (int k = 2; k < 2 + kInside; ++k) {
    inside += histogram[bin_of(edge + k * step)];
  }
  const std::size_t crest = std::max(at_edge, histogram[bin_of(edge + step)]);
  if (crest >= kLeast && crest > kOverInside * (inside / 4 + 1)) {
    clean.saturated = true;
    clean.plateau_lsb[axis][high ? 1 : 0] = edge;
    clean.plateau_samples += at_edge;
  }
}

void mark_clipped(CleanSamples& clean) {
  for (std::size_t i = 0; i < clean.samples.size(); ++i) {
    const bool wrapped = (clean.flags[i] & kSampleWrapped) != 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int value = clean.samples[i][axis];
      const auto& [low, high] = clean.plateau_lsb[axis];
      const bool at_limit = !wrapped && std::abs(value) >= kFullScaleHigh;
      const bool on_plateau = (high > 0 && value >= high - 1) || (low < 0 && value <= low + 1);
      if (at_limit || on_plateau) {
        clean.flags[i] |= kSampleClipped;
      }
    }
  }
}

}  // namespace

std::size_t CleanSamples::count_usable(std::size_t first, std::size_t count) const {
  std::size_t good = 0;
  for (std::size_t i = first; i < first + count; ++i) {
    good += usable(i) ? 1 : 0;
  }
  return good;
}

double CleanSamples::mean_mg(std::size_t first, std::size_t count, std::size_t axis) const {
  double sum = 0;
  for (std::size_t i = first; i < first + count; ++i) {
    sum += usable(i) ? value_mg(i, axis) : 0;
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, count_usable(first, count)));
}

CleanSamples clean_samples(const Bundle& bundle) {
  CleanSamples clean;
  clean.samples = bundle.samples;
  clean.accel_scale_lsb_per_g = bundle.accel_scale_lsb_per_g;
  clean.flags.assign(bundle.samples.size(), kSampleGood);
  find_runs(bundle, clean);
  find_axes(bundle, clean);
  undo_wrap(bundle, clean);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (const auto histogram = driven_histogram(bundle, clean, axis); !histogram.empty()) {
      find_plateau(histogram, axis, false, clean);
      find_plateau(histogram, axis, true, clean);
    }
  }
  clean.driven_g = driven_g(bundle);
  mark_clipped(clean);
  return clean;
}

}  // namespace sixpoint::gap

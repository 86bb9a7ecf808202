#include "gap/clean.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sixpoint::gap {
namespace {

using gt3x::Counts;

constexpr std::size_t kZeroRun = 10;  // all three axes zero ten times over: no pose does that
constexpr int kFullScaleLow = -2048;  // the stored number's 12 bits
constexpr int kFullScaleHigh = 2047;

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

double median_of(std::vector<int>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
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

void find_axes(const Bundle& bundle, CleanSamples& clean) {
  std::vector<Eigen::Vector3d> seen;
  std::vector<Eigen::Vector3d> expected;
  std::vector<int> values;
  for (const Segment& segment : bundle.segments) {
    if (segment.kind == Segment::Kind::vibration) {
      continue;
    }
    Eigen::Vector3d median;
    bool enough = true;
    const std::size_t stride = std::max<std::size_t>(1, segment.samples / 500);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      values.clear();
      for (std::size_t i = 0; i < segment.samples; i += stride) {
        const std::size_t n = segment.first_sample + i;
        if ((clean.flags[n] & (kSampleZero | kSampleHeld)) == 0) {
          values.push_back(bundle.samples[n][axis]);
        }
      }
      enough = enough && values.size() >= 20;
      median[static_cast<Eigen::Index>(axis)] =
          enough ? median_of(values) / bundle.accel_scale_lsb_per_g : 0;
    }
    if (enough) {
      seen.push_back(median);
      expected.push_back(bundle.gravity_in_sensor(segment));
    }
  }
  if (seen.empty()) {
    return;
  }
  const auto cost = [&](const Eigen::Matrix3i& m) {
    double sum = 0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      sum += (seen[i] - m.cast<double>() * expected[i]).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(seen.size()));
  };
  const Eigen::Matrix3i identity = Eigen::Matrix3i::Identity();
  const double as_is = cost(identity);
  double best = as_is;
  double second = std::numeric_limits<double>::max();
  Eigen::Matrix3i chosen = identity;
  for (const Eigen::Matrix3i& m : signed_permutations()) {
    if (m == identity) {
      continue;
    }
    const double c = cost(m);
    if (c < best) {
      second = best;
      best = c;
      chosen = m;
    } else {
      second = std::min(second, c);
    }
  }
  // Neighbouring permutations differ by more than 0.8 g rms over six poses; offsets and gains of a
  // wrong filter mode reach 0.3 g.
  clean.axes_decidable = second - best > 0.25;
  clean.axes_gain_g = as_is - best;
  clean.pose_error_g = as_is;
  if (chosen != identity && clean.axes_gain_g > 0.25 && best < 0.45) {
    clean.axes_turned = true;
    clean.axis_matrix = chosen;
    clean.pose_error_g = best;
    const Eigen::Matrix3i back = chosen.transpose();
    for (Counts& sample : clean.samples) {
      const Eigen::Vector3i right = back * Eigen::Vector3i(sample[0], sample[1], sample[2]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        sample[axis] = static_cast<std::int16_t>(
            std::clamp(right[static_cast<Eigen::Index>(axis)], -32768, 32767));
      }
    }
  }
}

// Overflow modulo 4096 jumps by most of the range between neighbours of one vibration; a tone of
// less than 100 Hz * A can't. Only where the protocol drives the axis beyond full scale.
void undo_wrap(const Bundle& bundle, CleanSamples& clean) {
  for (const Segment& segment : bundle.segments) {
    if (!segment.vibration) {
      continue;
    }
    const Eigen::Vector3d along = segment.rotation * segment.vibration->direction_lab;
    const Eigen::Vector3d rest = bundle.gravity_in_sensor(segment);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto e = static_cast<Eigen::Index>(axis);
      const double peak_lsb =
          (std::abs(along[e]) * segment.vibration->amplitude_g + std::abs(rest[e])) *
          bundle.accel_scale_lsb_per_g;
      if (peak_lsb < 0.75 * kFullScaleHigh) {
        continue;
      }
      // A wrapped sample lies far on the wrong side of where its known tone has it. Gain and offset
      // come from the samples inside +-1200 LSB whose neighbours are there too; phase by scanning.
      const double w = 2 * M_PI * segment.vibration->frequency_hz / bundle.rate_hz;
      const double amplitude =
          along[e] * segment.vibration->amplitude_g * bundle.accel_scale_lsb_per_g;
      const double level = rest[e] * bundle.accel_scale_lsb_per_g;
      const std::size_t n = segment.samples;
      const auto at = [&](std::size_t i) {
        return static_cast<double>(clean.samples[segment.first_sample + i][axis]);
      };
      // Compare on the circle of 4096: blind to whether the number wrapped.
      const auto misfit = [&](double gain, double phase, std::size_t first, std::size_t last) {
        double sum = 0;
        for (std::size_t i = first; i < last; ++i) {
          const double predicted =
              gain * (level + amplitude * std::cos(w * static_cast<double>(i) + phase));
          const double d = std::remainder(at(i) - predicted, 4096.0);
          sum += d * d;
        }
        return sum / static_cast<double>(last - first);
      };
      constexpr std::size_t kPiece = 50;  // short enough that a slip of the clock spoils few pieces
      for (std::size_t first = 0; first + kPiece <= n; first += kPiece) {
        double best_phase = 0;
        double best_gain = 1;
        double best = std::numeric_limits<double>::max();
        for (const double gain : {1.0, 0.95, 0.9, 0.85, 0.8}) {  // down to a filter mismatch's
          for (int step = 0; step < 60; ++step) {
            const double phase = step * M_PI / 30;
            const double c = misfit(gain, phase, first, first + kPiece);
            if (c < best) {
              best = c;
              best_phase = phase;
              best_gain = gain;
            }
          }
        }
        if (std::sqrt(best) > 250) {
          continue;
        }
        const std::size_t last = first + 2 * kPiece > n ? n : first + kPiece;
        for (std::size_t i = first; i < last; ++i) {
          const double predicted =
              best_gain * (level + amplitude * std::cos(w * static_cast<double>(i) + best_phase));
          const double turns = std::round((predicted - at(i)) / 4096);
          if (turns != 0 && std::abs(at(i)) < kFullScaleHigh) {
            const double value = at(i) + 4096 * turns;
            clean.samples[segment.first_sample + i][axis] = static_cast<std::int16_t>(value);
            clean.flags[segment.first_sample + i] |= kSampleWrapped;
            ++clean.wrapped_samples;
          }
        }
      }
    }
  }
}

// A plateau: the largest value of an axis, held by many samples, while its neighbours are nearly
// empty; inside the record's range and reached in a vibration that should have gone further.
void find_plateaus(const Bundle& bundle, CleanSamples& clean) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<std::size_t> histogram(4096 + 2, 0);
    bool any = false;
    for (const Segment& segment : bundle.segments) {
      if (!segment.vibration) {
        continue;
      }
      const Eigen::Vector3d along = segment.rotation * segment.vibration->direction_lab;
      if (std::abs(along[static_cast<Eigen::Index>(axis)]) * segment.vibration->amplitude_g < 2) {
        continue;
      }
      any = true;
      for (std::size_t i = segment.first_sample; i < segment.first_sample + segment.samples; ++i) {
        if ((clean.flags[i] & kSampleWrapped) == 0) {
          const int value =
              std::clamp<int>(bundle.samples.empty() ? 0 : clean.samples[i][axis], -2048, 2047);
          ++histogram[static_cast<std::size_t>(value + 2048)];
        }
      }
    }
    if (!any) {
      continue;
    }
    for (std::size_t end = 0; end < 2; ++end) {
      const bool high = end == 1;
      int edge = high ? kFullScaleHigh : kFullScaleLow;
      const int step = high ? -1 : 1;
      while (edge != 0 && histogram[static_cast<std::size_t>(edge + 2048)] == 0) {
        edge += step;
      }
      const std::size_t at_edge = histogram[static_cast<std::size_t>(edge + 2048)];
      const std::size_t before = histogram[static_cast<std::size_t>(edge + step + 2048)];
      std::size_t inside = 0;  // the next 16 values
      for (int k = 2; k < 18; ++k) {
        inside +=
            histogram[static_cast<std::size_t>(std::clamp(edge + k * step, -2048, 2047) + 2048)];
      }
      const bool full_scale = edge == kFullScaleHigh || edge == kFullScaleLow;
      if (full_scale) {
        clean.full_scale_samples += at_edge;
        continue;
      }
      // A sine piles up at its crest too, spread by noise of about one LSB: five values share it. A
      // plateau holds it all in one value (two, where rounding sits on the edge).
      const std::size_t crest = std::max(at_edge, before);
      if (crest >= 12 && crest > 3 * (inside / 4 + 1)) {
        clean.saturated = true;
        clean.plateau_lsb[axis][end] = edge;
        clean.plateau_samples += at_edge;
      }
    }
  }
  for (std::size_t i = 0; i < clean.samples.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int value = clean.samples[i][axis];
      const auto& plateau = clean.plateau_lsb[axis];
      const bool wrapped = (clean.flags[i] & kSampleWrapped) != 0;
      const bool at_limit = !wrapped && (value <= kFullScaleLow || value == kFullScaleHigh);
      const bool on_plateau = clean.saturated && ((plateau[1] > 0 && value >= plateau[1] - 1) ||
                                                  (plateau[0] < 0 && value <= plateau[0] + 1));
      if (at_limit || on_plateau) {
        clean.flags[i] |= kSampleClipped;
      }
    }
  }
}

}  // namespace

CleanSamples clean_samples(const Bundle& bundle) {
  CleanSamples clean;
  clean.samples = bundle.samples;
  clean.flags.assign(bundle.samples.size(), kSampleGood);
  find_runs(bundle, clean);
  find_axes(bundle, clean);
  undo_wrap(bundle, clean);
  find_plateaus(bundle, clean);
  return clean;
}

}  // namespace sixpoint::gap

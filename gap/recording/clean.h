// Discrete effects are found and undone in the samples first, before anything is averaged.
//
//   const CleanSamples clean = clean_samples(bundle);
//   double sum_mg = 0;
//   for (std::size_t i = 0; i < clean.samples.size(); ++i) {
//     if (clean.usable(i)) sum_mg += clean.value_mg(i, 2);  // axis Z
//   }
//
// A turned axis, a stretch of zeros or a held value ruins every mean that contains it, and none of
// them needs a fit: each leaves marks that noise cannot make. Turned axes and wraps are undone
// here; zeros, held and clipped samples are masked.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "gap/recording/bundle.h"

namespace sixpoint::gap {

// So many samples of zero on all axes are a run of zeros: no pose has them.
inline constexpr std::size_t kZeroRun = 10;

enum SampleFlag : std::uint8_t {
  kSampleGood = 0,
  kSampleZero = 1,      // within a run of zeros on all axes
  kSampleHeld = 2,      // within a run that repeats one value exactly
  kSampleClipped = 4,   // an axis at the end of its range, or on the plateau of a saturation
  kSampleWrapped = 8,   // an axis came back by 4096 LSB; undone in the samples
  kSampleSlipped = 16,  // within a second that lacks samples or has some twice
};

// Samples are missing, or are there twice, somewhere in [first, last).
struct ClockSlip {
  std::size_t first = 0;
  std::size_t last = 0;
  int lost = 0;  // negative: there twice
};

struct RunTally {
  std::size_t runs = 0;
  std::size_t samples = 0;
  std::vector<std::size_t> segments;  // in which they lie, ascending
};

struct CleanSamples {
  std::vector<gt3x::Counts> samples;  // axes turned back, wraps undone
  std::vector<std::uint8_t> flags;    // SampleFlag, one per sample
  double accel_scale_lsb_per_g = 256;

  bool usable(std::size_t i) const {
    return (flags[i] & (kSampleZero | kSampleHeld | kSampleClipped)) == 0;
  }
  // Usable, and at its place by the clock of `slips`.
  bool in_step(std::size_t i) const { return usable(i) && (flags[i] & kSampleSlipped) == 0; }
  double value_mg(std::size_t i, std::size_t axis) const {
    return 1000.0 * samples[i][axis] / accel_scale_lsb_per_g;
  }
  // Of `count` samples from `first` on: how many are usable, and their mean; 0 where none is.
  std::size_t count_usable(std::size_t first, std::size_t count) const;
  double mean_mg(std::size_t first, std::size_t count, std::size_t axis) const;

  // | another signed permutation is clearly better | and clearly the best  | axes        |
  // |----------------------------------------------|-----------------------|-------------|
  // | no                                           | either                | as they are |
  // | yes                                          | no (`axes_decidable`) | as they are |
  // | yes                                          | yes                   | turned back |
  bool axes_turned = false;
  Eigen::Matrix3i axis_matrix = Eigen::Matrix3i::Identity();  // maps the right axes to the stored
  // How much worse, in g rms over the poses, the untouched axes fit than the best signed
  // permutation.
  double axes_gain_g = 0;
  bool axes_decidable = false;  // no two signed permutations fit the poses alike
  // Mean distance, in g, of the poses from what the protocol says, axes as decided.
  double pose_error_g = 0;

  RunTally zeros;  // kZeroRun samples and more
  RunTally held;   // a second and more of one value, not zero
  RunTally stuck;  // runs of one value shorter than that, longer than chance allows
  std::size_t wrapped_samples = 0;

  // Values that pile up at one end of an axis inside the record's range.
  bool saturated = false;
  std::array<std::array<double, 2>, 3> plateau_lsb{};  // per axis low, high; 0 where none
  std::size_t plateau_samples = 0;
  std::size_t full_scale_samples = 0;  // at the record's own limits: nothing wrong
  double driven_g = 0;  // the furthest that a vibration of 2 g and more drives an axis in its range

  std::vector<ClockSlip> slips;  // ascending; set by mark_slips() (gap/features/timing.h)
};

CleanSamples clean_samples(const Bundle& bundle);

}  // namespace sixpoint::gap

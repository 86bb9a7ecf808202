// What the unit made of each tone of the shaker: level, amplitude, harmonics per axis, slips of the
// sample clock inside it, and what scatter the tone adds to the noise.
//
//   ToneOptions options;
//   options.clock_ppm = host_timing(bundle).clock_ppm;  // timing.h
//   for (const ToneFit& tone : fit_tones(bundle, clean, options)) {
//     const double amplitude_mg = tone.in_phase_mg[tone.axis];
//   }
//
// Sinusoids of known frequency are fitted by least squares to the samples that are not masked
// (a clipped sample is censored, not wrong). The phase at the start is unknown; amplitudes are
// those in phase with the axis that the shaker moves most. Where samples were lost or repeated the
// phase steps by whole sample intervals, forward or backward: steps are found by binary
// segmentation on exact prefix sums.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "gap/features/lines.h"
#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

struct Slip {
  std::size_t sample = 0;  // in the segment
  int steps = 0;           // positive: samples lost; 0: a step that is no whole number of samples
};

struct ToneFit {
  std::size_t segment = 0;
  int axis = 0;  // moved most
  bool usable = false;
  std::size_t samples = 0;  // unmasked
  double clipped_share = 0;
  Eigen::Vector3d level_mg = Eigen::Vector3d::Zero();
  Eigen::Vector3d in_phase_mg = Eigen::Vector3d::Zero();
  Eigen::Vector3d quadrature_mg = Eigen::Vector3d::Zero();  // of the other axes; 0 on `axis`
  double second_mg = 0;                                     // cos 2p and cos 3p on `axis`
  double third_mg = 0;
  // (level, in_phase, second, third) on `axis`: inverse normal matrix, to be multiplied by the
  // noise's variance; and (level, in_phase) of the other axes.
  Eigen::Matrix4d covariance_shape = Eigen::Matrix4d::Zero();
  Eigen::Matrix2d cross_shape = Eigen::Matrix2d::Zero();
  // Variance per axis that spectral lines add to what is found at the tone's frequency and at its
  // second and third harmonic: their phase is not known.
  std::array<Eigen::Vector3d, 3> line_mg2{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                          Eigen::Vector3d::Zero()};
  double residual_mg = 0;  // rms on `axis`
  // Squared residuals weighted by sin^2 p (slope) and cos^2 p (crest), mg^2, and 1 sd of either for
  // white residuals: jitter shows on slopes, a noisy gain on crests.
  // Of `samples_apart`, those that are not beside a slip or at an end.
  double on_slope_mg2 = 0;
  double on_crest_mg2 = 0;
  std::size_t samples_apart = 0;
  double frequency_ppm = 0;  // of the tone against the protocol, clock's error not taken out
  double frequency_sd_ppm = 0;
  std::vector<Slip> slips;
};

struct ToneOptions {
  double clock_ppm = 0;                           // from the host's clock
  std::array<double, 3> noise_mg{4.1, 4.1, 5.6};  // of one sample, rounding included
  std::vector<SpectralLine> lines = {};           // that go through the tones, too
};

// One per segment of kind vibration, in order.
std::vector<ToneFit> fit_tones(const Bundle& bundle, const CleanSamples& clean,
                               const ToneOptions& options);

}  // namespace sixpoint::gap

// Lines in the spectrum of still records, and their frame: fixed in the laboratory or the sensor.
//
//   const auto found = gap::find_lines(bundle, clean, gap::noise_spectrum(bundle, clean));
//   found.lines;      // strongest first
//   found.bound_mg;  // a line of that length is found half of the time
//
// A line that turns with the unit (a vector fixed in the sensor's frame) is electrical; one whose
// direction stays in the room is vibration of the floor. Two cases are tried in each frame: every
// dwell has a phase of its own, or the dwells of some minutes keep it by the host's clock, which
// shows the frame of a line that drowns in each dwell. All have the same number of unknowns, and
// their likelihoods, averaged over the phases, are compared directly. A second or third harmonic
// goes with the stronger line that it belongs to.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "gap/features/noise.h"
#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

struct SpectralLine {
  double frequency_hz = 0;
  double gain_nats = 0;             // log likelihood over no line, the better hypothesis
  double averaged_nats = 0;         // the same, averaged over the phases that are free
  double lab_over_sensor_nats = 0;  // positive: fixed in the laboratory
  bool in_lab = true;
  bool decidable = false;  // the poses differ, and the data prefer one frame clearly
  Eigen::Vector3d vector_mg = Eigen::Vector3d::Zero();  // in the frame chosen
  double sd_mg = 0;
  // Chi-square per degree of freedom of the dwells about the chosen hypothesis, in sd: a line that
  // comes and goes, or that neither frame holds.
  double misfit_sd = 0;
  // Log predictive likelihood over no line: each half of the poses from the vector of the other.
  double held_out_nats = 0;
  // How much likelier a vector of its own for each half of the poses is than one for both.
  double apart_nats = 0;
};

struct FoundLines {
  std::vector<SpectralLine> lines;  // strongest first, at most eight
  // Length of the vector at which a line is found half of the time; none without records at rest.
  std::optional<double> bound_mg;
};

// What a strong line spreads about itself is none.
FoundLines find_lines(const Bundle& bundle, const CleanSamples& clean, const NoiseSpectrum& noise);

}  // namespace sixpoint::gap

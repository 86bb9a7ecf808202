// How much of a line there is at each frequency of the records at rest, for lines.cpp only.
//
//   const std::vector<Stretch> all = stretches(bundle, clean);
//   const LineScan scan = scan_in_step(bundle.rate_hz, all, noise);
//   scan.nats;  // one per frequency, scan.step_hz apart
//   shown_line_mg(scan, 17, {16, 16, 30});  // 17 nats half of the time, from that size on
#pragma once

#include <vector>

#include "gap/features/noise.h"
#include "gap/recording/at_rest.h"

namespace sixpoint::gap {

struct LineScan {
  std::vector<double> nats;  // -log of the chance, per frequency
  double step_hz = 0;
  // What it was made of: how many stretches whose phases are not known to each other, and how many
  // samples in all.
  std::size_t stretches = 0;
  double samples = 0;
};

// The largest eigenvalue of the dwells' outer products, turned back into the laboratory or left in
// the sensor. A line has one direction, noise all three; how much that gains on the sum of powers
// was not measured. Without a line the matrix follows Wishart's law.
LineScan scan_powers(double rate_hz, const std::vector<const Stretch*>& set,
                     const NoiseSpectrum& noise);

// Where no long record is, dwells within some minutes are summed with the phases that one line
// would have by the host's clock: in eighteen dwells that shows a line of 0.65 to 0.8 of the size
// that their powers show. Maximum likelihood per frequency: b' A^-1 b with b the sum of the dwells'
// weighted spectra, each turned into the frame, and A its covariance. Noise gives it a gamma law of
// shape 3.
LineScan scan_in_step(double rate_hz, const std::vector<Stretch>& all, const NoiseSpectrum& noise);

// Length of a line's vector at which the scan has these nats half of the time: of any direction,
// beside noise of this variance per axis. The largest eigenvalue of Wishart's law with one
// direction that has more (Baik and Silverstein 2006, equation 1.10).
double shown_line_mg(const LineScan& scan, double nats, const Eigen::Vector3d& noise_mg2);

}  // namespace sixpoint::gap

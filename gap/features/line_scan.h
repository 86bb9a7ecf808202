// How much of a line there is at each frequency of the records at rest, for lines.cpp only.
//
//   const std::vector<Stretch> all = stretches(bundle, clean);
//   const LineScan scan = scan_in_step(bundle.rate_hz, all, noise);
//   scan.nats;  // one per frequency, scan.step_hz apart
#pragma once

#include <vector>

#include "gap/features/noise.h"
#include "gap/recording/at_rest.h"

namespace sixpoint::gap {

struct LineScan {
  std::vector<double> nats;  // -log of the chance, per frequency
  double step_hz = 0;
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

}  // namespace sixpoint::gap

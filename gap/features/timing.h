// What the host's clock says about the unit's: its rate, and lost or repeated samples.
//
//   const HostTiming timing = host_timing(bundle);
//   if (timing.usable) {
//     std::cout << timing.clock_ppm << " ppm, " << timing.lost << " samples are lost\n";
//   }
//
// The host stamps each one-second packet within +-2 ms, uniform. Inside a segment the stamps grow
// by (samples) / (rate * (1 + error)); a lost sample moves all later stamps by one sample interval
// forward, a repeated one backward. An interval of 8 ms and more exceeds what two stamps can be
// wrong together, so that every slip is read off exactly.
#pragma once

#include <cstddef>
#include <vector>

#include "gap/recording/bundle.h"
#include "gap/recording/clean.h"

namespace sixpoint::gap {

inline constexpr double kHostStamp_s = 0.002;  // half width of the host's error

struct HostTiming {
  bool usable = false;         // at least three packets in one segment
  bool slips_visible = false;  // the sample interval exceeds the stamps' errors
  double clock_ppm = 0;        // positive: the sample clock runs fast
  double clock_sd_ppm = 0;
  double clock_held_out_nats = 0;  // each half of the segments predicted from the rate of the other
  std::size_t lost = 0;            // samples, summed over packets that miss some
  std::size_t repeated = 0;
  std::vector<ClockSlip> slips;  // where, ascending
  std::size_t packets = 0;       // pairs of stamps looked at
  std::size_t samples = 0;       // between them
  double scatter_ms = 0;         // rms of the stamps about the line, slips taken out
};

HostTiming host_timing(const Bundle& bundle);

// Tells `clean` where samples are lost or repeated, so that what needs their times knows them.
// Wraps there are not counted: without its time a tone doesn't say where a sample should be. Once.
void mark_slips(const HostTiming& timing, CleanSamples& clean);

}  // namespace sixpoint::gap

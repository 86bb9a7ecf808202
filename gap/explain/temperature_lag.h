// The unit's temperature where no log says it: it follows the commanded one with a lag.
//
//   const double lag_s = likeliest_lag_s(bundle, blocks, {.lsb_mg = 3.9});
//   bundle.temperature = following_temperature(bundle, lag_s);  // then make the blocks again
//
// A unit in a chamber takes on its temperature as a body of one time constant does (Newton's law of
// cooling): dT/dt = (commanded - T) / lag, from the commanded temperature at the start on. Without
// the lag what is warm on the way down and cold on the way up looks like an effect of time. Between
// two segments the chamber is taken to be on its way to the later one's start.
//
// Pure functions. Units: s, C.
#pragma once

#include <vector>

#include "gap/explain/evidence.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

// Every ten seconds of host time, from the first segment's start to the last one's end, of thirty
// days at most.
TemperatureLog following_temperature(const Bundle& bundle, double lag_s);

// The lag with which temperature explains the blocks best, beside the other effects of the means
// that every unit has a little of. 0 where the bundle has a log, where the commanded temperature
// does not change by 2 C, where the bundle lasts for more than thirty days, or where no lag is twenty
// times as likely as none.
double likeliest_lag_s(const Bundle& bundle, std::vector<Block> blocks,
                       const EvidenceOptions& options);

}  // namespace sixpoint::gap

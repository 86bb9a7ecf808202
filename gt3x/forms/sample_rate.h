// The rate of a recording's samples, for everything that cannot do without one.
//
//   SIXPOINT_ASSIGN(const double rate_hz, usable_sample_rate_hz(info, "07.gt3x"));
//   SIXPOINT_ASSIGN(const double slow_hz, usable_sample_rate_hz(info, "07.gt3x", 1'000));
#pragma once

#include <string>

#include "base/result.h"
#include "gt3x/forms/info.h"

namespace sixpoint::gt3x {

// The "Sample Rate" of info.txt. bad_data, with `path` as the place, where there is none, where it
// is no number, and outside 1 to `most_hz`: the message holds what stands there.
Result<double> usable_sample_rate_hz(const Info& info, const std::string& path,
                                     double most_hz = 10'000);

}  // namespace sixpoint::gt3x

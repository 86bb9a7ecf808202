// Where a recording's header and the protocol contradict each other, the samples decide.
//
//   HeaderClaims claims;
//   claims.scales = {{"info.txt", 256}};
//   claims.rate_hz = 100;
//   SIXPOINT_CHECK(check_header(claims, bundle));
//
// Headers are copied, and protocols are written by hand: each can be wrong. The length of gravity
// at rest decides on the scale; the host's stamps, else the number of samples in a record of one
// second, decide on the rate.
//
// | samples agree with            | answer                                       |
// |-------------------------------|----------------------------------------------|
// | the protocol                  | the header is set aside; a line of `losses`  |
// | the header, or none of them   | bad_data: the protocol must be corrected     |
// | (scale) can't decide          | the protocol is used; a line of `losses`     |
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

struct HeaderClaims {
  struct Scale {
    std::string source;  // "info.txt" or "PARAMETERS"
    double lsb_per_g = 0;
  };
  std::vector<Scale> scales;
  std::optional<double> rate_hz;             // of info.txt
  std::optional<double> samples_per_record;  // of most records of one second
};

// Adds to the bundle's losses. Wants the segments, the samples and the host's clock.
Status check_header(const HeaderClaims& claims, Bundle& bundle);

}  // namespace sixpoint::gap

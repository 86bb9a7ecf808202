// Where a recording's header and the protocol contradict each other, the samples decide.
//
// Headers are copied, and protocols are written by hand: neither is believed blindly. A scale is
// weighed by the length of gravity at rest, a sample rate by the host's stamps and by how many
// samples a record of one second holds. Where the samples bear out the protocol, the header lies
// and that is said; where they bear out the header, or nobody, a diagnosis would explain a clerk's
// mistake by physics, and is refused.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "gap/bundle.h"

namespace sixpoint::gap {

struct HeaderClaims {
  struct Scale {
    std::string source;  // "info.txt" or "PARAMETERS"
    double lsb_per_g = 0;
  };
  std::vector<Scale> scales;
  std::optional<double> rate_hz;             // of info.txt
  std::optional<double> samples_per_record;  // that most records of one second hold
};

// Adds to the bundle's losses. Wants the segments, the samples and the host's clock; bad_data where
// the protocol's scale or rate is contradicted and not borne out.
Status weigh_header(const HeaderClaims& claims, Bundle& bundle);

}  // namespace sixpoint::gap

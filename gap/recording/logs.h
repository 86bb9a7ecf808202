// The two logs of a bundle: the unit's temperature, and when the host received its packets.
//
//   read_temperature(files, "bundle/temperature.csv", bundle);
//   read_host_clock(files, "bundle/host_clock.csv", bundle);
//   check_logs(bundle);
//   bundle.losses;  // what is missing, in words
//
// A log that is missing, cut or of another recording is no error: it becomes a line of the bundle's
// losses.
#pragma once

#include <string>

#include "gap/recording/bundle.h"

namespace sixpoint::gap {

// Both want the bundle's segments and samples.
void read_temperature(FileSystem& files, const std::string& path, Bundle& bundle);
void read_host_clock(FileSystem& files, const std::string& path, Bundle& bundle);

// After header_evidence.h has decided on the rate: leaves out a host clock of other times than the
// protocol's, and notes which segments the logs do not cover.
void check_logs(Bundle& bundle);

}  // namespace sixpoint::gap

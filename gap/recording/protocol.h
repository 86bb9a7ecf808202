// protocol.json of a bundle: what was done with the unit, segment by segment.
//
//   Bundle bundle;
//   SIXPOINT_CHECK(read_protocol(files, "bundle/protocol.json", bundle));
//   bundle.segments.front().rotation;  // how the unit lay
#pragma once

#include <string>

#include "base/result.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

// Sets rate, scale, gravity, serial and segments, their poses and placements numbered. bad_data as
// read_bundle(); whether the recording holds all samples of the segments is not checked here.
Status read_protocol(FileSystem& files, const std::string& path, Bundle& bundle);

}  // namespace sixpoint::gap

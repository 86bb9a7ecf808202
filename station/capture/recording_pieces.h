// Several recordings of one unit as one file, for a capture that was interrupted.
#pragma once

#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::station {

// The records of `pieces`, one behind the other and byte for byte, under the first one's info.txt
// with the last one's times of its end. `output` appears whole or not at all. bad_data where they
// are not of one unit.
Status join_recordings(FileSystem& files, const std::vector<std::string>& pieces,
                       const std::string& output);

}  // namespace sixpoint::station

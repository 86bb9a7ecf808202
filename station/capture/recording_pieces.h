// Joins several recordings of one unit into one file, for a capture that was interrupted.
//
//   SIXPOINT_CHECK(join_recordings(env.files, {"c-1.gt3x", "c-2.gt3x"}, "c.gt3x"));
#pragma once

#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::station {

// Of piece `number` of a capture: "c.gt3x" and 2 are "c-2.gt3x".
std::string piece_name(const std::string& output, std::size_t number);

// `output` has the records of `pieces` in order, byte for byte, and the info.txt of the first piece
// with the end times of the last. It appears whole or not at all. bad_data where the pieces are not
// of one unit.
Status join_recordings(FileSystem& files, const std::vector<std::string>& pieces,
                       const std::string& output);

}  // namespace sixpoint::station

// Whether an output stays in the output folder.
//
//   SIXPOINT_CHECK(check_output_place(files, "repaired", "repaired/site/day1.gt3x"));
//
// A symbolic link below the output folder may lead elsewhere, for example among the originals:
//
// | the folder that will hold the output, without links | answer        |
// |-----------------------------------------------------|---------------|
// | is the output folder, or lies below it              | nothing       |
// | lies elsewhere                                      | cannot_create |
#pragma once

#include <string>

#include "base/env.h"

namespace sixpoint::repair {

// The part of `path` that is there, without links, and the rest as it is written.
std::string real_place(FileSystem& files, const std::string& path);

// One file by whatever path it is named, from whatever folder: its folder as real_place() has it,
// and its own name. A name that is itself a link is a file of its own.
std::string place_of(FileSystem& files, const std::string& path);

// Asked before each output is written. `output`: a name below `folder`.
Status check_output_place(FileSystem& files, const std::string& folder, const std::string& output);

}  // namespace sixpoint::repair

// Folders and files that hold a record of this program, into which no results are written: a bundle,
// the plan of an archive.
//
//   if (is_bundle(env.files, "jig-7") || is_plan(env.files, "jig-7")) {
//     // another folder is to be chosen
//   }
#pragma once

#include <string>
#include <string_view>

#include "base/env.h"

namespace sixpoint::repair {

bool is_bundle(FileSystem& files, const std::string& folder);
bool is_plan(FileSystem& files, const std::string& folder);

// Up to 4 KiB of a file, from its beginning: what kind of file it is. Nothing where it cannot be
// read.
std::string beginning_of(FileSystem& files, const std::string& path);
// Whether so a document begins whose `schema` is "sixpoint/NAME/...".
bool has_schema(std::string_view beginning, std::string_view name);

}  // namespace sixpoint::repair

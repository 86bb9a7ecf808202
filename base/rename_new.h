// A rename that replaces nothing, for the real disk (FileSystem::rename_new() is the way in).
//
//   const int error = rename_new(".plant.jsonl.0.tmp", "plant.jsonl");  // 0, or an errno: EEXIST
//
// One call of the kernel where the file system knows it (renameat2). A file system that does not
// (some network and overlay ones) gets a second name for the file and loses the first one: link()
// refuses a name that is taken, too.
#pragma once

#include <string>

namespace sixpoint {

int rename_new(const std::string& from, const std::string& to);
// The second way, for rename_new() and its test. A power cut between its two steps leaves both
// names, which are one file.
int rename_new_by_link(const std::string& from, const std::string& to);

}  // namespace sixpoint

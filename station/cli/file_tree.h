// Files and folders on a command line become a list of files.
#pragma once

#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::cli {

struct FoundFile {
  std::string path;
  std::string relative;  // to the folder that was named; the file's name where a file was named
};

// A file that is named is taken whatever its name; of a folder, everything below it whose name ends
// in one of `endings` (compared without regard to case), sorted. no_input for what is not there.
Result<std::vector<FoundFile>> find_files(FileSystem& files, const std::string& path,
                                          const std::vector<std::string>& endings);

bool has_ending(const std::string& path, const std::string& ending);

}  // namespace sixpoint::cli

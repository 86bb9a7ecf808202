// The files that a person names, one by one or as folders.
//
//   const NamedFiles named = named_files(env.files, {"a.gt3x", "archive"}, {".gt3x"});
//   for (const NamedFile& file : named.files) {
//     std::cout << file.path << (file.error ? " cannot be used\n" : "\n");
//   }
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "repair/triage/file_tree.h"

namespace sixpoint::repair {

// A file that was named, or one below a folder that was named.
struct NamedFile : FoundFile {
  std::optional<Error> error;  // why it cannot be used; `relative` is then empty
};

struct NamedFiles {
  std::vector<NamedFile> files;            // in the order of the paths; each place_of() once
  std::vector<std::string> empty_folders;  // without a file of these endings
};
NamedFiles named_files(FileSystem& files, const std::vector<std::string>& paths,
                       const std::vector<std::string>& endings);

// Two inputs must not have one output: the second one gets an error.
void refuse_same_outputs(std::vector<NamedFile>& files, const std::string& folder);

}  // namespace sixpoint::repair

// Files and folders that a user names become a list of recordings.
//
//   FileTreeOptions options;
//   options.endings = {".gt3x", ".agdc"};
//   SIXPOINT_ASSIGN(const FileTree tree, find_files(files, "/data/archive", options));
//   for (const FoundFile& file : tree.files) {
//     std::cout << file.relative << '\n';
//   }
//
// A tree is walked without ever following a symbolic link to a folder that was walked already, so
// links that lead back up, or to one another, end. What lies really in the tree is found first,
// under its own name; then what links lead to.
#pragma once

#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::repair {

struct FoundFile {
  std::string path;
  std::string relative;  // to the folder that was named; the file's name where a file was named
  std::uint64_t size = 0;
  std::int64_t modified_ns = 0;
};

// A folder that could not be listed, a link that leads nowhere.
struct RefusedPath {
  std::string path;
  Error error;
};

struct FileTreeOptions {
  std::vector<std::string> endings;  // such as ".gt3x", compared without regard to case
  // Also what links lead to outside of the tree. Off for an archive, which is what lies in it.
  bool follow_out = true;
};

struct FileTree {
  std::vector<FoundFile> files;  // sorted by name, folder by folder
  std::vector<RefusedPath> refused;
  std::vector<std::string> not_followed;  // links that lead out of the tree
};

// A file that is named is taken with any name; of a folder, everything below it whose name ends
// in one of the endings, but for "._NAME", which macOS writes beside NAME. no_input where `path` is
// not there.
Result<FileTree> find_files(FileSystem& files, const std::string& path,
                            const FileTreeOptions& options);

// The path without "." and doubled slashes. One that climbs ("..") stays: behind a link that leads
// elsewhere than it looks.
std::string plain_path(const std::string& path);

bool has_ending(const std::string& path, const std::string& ending);

// Does `path` lie in `folder`, or is it `folder`? Both as real_path() writes them.
bool is_inside(const std::string& path, const std::string& folder);

}  // namespace sixpoint::repair

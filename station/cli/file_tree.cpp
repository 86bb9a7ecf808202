#include "station/cli/file_tree.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

namespace sixpoint::cli {
namespace {

// A loop of symbolic links would go on for ever; no archive is this deep.
constexpr int kDeepest = 64;

Status walk(FileSystem& files, const std::string& folder, const std::string& relative,
            const std::vector<std::string>& endings, int depth, std::vector<FoundFile>& found) {
  if (depth > kDeepest) {
    return fail(ErrorCode::bad_data, "the folders are nested more than 64 deep", folder,
                "look for a symbolic link that leads back up");
  }
  SIXPOINT_ASSIGN(const auto names, files.list(folder));
  for (const std::string& name : names) {
    const std::string path = fmt::format("{}/{}", folder, name);
    const std::string below = relative.empty() ? name : fmt::format("{}/{}", relative, name);
    const auto info = files.info(path);
    if (!info) {
      continue;  // a dangling link, or gone since
    }
    if (info->is_folder) {
      SIXPOINT_CHECK(walk(files, path, below, endings, depth + 1, found));
    } else if (std::any_of(endings.begin(), endings.end(),
                           [&](const std::string& ending) { return has_ending(name, ending); })) {
      found.push_back({path, below});
    }
  }
  return {};
}

}  // namespace

bool has_ending(const std::string& path, const std::string& ending) {
  return path.size() >= ending.size() &&
         std::equal(ending.rbegin(), ending.rend(), path.rbegin(), [](char a, char b) {
           return std::tolower(static_cast<unsigned char>(a)) ==
                  std::tolower(static_cast<unsigned char>(b));
         });
}

Result<std::vector<FoundFile>> find_files(FileSystem& files, const std::string& path,
                                          const std::vector<std::string>& endings) {
  SIXPOINT_ASSIGN(const auto info, files.info(path));
  std::vector<FoundFile> found;
  if (!info.is_folder) {
    found.push_back({path, file_name_of(path)});
    return found;
  }
  SIXPOINT_CHECK(walk(files, path, "", endings, 0, found));
  return found;
}

}  // namespace sixpoint::cli

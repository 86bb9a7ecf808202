#include "repair/batch/named_files.h"

#include <map>
#include <set>

#include <fmt/format.h>

#include "repair/rescale/output_place.h"
#include "repair/rescale/repair_report.h"

namespace sixpoint::repair {

NamedFiles named_files(FileSystem& files, const std::vector<std::string>& paths,
                       const std::vector<std::string>& endings) {
  NamedFiles named;
  std::set<std::string> taken;
  const auto refuse = [&](const std::string& path, const Error& error) {
    if (taken.insert(place_of(files, path)).second) {
      named.files.emplace_back().path = path;
      named.files.back().error = error;
    }
  };
  for (const std::string& path : paths) {
    const auto found = find_files(files, path, {endings});
    if (!found) {
      refuse(path, found.error());
      continue;
    }
    for (const RefusedPath& refused : found->refused) {
      refuse(refused.path, refused.error);
    }
    if (found->files.empty()) {
      named.empty_folders.push_back(path);
    }
    for (const FoundFile& file : found->files) {
      if (taken.insert(place_of(files, file.path)).second) {
        named.files.push_back({file, std::nullopt});
      }
    }
  }
  return named;
}

void refuse_same_outputs(std::vector<NamedFile>& files, const std::string& folder) {
  std::map<std::string, std::string> input_of;  // by the name below the output folder
  for (NamedFile& file : files) {
    if (file.error) {
      continue;
    }
    const auto [other, fresh] = input_of.emplace(file.relative, file.path);
    if (!fresh) {
      file.error = Error{ErrorCode::cannot_create,
                         fmt::format("{} would have the same name in {}", other->second, folder),
                         file.path, kSeparateRuns};
    }
  }
}

}  // namespace sixpoint::repair

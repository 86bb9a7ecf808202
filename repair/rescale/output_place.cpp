#include "repair/rescale/output_place.h"

#include <fmt/format.h>

#include "repair/triage/file_tree.h"

namespace sixpoint::repair {

std::string real_place(FileSystem& files, const std::string& path) {
  if (auto real = files.real_path(path)) {
    return *std::move(real);
  }
  const std::string parent = folder_of(path);
  if (parent == path) {
    return path;
  }
  return real_place(files, parent) + "/" + file_name_of(path);
}

std::string place_of(FileSystem& files, const std::string& path) {
  return plain_path(real_place(files, folder_of(path)) + "/" + file_name_of(path));
}

Status check_output_place(FileSystem& files, const std::string& folder, const std::string& output) {
  const std::string place = real_place(files, folder_of(output));
  if (!is_inside(place, real_place(files, folder))) {
    return fail(ErrorCode::cannot_create,
                fmt::format("a link in the output folder leads out of it, to {}", printable(place)),
                output, "remove the link, or choose another output folder");
  }
  return {};
}

}  // namespace sixpoint::repair

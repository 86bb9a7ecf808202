#include "base/env.h"

#include <fmt/format.h>

namespace sixpoint {

Result<std::unique_ptr<FileLock>> FileSystem::lock(const std::string& path) {
  return fail(ErrorCode::io, "this file system has no locks", path, "choose another folder");
}

Status FileSystem::rename_new(const std::string& from, const std::string& to) {
  if (link_info(to)) {
    return fail(ErrorCode::cannot_create, "the file exists", to, "choose another name");
  }
  return rename(from, to);
}

Result<std::unique_ptr<WritableFile>> FileSystem::open_through(const std::string& path) {
  return fail(ErrorCode::cannot_create, "this file system has no devices and pipes", path,
              "name a file");
}

Result<Bytes> read_file(FileSystem& files, const std::string& path, std::uint64_t limit) {
  SIXPOINT_ASSIGN(const auto file, files.open(path));
  if (file->size() > limit) {
    return fail(ErrorCode::bad_data,
                fmt::format("the file has {} bytes, more than the {} that it may have",
                            file->size(), limit),
                path, "check that this is the right file");
  }
  Bytes bytes(file->size());
  std::size_t done = 0;
  while (done < bytes.size()) {
    SIXPOINT_ASSIGN(const auto count, file->read_at(done, std::span(bytes).subspan(done)));
    if (count == 0) {
      break;
    }
    done += count;
  }
  bytes.resize(done);
  return bytes;
}

std::string folder_of(const std::string& path) {
  const auto slash = path.find_last_of('/');
  if (slash == std::string::npos) {
    return ".";
  }
  return slash == 0 ? "/" : path.substr(0, slash);
}

std::string file_name_of(const std::string& path) {
  const auto slash = path.find_last_of('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

}  // namespace sixpoint

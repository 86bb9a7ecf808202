#include "base/atomic_file.h"

#include <fmt/format.h>

namespace sixpoint {

AtomicFile::AtomicFile(FileSystem& files, std::string path, std::string temporary,
                       std::unique_ptr<WritableFile> file)
    : files_(&files),
      path_(std::move(path)),
      temporary_(std::move(temporary)),
      file_(std::move(file)) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : files_(other.files_),
      path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      file_(std::move(other.file_)),
      size_(other.size_) {}

AtomicFile::~AtomicFile() {
  if (file_ != nullptr) {
    file_.reset();
    // Nothing can be done about a failure here: the name says that the file is temporary.
    static_cast<void>(files_->remove(temporary_));
  }
}

namespace {

constexpr int kMostAttempts = 100;

std::string temporary_name(const std::string& path, int attempt) {
  return fmt::format("{}/.{}.{}.tmp", folder_of(path), file_name_of(path), attempt);
}

}  // namespace

void AtomicFile::remove_left_over(FileSystem& files, const std::string& path) {
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    if (!files.info(temporary_name(path, attempt)) ||
        !files.remove(temporary_name(path, attempt))) {
      return;
    }
  }
}

Result<AtomicFile> AtomicFile::create(FileSystem& files, const std::string& path) {
  // The first free name: one that a killed process left behind must not stop the next run, and two
  // processes that write the same target must not share a temporary file.
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    const std::string temporary = temporary_name(path, attempt);
    auto file = files.create(temporary);
    if (file) {
      return AtomicFile(files, path, temporary, *std::move(file));
    }
    if (!files.info(temporary)) {
      return fail(std::move(file).error());
    }
  }
  return fail(ErrorCode::cannot_create, "100 temporary files of this name are in the way", path,
              "remove the .tmp files in its folder");
}

Status AtomicFile::append(std::span<const std::uint8_t> bytes) {
  SIXPOINT_CHECK(file_->write_at(size_, bytes));
  size_ += bytes.size();
  return {};
}

Status AtomicFile::append(std::string_view text) { return append(as_bytes(text)); }

Status AtomicFile::commit() {
  SIXPOINT_CHECK(file_->sync());
  SIXPOINT_CHECK(file_->close());
  SIXPOINT_CHECK(files_->rename(temporary_, path_));
  file_.reset();
  return files_->sync_folder(folder_of(path_));
}

Status make_synced_folders(FileSystem& files, const std::string& path) {
  if (files.info(path)) {
    return files.make_folders(path);  // says so where it is no folder
  }
  const std::string parent = folder_of(path);
  if (parent != path && parent != ".") {
    SIXPOINT_CHECK(make_synced_folders(files, parent));
  }
  SIXPOINT_CHECK(files.make_folders(path));
  return files.sync_folder(parent);
}

Status write_file(FileSystem& files, const std::string& path, std::string_view text) {
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, path));
  SIXPOINT_CHECK(out.append(text));
  return out.commit();
}

}  // namespace sixpoint

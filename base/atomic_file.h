// A file that appears whole or not at all.
//
//   SIXPOINT_ASSIGN(auto out, AtomicFile::create(env.files, path));
//   SIXPOINT_CHECK(out.append(bytes));
//   SIXPOINT_CHECK(out.commit());
//
// Bytes go to a temporary file beside the target; commit() syncs it, renames it over the target and
// syncs the folder, in that order, so that a loss of power at any moment leaves the old file or the
// new one. Without commit() the destructor removes the temporary file.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "base/env.h"

namespace sixpoint {

class AtomicFile {
 public:
  static Result<AtomicFile> create(FileSystem& files, const std::string& path);

  // Removes the temporary files that killed processes left for this target. Only for who knows that
  // no other process is writing it.
  static void remove_left_over(FileSystem& files, const std::string& path);

  AtomicFile(AtomicFile&&) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  Status append(std::span<const std::uint8_t> bytes);
  Status append(std::string_view text);
  WritableFile& file() { return *file_; }  // for writers that seek; append() goes on from size()
  std::uint64_t size() const { return size_; }
  Status commit();

 private:
  AtomicFile(FileSystem& files, std::string path, std::string temporary,
             std::unique_ptr<WritableFile> file);

  FileSystem* files_;
  std::string path_;
  std::string temporary_;
  std::unique_ptr<WritableFile> file_;
  std::uint64_t size_ = 0;
};

// As FileSystem::make_folders(), and every folder that was made is on the medium.
Status make_synced_folders(FileSystem& files, const std::string& path);

Status write_file(FileSystem& files, const std::string& path, std::string_view text);

}  // namespace sixpoint

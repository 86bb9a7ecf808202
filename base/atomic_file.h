// A file that appears whole or not at all.
//
//   SIXPOINT_ASSIGN(auto out, AtomicFile::create(env.files, path));
//   SIXPOINT_CHECK(out.append(bytes));
//   SIXPOINT_CHECK(out.commit());
//
// Bytes go to a temporary file beside the target; commit() syncs it, gives it the target's name and
// syncs the folder, in that order, so that a loss of power at any moment leaves what was there or
// the new file. Without commit() the destructor removes the temporary file.
//
// FileSystem::placement() says what happens to a file that has the name already:
//
//     unruled  it is replaced: a disk has no rule
//     replace  it is replaced
//     keep     it stays, commit() gives cannot_create: outputs that a user named (cli/output.h)
//     through  it is a device or a pipe: the bytes go into it as they come, nothing is renamed
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

  Status restrict_to_owner();  // before the first byte, so that no other user reads one
  Status append(std::span<const std::uint8_t> bytes);
  Status append(std::string_view text);
  // For writers that seek; append() goes on from size(). What goes to a device or a pipe is then
  // kept in memory until commit().
  WritableFile& file();
  std::uint64_t size() const { return size_; }
  // No other process has this name while the object lives. Empty: the bytes go through.
  const std::string& temporary() const { return temporary_; }
  Status commit();

 private:
  class Held;
  AtomicFile(FileSystem& files, std::string path, std::string temporary,
             std::unique_ptr<WritableFile> file);
  static Result<AtomicFile> create_temporary(FileSystem& files, const std::string& path);

  FileSystem* files_;
  std::string path_;
  std::string temporary_;  // empty: the bytes go through
  std::unique_ptr<WritableFile> file_;
  Held* held_ = nullptr;  // file_ where the bytes go through
  std::uint64_t size_ = 0;
};

// What commit() does at its end, for a whole and synced file that was made by other means: it takes
// the name `path` as FileSystem::placement() says. cannot_create for a device or a pipe.
Status put_in_place(FileSystem& files, const std::string& temporary, const std::string& path);

// For a writer that replaces nothing by itself: cannot_create where `path` exists and the file
// system has no rule for it.
Status refuse_existing(FileSystem& files, const std::string& path);

// As FileSystem::make_folders(), and every folder that was made is on the medium.
Status make_synced_folders(FileSystem& files, const std::string& path);

// The same; every folder that was made is its owner's alone.
Status make_private_folders(FileSystem& files, const std::string& path);

Status write_file(FileSystem& files, const std::string& path, std::string_view text);
// The same; only the owner may read the file.
Status write_private_file(FileSystem& files, const std::string& path, std::string_view text);

}  // namespace sixpoint

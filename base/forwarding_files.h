// A file system that hands every call on to another one: for those that change a few calls.
//
//   class WithoutSpace final : public ForwardingFiles {
//    public:
//     using ForwardingFiles::ForwardingFiles;
//     Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
//       return fail(ErrorCode::io, "no space is left", path, "make room on this disk");
//     }
//   };
//
// The other one belongs to the caller. Threads: as the other one.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint {

class ForwardingFiles : public FileSystem {
 public:
  explicit ForwardingFiles(FileSystem& files) : files_(files) {}

  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
    return files_.open(path);
  }
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    return files_.create(path);
  }
  Result<FileInfo> info(const std::string& path) override { return files_.info(path); }
  Result<std::vector<std::string>> list(const std::string& folder) override {
    return files_.list(folder);
  }
  Status make_folders(const std::string& path) override { return files_.make_folders(path); }
  Status rename(const std::string& from, const std::string& to) override {
    return files_.rename(from, to);
  }
  Status rename_new(const std::string& from, const std::string& to) override {
    return files_.rename_new(from, to);
  }
  Status remove(const std::string& path) override { return files_.remove(path); }
  Status sync_folder(const std::string& path) override { return files_.sync_folder(path); }
  Result<Placement> placement(const std::string& path) override { return files_.placement(path); }
  Result<std::unique_ptr<WritableFile>> open_through(const std::string& path) override {
    return files_.open_through(path);
  }
  Status restrict_to_owner(const std::string& path) override {
    return files_.restrict_to_owner(path);
  }
  Result<FileInfo> link_info(const std::string& path) override { return files_.link_info(path); }
  Result<std::string> real_path(const std::string& path) override { return files_.real_path(path); }
  Result<std::unique_ptr<FileLock>> lock(const std::string& path) override {
    return files_.lock(path);
  }

 protected:
  FileSystem& disk() { return files_; }

 private:
  FileSystem& files_;
};

}  // namespace sixpoint

// A file system that hands every call on to another one; a test replaces the calls that it is
// about.
//
//   class NoSpace final : public tests::ForwardingFiles {
//    public:
//     using ForwardingFiles::ForwardingFiles;
//     Result<std::unique_ptr<WritableFile>> create(const std::string& path) override { ... }
//   };
#pragma once

#include "base/env.h"

namespace sixpoint::tests {

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
  Status remove(const std::string& path) override { return files_.remove(path); }
  Status sync_folder(const std::string& path) override { return files_.sync_folder(path); }

 private:
  FileSystem& files_;
};

}  // namespace sixpoint::tests

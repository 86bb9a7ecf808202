// A file system of which one call fails, for tests that let each one fail in turn.
//
//   FailingFiles files(memory.files);
//   files.fail_at(2);  // the third of the following calls answers `io`, and no other
//   ...
//   EXPECT_TRUE(files.has_failed());
//
// Counted are the calls that open, read, write or change something; not info() and list(). (A disk
// that fails from some change on is MemoryFiles::fail_after().)
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/forwarding_files.h"

namespace sixpoint::tests {

class FailingFiles final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;

  void fail_at(std::size_t call) {
    left_ = call;
    failed_ = false;
  }
  void stop_failing() { left_.reset(); }
  bool has_failed() const { return failed_; }

  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
    SIXPOINT_CHECK(next_call(path));
    SIXPOINT_ASSIGN(auto file, ForwardingFiles::open(path));
    return std::make_unique<Readable>(*this, path, std::move(file));
  }
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    SIXPOINT_CHECK(next_call(path));
    SIXPOINT_ASSIGN(auto file, ForwardingFiles::create(path));
    return std::make_unique<Writable>(*this, path, std::move(file));
  }
  Status make_folders(const std::string& path) override {
    SIXPOINT_CHECK(next_call(path));
    return ForwardingFiles::make_folders(path);
  }
  Status rename(const std::string& from, const std::string& to) override {
    SIXPOINT_CHECK(next_call(to));
    return ForwardingFiles::rename(from, to);
  }
  Status rename_new(const std::string& from, const std::string& to) override {
    SIXPOINT_CHECK(next_call(to));
    return ForwardingFiles::rename_new(from, to);
  }
  Status remove(const std::string& path) override {
    SIXPOINT_CHECK(next_call(path));
    return ForwardingFiles::remove(path);
  }
  Status sync_folder(const std::string& path) override {
    SIXPOINT_CHECK(next_call(path));
    return ForwardingFiles::sync_folder(path);
  }

 private:
  class Readable final : public ReadableFile {
   public:
    Readable(FailingFiles& disk, std::string path, std::unique_ptr<ReadableFile> file)
        : disk_(disk), path_(std::move(path)), file_(std::move(file)) {}
    std::uint64_t size() const override { return file_->size(); }
    Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) const override {
      SIXPOINT_CHECK(disk_.next_call(path_));
      return file_->read_at(offset, out);
    }

   private:
    FailingFiles& disk_;
    std::string path_;
    std::unique_ptr<ReadableFile> file_;
  };

  class Writable final : public WritableFile {
   public:
    Writable(FailingFiles& disk, std::string path, std::unique_ptr<WritableFile> file)
        : disk_(disk), path_(std::move(path)), file_(std::move(file)) {}
    Status write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes) override {
      SIXPOINT_CHECK(disk_.next_call(path_));
      return file_->write_at(offset, bytes);
    }
    Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) override {
      SIXPOINT_CHECK(disk_.next_call(path_));
      return file_->read_at(offset, out);
    }
    Status sync() override {
      SIXPOINT_CHECK(disk_.next_call(path_));
      return file_->sync();
    }
    Status close() override {
      SIXPOINT_CHECK(disk_.next_call(path_));
      return file_->close();
    }

   private:
    FailingFiles& disk_;
    std::string path_;
    std::unique_ptr<WritableFile> file_;
  };

  Status next_call(const std::string& path) {
    if (!left_.has_value()) {
      return {};
    }
    if (*left_ == 0) {
      left_.reset();
      failed_ = true;
      return fail(ErrorCode::io, "this call fails", path, "try again");
    }
    --*left_;
    return {};
  }

  std::optional<std::size_t> left_;  // calls before the one that fails
  bool failed_ = false;
};

}  // namespace sixpoint::tests

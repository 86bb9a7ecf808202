// A clock that moves on command, and a disk in memory that can lose power or fail on command.
//
//   MemoryEnv memory;
//   memory.clock.sleep(std::chrono::hours(1));  // returns at once
//   memory.files.fail_after(3);                 // the fourth change of the disk fails with `io`
//   const Status status = memory.env.files.make_folders("a/b");
//   memory.files.lose_power();
//
// MemoryFiles keeps two states: what a running process sees, and what the medium holds. Bytes reach
// the medium by WritableFile::sync(), names by sync_folder(). lose_power() throws away everything
// else, as a power cut would. fail_after(n) makes the n-th following operation that changes the
// disk fail, and every one after it, so that a test can stop a program at each step in turn.
//
// Safe to call from several threads.
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "base/env.h"

namespace sixpoint {

class ManualClock final : public Clock {
 public:
  explicit ManualClock(UtcTime start = from_unix_seconds(1'400'000'000)) : now_(start) {}
  UtcTime now() override;
  std::chrono::nanoseconds elapsed() override;
  void sleep(std::chrono::nanoseconds duration) override;  // moves the clock and returns at once
  void set(UtcTime time);  // a jump of the calendar; elapsed() does not jump

 private:
  std::mutex mutex_;
  UtcTime now_;
  std::chrono::nanoseconds elapsed_{0};
};

class MemoryFiles final : public FileSystem {
 public:
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override;
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override;
  Result<FileInfo> info(const std::string& path) override;
  Result<std::vector<std::string>> list(const std::string& folder) override;
  Status make_folders(const std::string& path) override;
  Status rename(const std::string& from, const std::string& to) override;
  Status rename_new(const std::string& from, const std::string& to) override;
  Status remove(const std::string& path) override;
  Status sync_folder(const std::string& path) override;
  Result<std::unique_ptr<FileLock>> lock(const std::string& path) override;

  // Forgets whatever is not on the medium. Files that are open stay usable but lead nowhere.
  void lose_power();
  // The n-th changing operation from now (0 = the next one) and all later ones fail with `io`.
  void fail_after(std::size_t operations);
  void stop_failing();
  std::size_t changing_operations() const;  // how many were tried so far

  // What one open file shares with the disk; defined in the source file.
  struct Node;
  struct LockedPaths;
  MemoryFiles();

 private:
  friend class MemoryWritableFile;
  Status may_change(const std::string& path);
  Status rename_unless(const std::string& from, const std::string& to, bool keep);
  std::int64_t next_change();

  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Node>> seen_;
  std::map<std::string, std::shared_ptr<Node>> medium_;
  std::set<std::string> folders_;
  std::shared_ptr<LockedPaths> locked_;
  std::int64_t changes_ = 0;  // the clock of FileInfo::modified_ns
  std::size_t operations_ = 0;
  std::optional<std::size_t> fail_from_;
};

class MemoryEnv {
 public:
  ManualClock clock;
  MemoryFiles files;
  Env env{clock, files};
};

}  // namespace sixpoint

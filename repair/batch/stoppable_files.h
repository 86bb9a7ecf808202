// A file system whose reading fails once it is told to stop, for work that is no longer wanted.
//
//   std::atomic<bool> stop{false};  // set from another thread
//   StoppableFiles stoppable(env.files, stop);
//   const ScannedFile file = scan_file(stoppable, "a.gt3x");  // unreadable where it was stopped
//
// What writes an output by base/atomic_file.h leaves none behind when its reading fails.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "base/forwarding_files.h"

namespace sixpoint::repair {

class StoppableFiles final : public ForwardingFiles {
 public:
  // Both belong to the caller.
  StoppableFiles(FileSystem& files, const std::atomic<bool>& stop)
      : ForwardingFiles(files), stop_(stop) {}
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override;

 private:
  const std::atomic<bool>& stop_;
};

}  // namespace sixpoint::repair

// Lets every call fail that needs one more file descriptor, as in a program that has too many open.
//
//   for (int free = 0;; ++free) {
//     OpenFilesLimit limit(free);  // so many more may be opened, until the end of the block
//     if (HotplugWatch::start()) { break; }
//   }
//
// For the whole process: no other thread may open anything meanwhile.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

namespace sixpoint::tests {

class OpenFilesLimit {
 public:
  // Less than none: also those that are open are too many for the kernel.
  explicit OpenFilesLimit(int free) {
    const auto is_open = [](int descriptor) { return ::fcntl(descriptor, F_GETFD) >= 0; };
    int end = 0;
    for (int left = free; left > 0 || (left == 0 && is_open(end)); ++end) {
      left -= is_open(end) ? 0 : 1;
    }
    EXPECT_EQ(::getrlimit(RLIMIT_NOFILE, &before_), 0);
    rlimit limit = before_;
    limit.rlim_cur = static_cast<rlim_t>(end);
    EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  }
  ~OpenFilesLimit() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  OpenFilesLimit(const OpenFilesLimit&) = delete;
  OpenFilesLimit& operator=(const OpenFilesLimit&) = delete;

 private:
  rlimit before_{};
};

}  // namespace sixpoint::tests

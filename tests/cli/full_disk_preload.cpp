// Loaded into the program (LD_PRELOAD) by full_disk_test.cpp: from the write of the number
// SIXPOINT_FULL_FROM on (the first is 1), the disk below the folder SIXPOINT_FULL_UNDER is full.
// The file SIXPOINT_FULL_SAID is made when that happens.
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>

namespace {

std::atomic<long> writes = 0;

bool is_below_the_folder(int file) {
  const char* under = std::getenv("SIXPOINT_FULL_UNDER");
  char link[64];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  char path[4096];
  const ssize_t size = ::readlink(link, path, sizeof path - 1);
  if (size <= 0 || under == nullptr) {
    return false;
  }
  path[size] = '\0';
  return std::strncmp(path, under, std::strlen(under)) == 0;
}

bool is_full(int file) {
  const int before = errno;
  const char* from = std::getenv("SIXPOINT_FULL_FROM");
  const bool full = from != nullptr && is_below_the_folder(file) && ++writes >= std::atol(from);
  if (full) {
    if (const char* said = std::getenv("SIXPOINT_FULL_SAID"); said != nullptr) {
      ::close(::open(said, O_CREAT | O_WRONLY | O_CLOEXEC, 0600));
    }
  }
  errno = full ? ENOSPC : before;
  return full;
}

template <class Call>
Call next(const char* name) {
  return reinterpret_cast<Call>(::dlsym(RTLD_NEXT, name));
}

using Write = ssize_t (*)(int, const void*, size_t);
using WriteAt = ssize_t (*)(int, const void*, size_t, off_t);

}  // namespace

extern "C" ssize_t write(int file, const void* from, size_t size) {
  return is_full(file) ? -1 : next<Write>("write")(file, from, size);
}
extern "C" ssize_t pwrite(int file, const void* from, size_t size, off_t offset) {
  return is_full(file) ? -1 : next<WriteAt>("pwrite")(file, from, size, offset);
}
extern "C" ssize_t pwrite64(int file, const void* from, size_t size, off_t offset) {
  return is_full(file) ? -1 : next<WriteAt>("pwrite64")(file, from, size, offset);
}

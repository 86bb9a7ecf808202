// Loaded into the PostgreSQL server of the tests (LD_PRELOAD): while the file that
// SIXPOINT_FULL_DISK names is there, the disk under the server's tables is full.
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <sys/types.h>
#include <unistd.h>

namespace {

bool is_full(int file) {
  const char* flag = std::getenv("SIXPOINT_FULL_DISK");
  if (flag == nullptr || ::access(flag, F_OK) != 0) {
    return false;
  }
  char link[64];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  char path[4096];
  const ssize_t size = ::readlink(link, path, sizeof path - 1);
  if (size <= 0) {
    return false;
  }
  path[size] = '\0';
  // Tables and indexes; the server's log of changes stands in pg_wal.
  return std::strstr(path, "/base/") != nullptr;
}

using Write = ssize_t (*)(int, const void*, size_t, off_t);

ssize_t write_or_fail(const char* name, int file, const void* from, size_t size, off_t offset) {
  const int before = errno;
  if (is_full(file)) {
    errno = ENOSPC;
    return -1;
  }
  errno = before;
  return reinterpret_cast<Write>(::dlsym(RTLD_NEXT, name))(file, from, size, offset);
}

}  // namespace

extern "C" ssize_t pwrite(int file, const void* from, size_t size, off_t offset) {
  return write_or_fail("pwrite", file, from, size, offset);
}
extern "C" ssize_t pwrite64(int file, const void* from, size_t size, off_t offset) {
  return write_or_fail("pwrite64", file, from, size, offset);
}

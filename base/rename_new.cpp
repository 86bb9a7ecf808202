#include "base/rename_new.h"

#include <cerrno>
#include <cstdio>

#include <fcntl.h>
#include <unistd.h>

namespace sixpoint {

int rename_new(const std::string& from, const std::string& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) {
    return 0;
  }
  const bool unknown_here = errno == EINVAL || errno == ENOSYS || errno == ENOTSUP;
  return unknown_here ? rename_new_by_link(from, to) : errno;
}

int rename_new_by_link(const std::string& from, const std::string& to) {
  if (::link(from.c_str(), to.c_str()) != 0) {
    return errno;
  }
  return ::unlink(from.c_str()) == 0 ? 0 : errno;
}

}  // namespace sixpoint

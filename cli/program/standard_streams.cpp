#include "cli/program/standard_streams.h"

#include <cerrno>
#include <initializer_list>

#include <fcntl.h>
#include <unistd.h>

namespace sixpoint::cli {

void take_closed_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) == -1 && errno == EBADF) {
      // O_PATH: a number that can be neither read nor written. The root is there without /dev, too.
      // In this order the lowest number that is free is always `stream`. Programs that are started
      // by this one inherit it: they have the same fault otherwise.
      static_cast<void>(::open("/", O_PATH));
    }
  }
}

}  // namespace sixpoint::cli

#include <iostream>

#include <malloc.h>
#include <unistd.h>

#include "cli/program/interrupts.h"
#include "cli/program/program.h"
#include "cli/program/standard_streams.h"

int main(int argc, char** argv) {
  sixpoint::cli::take_closed_streams();
  // Large buffers go back to the system when they are freed. By itself the C library keeps them
  // once one was freed, and the memory of one pass over a recording would add to that of the next.
  constexpr int kGoesBackFrom = 256 * 1024;
  mallopt(M_MMAP_THRESHOLD, kGoesBackFrom);
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  sixpoint::cli::take_interrupts(arguments);
  sixpoint::cli::Context context{sixpoint::posix_env(), std::cout, std::cerr, std::cin,
                                 ::isatty(STDERR_FILENO) == 1};
  return sixpoint::cli::run_program(arguments, context);
}

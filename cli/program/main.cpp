#include <iostream>

#include <unistd.h>

#include "cli/program/interrupts.h"
#include "cli/program/program.h"

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  sixpoint::cli::take_interrupts(arguments);
  sixpoint::cli::Context context{sixpoint::posix_env(), std::cout, std::cerr, std::cin,
                                 ::isatty(STDERR_FILENO) == 1};
  return sixpoint::cli::run_program(arguments, context);
}

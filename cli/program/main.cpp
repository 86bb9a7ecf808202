#include <iostream>

#include <unistd.h>

#include "cli/program/program.h"

int main(int argc, char** argv) {
  sixpoint::cli::Context context{sixpoint::posix_env(), std::cout, std::cerr, std::cin,
                                 ::isatty(STDERR_FILENO) == 1};
  return sixpoint::cli::run_program(std::vector<std::string>(argv + 1, argv + argc), context);
}

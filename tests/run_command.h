// Runs the whole program inside a test: arguments and input in, exit code and both streams out.
#pragma once

#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include "base/memory_env.h"
#include "cli/context.h"
#include "cli/program/program.h"

namespace sixpoint::tests {

struct Answer {
  int exit_code = 0;
  std::string out;
  std::string people;
  cli::Json json() const { return cli::Json::parse(out, nullptr, false); }
};

inline Answer run_command(Env& env, const std::vector<std::string>& arguments,
                          const std::string& input = {}) {
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in(input);
  cli::Context context{env, out, people, in};
  Answer answer;
  answer.exit_code = cli::run_program(arguments, context);
  answer.out = out.str();
  answer.people = people.str();
  return answer;
}

// The exit code for a user who is not root, in a process of its own; 100 where root cannot give its
// rights up. `home` is that user's.
inline int exit_code_as_other_user(const std::vector<std::string>& arguments,
                                   const std::string& home) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::setenv("HOME", home.c_str(), 1);
    constexpr uid_t kNobody = 65534;
    if (::geteuid() == 0 && ::setuid(kNobody) != 0) {
      ::_exit(100);
    }
    ::_exit(run_command(posix_env(), arguments).exit_code);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace sixpoint::tests

// Runs the whole program inside a test: arguments and input in, exit code and both streams out.
#pragma once

#include <sstream>
#include <string>
#include <vector>

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

}  // namespace sixpoint::tests

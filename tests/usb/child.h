// The installed program as a child process, which finds the devices of umockdev's test bed because
// it inherits the environment.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace sixpoint::tests {

struct ChildAnswer {
  int exit_code = -1;  // 128 and the signal, where one ended it
  std::string out;
  std::string people;
};

// Runs SIXPOINT_PROGRAM. `on_line` gets each line of stderr as it comes; stdin is the file `input`.
// May be called by several threads at once.
ChildAnswer run_child(const std::vector<std::string>& arguments,
                      const std::function<void(const std::string&)>& on_line = {},
                      const std::string& input = "/dev/null");
// `on_line` gets each line of stderr, and the child to signal.
ChildAnswer run_child_signalled(const std::vector<std::string>& arguments,
                                const std::function<void(const std::string&, pid_t)>& on_line);
// Runs any program: its path, and its arguments.
ChildAnswer run_program(const std::vector<std::string>& words);
// `on_line` gets each line of stdout, and the child to signal.
ChildAnswer run_child_lines(const std::vector<std::string>& arguments,
                            const std::function<void(const std::string&, pid_t)>& on_line);

}  // namespace sixpoint::tests

// Another program, started by a command.
//
//   const auto child = start_child({"sbatch", "run.sh"}, STDOUT_FILENO, ChildErrors::shown);
//   if (!child) return fail(ErrorCode::io, std::strerror(child.error()));
//
// Who starts it waits for it (waitpid).
#pragma once

#include <string>
#include <vector>

#include <sys/types.h>
#include <tl/expected.hpp>

namespace sixpoint::cli {

enum class ChildErrors { shown, dropped };  // its standard error

// Starts words[0], found as a shell finds it, with nothing to read and its standard output in
// `output`, which stays the caller's. The error is an errno.
tl::expected<pid_t, int> start_child(const std::vector<std::string>& words, int output,
                                     ChildErrors errors);

}  // namespace sixpoint::cli

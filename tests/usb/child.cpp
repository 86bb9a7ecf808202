#include "usb/child.h"

#include <array>
#include <thread>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace sixpoint::tests {

ChildAnswer run_child(const std::vector<std::string>& arguments,
                      const std::function<void(const std::string&)>& on_line) {
  ChildAnswer answer;
  std::array<int, 2> out{};
  std::array<int, 2> people{};
  if (::pipe2(out.data(), O_CLOEXEC) != 0 || ::pipe2(people.data(), O_CLOEXEC) != 0) {
    return answer;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out[1], 1);
  posix_spawn_file_actions_adddup2(&actions, people[1], 2);
  std::vector<std::string> words = {SIXPOINT_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) {
    argv.push_back(word.data());
  }
  argv.push_back(nullptr);
  pid_t child = 0;
  const int failed = ::posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(out[1]);
  ::close(people[1]);
  if (failed == 0) {
    std::thread reader([&] {
      std::array<char, 4096> buffer{};
      for (ssize_t count; (count = ::read(out[0], buffer.data(), buffer.size())) > 0;) {
        answer.out.append(buffer.data(), static_cast<std::size_t>(count));
      }
    });
    std::string line;
    for (char c = 0; ::read(people[0], &c, 1) == 1;) {
      answer.people += c;
      if (c != '\n') {
        line += c;
        continue;
      }
      if (on_line) {
        on_line(line);
      }
      line.clear();
    }
    reader.join();
    int status = 0;
    ::waitpid(child, &status, 0);
    answer.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  ::close(out[0]);
  ::close(people[0]);
  return answer;
}

}  // namespace sixpoint::tests

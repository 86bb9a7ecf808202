#include "usb/child.h"

#include <array>
#include <thread>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace sixpoint::tests {

namespace {

using OnLine = std::function<void(const std::string&, pid_t)>;

// All that comes, and each line of it.
void drain(int from, pid_t child, std::string& all, const OnLine& on_line) {
  std::string line;
  std::array<char, 4096> buffer{};
  for (ssize_t count; (count = ::read(from, buffer.data(), buffer.size())) > 0;) {
    for (const char c : std::string_view(buffer.data(), static_cast<std::size_t>(count))) {
      all += c;
      if (c != '\n') {
        line += c;
        continue;
      }
      if (on_line) {
        on_line(line, child);
      }
      line.clear();
    }
  }
}

ChildAnswer run(std::vector<std::string> words, const OnLine& on_out, const OnLine& on_people,
                const std::string& input = "/dev/null") {
  ChildAnswer answer;
  std::array<int, 2> out{};
  std::array<int, 2> people{};
  if (::pipe2(out.data(), O_CLOEXEC) != 0 || ::pipe2(people.data(), O_CLOEXEC) != 0) {
    return answer;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, input.c_str(), O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out[1], 1);
  posix_spawn_file_actions_adddup2(&actions, people[1], 2);
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
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
    std::thread reader([&] { drain(out[0], child, answer.out, on_out); });
    drain(people[0], child, answer.people, on_people);
    reader.join();
    int status = 0;
    ::waitpid(child, &status, 0);
    answer.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  ::close(out[0]);
  ::close(people[0]);
  return answer;
}

std::vector<std::string> sixpoint(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), SIXPOINT_PROGRAM);
  return arguments;
}

}  // namespace

ChildAnswer run_program(const std::vector<std::string>& words) { return run(words, {}, {}); }

ChildAnswer run_child(const std::vector<std::string>& arguments,
                      const std::function<void(const std::string&)>& on_line,
                      const std::string& input) {
  OnLine people;
  if (on_line) {
    people = [&on_line](const std::string& line, pid_t /*child*/) { on_line(line); };
  }
  return run(sixpoint(arguments), {}, people, input);
}

ChildAnswer run_child_signalled(const std::vector<std::string>& arguments, const OnLine& on_line) {
  return run(sixpoint(arguments), {}, on_line);
}

ChildAnswer run_child_lines(const std::vector<std::string>& arguments, const OnLine& on_line) {
  return run(sixpoint(arguments), on_line, {});
}

}  // namespace sixpoint::tests

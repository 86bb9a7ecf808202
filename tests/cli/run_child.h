// The program as people start it: a child process, its first line, its end.
//
//   Child station({"station", "--port", "0", "--device", "virtual:seed=7"});
//   const std::string line = station.line();
//   EXPECT_EQ(station.stop(SIGINT), 0);
#pragma once

#include <array>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace sixpoint::tests {

class Child {
 public:
  explicit Child(std::vector<std::string> arguments) {
    std::array<int, 2> ends{};
    EXPECT_EQ(::pipe(ends.data()), 0);
    arguments.insert(arguments.begin(), SIXPOINT_PROGRAM);
    child_ = ::fork();
    if (child_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::close(ends[0]);
      ::close(ends[1]);
      std::vector<char*> argv;
      for (std::string& argument : arguments) {
        argv.push_back(argument.data());
      }
      argv.push_back(nullptr);
      ::execv(SIXPOINT_PROGRAM, argv.data());
      ::_exit(127);
    }
    ::close(ends[1]);
    out_ = ends[0];
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    if (child_ > 0) {
      stop(SIGTERM);
    }
    ::close(out_);
  }
  // The next line on its standard output, without the line's end.
  std::string line() {
    std::string text;
    char one = 0;
    while (::read(out_, &one, 1) == 1 && one != '\n') {
      text += one;
    }
    return text;
  }
  // The JSON document that comes next on its standard output; null where the output ends before it.
  nlohmann::json next_document() {
    std::string text;
    std::array<char, 4096> part{};
    while (!nlohmann::json::accept(text)) {
      const auto count = ::read(out_, part.data(), part.size());
      if (count <= 0) {
        return nullptr;
      }
      text.append(part.data(), static_cast<std::size_t>(count));
    }
    return nlohmann::json::parse(text);
  }
  // All that comes until it closes its standard output.
  std::string rest() {
    std::string text;
    std::array<char, 4096> part{};
    for (auto count = ::read(out_, part.data(), part.size()); count > 0;
         count = ::read(out_, part.data(), part.size())) {
      text.append(part.data(), static_cast<std::size_t>(count));
    }
    return text;
  }
  // Waits until its output fills the pipe, which nobody reads: it is in the midst of writing.
  bool fills_its_pipe() const {
    const int room = ::fcntl(out_, F_GETPIPE_SZ);
    for (int hundredths = 0; hundredths < 6000; ++hundredths) {
      int unread = 0;
      if (::ioctl(out_, FIONREAD, &unread) == 0 && unread >= room) {
        return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }
  void send(int signal) const { ::kill(child_, signal); }
  // Its exit code; -1 where a signal ended it.
  int stop(int signal) {
    ::kill(child_, signal);
    return wait();
  }
  // As timeout(1) and impatient people do it: again and again until it has ended.
  int stop_repeatedly(int signal) {
    int status = 0;
    do {
      ::kill(child_, signal);
    } while (::waitpid(child_, &status, WNOHANG) == 0);
    return exit_code(status);
  }
  int wait() {
    int status = 0;
    ::waitpid(child_, &status, 0);
    return exit_code(status);
  }

 private:
  int exit_code(int status) {
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  pid_t child_ = -1;
  int out_ = -1;
};

}  // namespace sixpoint::tests

#include "cli/program/interrupts.h"

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <initializer_list>

#include <unistd.h>

#include "base/temporaries.h"
#include "cli/context.h"
#include "cli/people_text.h"

namespace sixpoint::cli {
namespace {

// Ready before the handler is set, which may do nothing but write, unlink and end.
std::string& stopped_text() {
  static std::string text;
  return text;
}

extern "C" void end_as_stopped(int signal) {
  const std::string& text = stopped_text();
  remove_noted_temporaries();
  if (signal != SIGPIPE) {  // there the reader has gone, as `head` does when it has enough
    static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size()));
  }
  ::_exit(kExitStopped);
}

// The value of an option, as `--name VALUE` or `--name=VALUE`. Empty: it is not given.
std::string value_of(const std::vector<std::string>& arguments, const std::string& option) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == option && i + 1 < arguments.size()) {
      return arguments[i + 1];
    }
    if (arguments[i].starts_with(option + "=")) {
      return arguments[i].substr(option.size() + 1);
    }
  }
  return {};
}

bool has(const std::vector<std::string>& arguments, const char* flag) {
  return std::find(arguments.begin(), arguments.end(), flag) != arguments.end();
}

std::string line_of(const std::vector<std::string>& arguments) {
  std::string line = "sixpoint";
  for (const std::string& argument : arguments) {
    line.append(" ").append(bash_word(argument));
  }
  return line;
}

bool begins_with(const std::vector<std::string>& arguments,
                 std::initializer_list<const char*> words) {
  return arguments.size() >= words.size() &&
         std::equal(words.begin(), words.end(), arguments.begin());
}

// An export into a folder, which must be empty or used with --force.
bool exports_into_folder(const std::vector<std::string>& arguments) {
  const auto names_output = [](const std::string& argument) {
    return argument.starts_with("-o") || argument == "--output" ||
           argument.starts_with("--output=");
  };
  return begins_with(arguments, {"store", "export"})
             ? has(arguments, "--csv")
             : begins_with(arguments, {"export"}) &&
                   std::any_of(arguments.begin(), arguments.end(), names_output);
}

// `flag` stands in front of the command's other arguments: behind a "--" it would be a path.
std::string with_flag(std::vector<std::string> arguments, std::ptrdiff_t words, const char* flag) {
  if (!has(arguments, flag)) {
    arguments.insert(arguments.begin() + words, flag);
  }
  return line_of(arguments);
}

}  // namespace

std::string text_when_stopped(const std::vector<std::string>& arguments) {
  if (begins_with(arguments, {"archive", "plan"})) {
    return "\nsixpoint: stopped; no plan was made\n";
  }
  if (begins_with(arguments, {"scan"}) || begins_with(arguments, {"inspect"}) ||
      begins_with(arguments, {"simulate"})) {
    return "\nsixpoint: stopped; nothing was written\n";
  }
  if (begins_with(arguments, {"capture"})) {
    return "\nsixpoint: stopped; the unit may still be recording: begin the capture again, with "
           "another name if its file is there\n";
  }
  if (const std::string folder = value_of(arguments, "--export");
      begins_with(arguments, {"gap", "challenge"}) && !folder.empty()) {
    return "\nsixpoint: stopped; remove the folder " + bash_word(folder) + " and begin again\n";
  }
  if (exports_into_folder(arguments)) {
    return "\nsixpoint: stopped; what is done stays, and this line begins again:\n  " +
           with_flag(arguments, arguments.front() == "store" ? 2 : 1, "--force") + "\n";
  }
  return "\nsixpoint: stopped; what is done stays, and this line goes on:\n  " +
         (begins_with(arguments, {"repair"}) ? with_flag(arguments, 1, "--resume")
                                             : line_of(arguments)) +
         "\n";
}

void take_interrupts(const std::vector<std::string>& arguments) {
  // The write that goes beyond the limit fails then (EFBIG), and the command ends in order.
  ::signal(SIGXFSZ, SIG_IGN);
  stopped_text() = text_when_stopped(arguments);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) {
    struct sigaction before {};
    if (::sigaction(signal, nullptr, &before) == 0 && before.sa_handler == SIG_DFL) {
      struct sigaction action {};
      action.sa_handler = end_as_stopped;
      ::sigaction(signal, &action, nullptr);
    }
  }
}

}  // namespace sixpoint::cli

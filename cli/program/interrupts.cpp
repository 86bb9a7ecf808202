#include "cli/program/interrupts.h"

#include <csignal>

#include <unistd.h>

#include "base/temporaries.h"
#include "cli/context.h"
#include "repair/archive/archive_scripts.h"

namespace sixpoint::cli {
namespace {

// Ready before the handler is set, which may do nothing but write, unlink and end.
std::string& stopped_text() {
  static std::string text;
  return text;
}

extern "C" void end_as_stopped(int /*signal*/) {
  const std::string& text = stopped_text();
  remove_noted_temporaries();
  static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size()));
  ::_exit(kExitStopped);
}

}  // namespace

void take_interrupts(const std::vector<std::string>& arguments) {
  std::string& text = stopped_text();
  text = "\nsixpoint: stopped; what is done stays, and this line goes on:\n  sixpoint";
  for (const std::string& argument : arguments) {
    text.append(" ").append(repair::shell_word(argument));
  }
  text += "\n";
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    if (::sigaction(signal, nullptr, &before) == 0 && before.sa_handler == SIG_DFL) {
      struct sigaction action {};
      action.sa_handler = end_as_stopped;
      ::sigaction(signal, &action, nullptr);
    }
  }
}

}  // namespace sixpoint::cli

// A unit on emulated USB (umockdev) and the installed program as its child, for the browser's
// scenarios: the browser itself must not run under umockdev's preload library.
//
//   usb_station SIXPOINT_PROGRAM WORD...    every WORD `{device}` becomes hid:SERIAL
//
// Says `serial S` and, at every start, what the station prints; then does what the lines of its
// standard input say, each answered with `ok`: turn POSE, unplug, plug, kill (the station, by
// SIGKILL), start, wait (until it has ended by itself). Ends with its input. With SIXPOINT_HAND
// these lines come from that file or pipe instead, up to the line `end`, nothing is answered, and
// the program has this one's terminal for itself, Ctrl-C included.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "usb/umockdev_bench.h"

namespace {

using namespace sixpoint;

class Child {
 public:
  explicit Child(std::vector<std::string> words) : words_(std::move(words)) {}
  ~Child() { kill(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool start() {
    kill();
    std::vector<char*> argv;
    for (std::string& word : words_) {
      argv.push_back(word.data());
    }
    argv.push_back(nullptr);
    posix_spawnattr_t attributes;
    sigset_t interrupt;
    sigemptyset(&interrupt);
    sigaddset(&interrupt, SIGINT);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigdefault(&attributes, &interrupt);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
    const bool begun =
        ::posix_spawn(&pid_, argv[0], nullptr, &attributes, argv.data(), environ) == 0;
    posix_spawnattr_destroy(&attributes);
    return begun;
  }
  void wait() {
    if (pid_ > 0) {
      ::waitpid(pid_, nullptr, 0);
      pid_ = 0;
    }
  }
  void kill() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
      pid_ = 0;
    }
  }

 private:
  std::vector<std::string> words_;
  pid_t pid_ = 0;
};

bool turn(tests::BenchUnit& unit, const std::string& word) {
  const auto pose = device::parse_pose(word);
  if (!pose) {
    return false;
  }
  const auto up = device::direction_of(*pose);
  const std::lock_guard lock(unit.unit->mutex);
  const auto now = unit.clock->elapsed();
  // Lifted off first, for a placement that is taken off and put back.
  unit.unit->unit.turn_to({up[1], up[2], up[0]}, now, 0.3);
  unit.unit->unit.turn_to({up[0], up[1], up[2]}, now + std::chrono::milliseconds(500), 0.3);
  return true;
}

int run(std::vector<std::string> words) {
  auto bus = mocks::UmockdevBus::make();
  if (!bus) {
    std::fprintf(stderr, "%s\n", bus.error().brief().c_str());
    return 1;
  }
  tests::UmockdevBench bench(std::move(*bus));
  constexpr int kPace = 8;  // the unit's time passes so much faster than the program's
  tests::BenchUnit unit = tests::make_unit(5, {}, kPace);
  if (const Status plugged = bench.plug_in(unit); !plugged) {
    std::fprintf(stderr, "%s\n", plugged.error().brief().c_str());
    return 1;
  }
  for (std::string& word : words) {
    word = word == "{device}" ? unit.hid_address() : word;
  }
  std::cout << "serial " << unit.serial << std::endl;
  Child station(words);
  bool fine = station.start();
  const char* hand = std::getenv("SIXPOINT_HAND");
  std::fstream pipe;
  if (hand != nullptr) {
    std::signal(SIGINT, SIG_IGN);
    pipe.open(hand, std::ios::in | std::ios::out);  // both: it has no end when a writer goes
  }
  std::istream& words_of_hand = hand != nullptr ? pipe : std::cin;
  for (std::string line; fine && std::getline(words_of_hand, line) && line != "end";) {
    if (line.starts_with("turn ")) {
      fine = turn(unit, line.substr(5));
    } else if (line == "unplug") {
      bench.unplug(unit);
    } else if (line == "plug") {
      fine = bench.plug_in(unit).has_value();
    } else if (line == "kill") {
      station.kill();
    } else if (line == "start") {
      fine = station.start();
    } else if (line == "wait") {
      station.wait();
      std::cout << "the program has ended" << std::endl;
    } else {
      fine = false;
    }
    if (hand == nullptr || !fine) {
      std::cout << (fine ? "ok" : "failed") << std::endl;
    }
  }
  station.kill();
  if (!unit.port.empty()) {
    bench.unplug(unit);
  }
  return fine ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (const auto why = sixpoint::mocks::UmockdevBus::enter(argv); !why.empty()) {
    std::fprintf(stderr, "SKIPPED: %s\n", why.c_str());
    return 77;
  }
  return run({argv + 1, argv + argc});
}

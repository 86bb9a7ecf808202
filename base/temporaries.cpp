#include "base/temporaries.h"

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>

#include <unistd.h>

namespace sixpoint {

namespace {

// More than are ever written at a time. What finds no place is not removed by the handler, but by
// the next run.
constexpr std::size_t kMostTemporaries = 1024;
// Texts of malloc(), or null. Whoever takes one out by an exchange owns it: the handler may come at
// any moment.
std::array<std::atomic<char*>, kMostTemporaries> noted_paths{};
static_assert(std::atomic<char*>::is_always_lock_free);
// How many threads are between creating a file and noting it.
std::atomic<int> being_created{0};
std::atomic<bool> process_ends{false};
// Between threads; the handler does not wait for it.
std::mutex& noting() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

void note_temporary(const std::string& path) {
  const std::lock_guard lock(noting());
  for (std::atomic<char*>& place : noted_paths) {
    if (place.load() == nullptr) {
      place.store(::strdup(path.c_str()));
      return;
    }
  }
}

void forget_temporary(const std::string& path) {
  const std::lock_guard lock(noting());
  for (std::atomic<char*>& place : noted_paths) {
    char* text = place.load();
    if (text != nullptr && path == text) {
      if (place.compare_exchange_strong(text, nullptr)) {
        std::free(text);  // NOLINT(cppcoreguidelines-no-malloc): of strdup()
      }
      return;
    }
  }
}

bool is_noted_temporary(const std::string& path) {
  const std::lock_guard lock(noting());
  for (const std::atomic<char*>& place : noted_paths) {
    const char* text = place.load();
    if (text != nullptr && path == text) {
      return true;
    }
  }
  return false;
}

UntilNoted::UntilNoted() noexcept {
  sigset_t ending;
  ::sigemptyset(&ending);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) {
    ::sigaddset(&ending, signal);
  }
  ::pthread_sigmask(SIG_BLOCK, &ending, &before_);
  ++being_created;
  if (process_ends) {
    --being_created;
    for (;;) {
      ::pause();
    }
  }
}

UntilNoted::~UntilNoted() {
  --being_created;
  ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

void remove_noted_temporaries() noexcept {
  process_ends = true;
  for (int waited_ms = 0; waited_ms < 1000 && being_created > 0; ++waited_ms) {
    const timespec one_ms{0, 1'000'000};
    ::nanosleep(&one_ms, nullptr);
  }
  for (std::atomic<char*>& place : noted_paths) {
    if (const char* text = place.exchange(nullptr); text != nullptr) {
      ::unlink(text);  // its memory goes with the process
    }
  }
}

}  // namespace sixpoint

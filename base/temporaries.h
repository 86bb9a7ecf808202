// The temporary files that this process is writing, so that one that is told to end leaves none.
//
//   const UntilNoted until_noted;             // around both: the file's creation, and this
//   note_temporary("/data/.out.csv.0.tmp");
//   forget_temporary("/data/.out.csv.0.tmp");  // once it has its name, or is removed
//
// AtomicFile notes its own, and a backup its own. Any thread may call any of these.
#pragma once

#include <csignal>
#include <string>

namespace sixpoint {

void note_temporary(const std::string& path);
void forget_temporary(const std::string& path);
bool is_noted_temporary(const std::string& path);

// While one lives, this thread creates a file and notes it. SIGINT, SIGTERM, SIGHUP and SIGPIPE come
// to the thread afterwards, and a handler on another thread waits: a file that it could not know
// would stay. Once the process ends, the constructor does not return.
class UntilNoted {
 public:
  UntilNoted() noexcept;
  ~UntilNoted();
  UntilNoted(const UntilNoted&) = delete;
  UntilNoted& operator=(const UntilNoted&) = delete;

 private:
  sigset_t before_{};  // what the thread blocked anyway
};

// Unlinks every file that is noted. For a signal handler that ends the process: it takes no memory,
// and waits for nothing but files that are being created, a second at most.
void remove_noted_temporaries() noexcept;

}  // namespace sixpoint

// Work without the interpreter's lock that a person can stop with Ctrl-C.
//
//   Watched watched;
//   const auto found = watched.run([&] { return repair::inspect(watched.files(), path); });
//
// The work runs on a thread of its own; meanwhile this one looks for signals some fifty times a
// second. After one, reading from files() fails, the work ends, and run() throws what the signal's
// handler raised (KeyboardInterrupt). One object serves one call from Python.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <optional>
#include <utility>

#include <pybind11/pybind11.h>

#include "base/env.h"
#include "repair/batch/jobs.h"
#include "repair/batch/stoppable_files.h"

namespace sixpoint::python {

class [[gnu::visibility("hidden")]] Watched {  // as the types of pybind11 that it holds
 public:
  Watched();

  FileSystem& files() { return files_; }
  Env& env() { return env_; }
  const std::atomic<bool>& stop() const { return stop_; }

  // For the `watch` of functions that take one; called without the interpreter's lock.
  void look();
  // Behind the work, with the lock: throws what look() met.
  void rethrow();

  template <class Work>
  auto run(Work work) {
    std::optional<decltype(work())> answer;
    {
      const pybind11::gil_scoped_release released;
      repair::for_each_job(
          1, 1, [&](std::size_t) { answer.emplace(work()); }, [this](std::size_t) { look(); });
    }
    rethrow();
    return *std::move(answer);
  }

 private:
  std::atomic<bool> stop_{false};
  bool signalled_ = false;
  std::optional<pybind11::error_already_set> raised_;
  repair::StoppableFiles files_;
  Env env_;
};

}  // namespace sixpoint::python

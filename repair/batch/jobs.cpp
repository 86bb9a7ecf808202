#include "repair/batch/jobs.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace sixpoint::repair {

unsigned threads_of(unsigned jobs) {
  return jobs > 0 ? jobs : std::max(1U, std::thread::hardware_concurrency());
}

void for_each_job(std::size_t count, unsigned jobs, const std::function<void(std::size_t)>& work,
                  const std::function<void(std::size_t)>& watch, const std::atomic<bool>* stop) {
  jobs = threads_of(jobs);
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  std::atomic<std::size_t> ended{0};  // threads
  std::mutex mutex;
  std::exception_ptr defect;  // guarded by mutex
  const auto stopped = [stop] { return stop != nullptr && *stop; };
  const auto run = [&] {
    try {
      for (std::size_t i = next++; i < count && !stopped(); i = next++) {
        work(i);
        ++done;
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      defect = std::current_exception();
      next = count;
    }
    ++ended;
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < jobs && i < count; ++i) {
    try {
      threads.emplace_back(run);
    } catch (const std::system_error&) {
      if (threads.empty()) {
        throw;
      }
      break;  // the system gives no more: those that are there do all the work
    }
  }
  while (ended < threads.size()) {
    watch(done);
    std::this_thread::sleep_for(std::chrono::milliseconds(count - done < jobs ? 2 : 20));
  }
  threads.clear();
  if (defect) {
    std::rethrow_exception(defect);
  }
}

}  // namespace sixpoint::repair

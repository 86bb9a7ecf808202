// Many files, several threads, answers in order.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <thread>
#include <vector>

namespace sixpoint::cli {

// Calls work(i) for every i below `count`, on up to `jobs` threads (0: one per core), and meanwhile
// calls `watch(done)` on the calling thread now and then. `work` must be safe to call from several
// threads for different i.
inline void for_each_job(std::size_t count, unsigned jobs,
                         const std::function<void(std::size_t)>& work,
                         const std::function<void(std::size_t)>& watch) {
  if (jobs == 0) {
    jobs = std::max(1U, std::thread::hardware_concurrency());
  }
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      work(i);
      ++done;
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < jobs && i < count; ++i) {
    threads.emplace_back(run);
  }
  while (done < count) {
    watch(done);
    std::this_thread::sleep_for(std::chrono::milliseconds(count - done < jobs ? 2 : 20));
  }
}

}  // namespace sixpoint::cli

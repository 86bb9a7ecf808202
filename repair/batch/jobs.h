// Work on several threads, watched by the one that asked for it.
//
//   std::vector<int> squares(100);
//   const auto work = [&](std::size_t i) { squares[i] = static_cast<int>(i * i); };
//   for_each_job(squares.size(), 0, work, [](std::size_t done) { std::cout << done << '\n'; });
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

namespace sixpoint::repair {

// More threads than that are asked for by mistake only: refused (usage) by every command, Python and R.
inline constexpr unsigned kMostJobs = 256;

// How many threads `jobs` asks for; 0: one per core.
unsigned threads_of(unsigned jobs);

// Calls work(i) for every i below `count`, on up to `jobs` threads (0: one per core), fewer where the
// system gives no more; std::system_error where it gives none. Meanwhile
// `watch(done)` is called on the calling thread, some fifty times a second. `work` must be safe to
// call from several threads for different i. Once `stop` is set no further i is begun. An exception
// of `work`, a defect, begins no further i and goes to the caller once all threads have ended.
void for_each_job(std::size_t count, unsigned jobs, const std::function<void(std::size_t)>& work,
                  const std::function<void(std::size_t)>& watch,
                  const std::atomic<bool>* stop = nullptr);

}  // namespace sixpoint::repair

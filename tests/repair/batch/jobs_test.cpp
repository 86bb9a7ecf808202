#include "repair/batch/jobs.h"

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace sixpoint::repair {
namespace {

TEST(Jobs, EachIsDoneOnce) {
  std::vector<std::atomic<int>> times(200);
  for_each_job(
      times.size(), 4, [&](std::size_t i) { ++times[i]; }, [](std::size_t) {});
  for (const auto& count : times) {
    EXPECT_EQ(count, 1);
  }
}

// It does not end the program from a thread, where no one can say what happened.
TEST(Jobs, AnExceptionGoesToTheCaller) {
  std::atomic<int> begun{0};
  const auto work = [&](std::size_t i) {
    ++begun;
    if (i == 3) {
      throw std::runtime_error("a defect");
    }
    if (i > 3) {  // so that the others do not come to the end before the thread of 3 goes on
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  };
  EXPECT_THROW(for_each_job(100'000'000, 4, work, [](std::size_t) {}), std::runtime_error);
  EXPECT_LT(begun, 100'000'000) << "no further one was begun";
}

}  // namespace
}  // namespace sixpoint::repair

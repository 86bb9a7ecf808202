#include "repair/batch/jobs.h"

#include <atomic>
#include <stdexcept>
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
  };
  EXPECT_THROW(for_each_job(100'000'000, 4, work, [](std::size_t) {}), std::runtime_error);
  EXPECT_LT(begun, 100'000'000) << "no further one was begun";
}

}  // namespace
}  // namespace sixpoint::repair

#include "cli/stop_request.h"

#include <csignal>

#include <gtest/gtest.h>
#include <pthread.h>

namespace sixpoint::cli {
namespace {

TEST(StopRequest, TakesTheSignalsAndGivesThemBack) {
  sigset_t before;
  sigset_t after;
  pthread_sigmask(SIG_SETMASK, nullptr, &before);
  for (const int signal : {SIGINT, SIGTERM}) {
    StopRequest stop;
    EXPECT_FALSE(stop.requested());
    ASSERT_EQ(pthread_kill(pthread_self(), signal), 0);
    EXPECT_TRUE(stop.requested());
    EXPECT_TRUE(stop.requested()) << "the answer stays";
  }
  pthread_sigmask(SIG_SETMASK, nullptr, &after);
  EXPECT_EQ(sigismember(&before, SIGINT), sigismember(&after, SIGINT));
  StopRequest fresh;
  EXPECT_FALSE(fresh.requested());
}

}  // namespace
}  // namespace sixpoint::cli

#include "cli/stop_request.h"

#include <array>
#include <csignal>
#include <sstream>
#include <utility>

#include <gtest/gtest.h>
#include <pthread.h>
#include <unistd.h>

#include "base/memory_env.h"
#include "cli/context.h"

namespace sixpoint::cli {
namespace {

TEST(StopRequest, TakesTheSignalsAndGivesThemBack) {
  sigset_t before;
  sigset_t after;
  pthread_sigmask(SIG_SETMASK, nullptr, &before);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) {
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

// nohup ignores SIGHUP. Blocked, it would wait all the same.
TEST(StopRequest, LeavesWhatIsIgnoredIgnored) {
  void (*before)(int) = std::signal(SIGHUP, SIG_IGN);
  {
    StopRequest stop;
    ASSERT_EQ(pthread_kill(pthread_self(), SIGHUP), 0);
    EXPECT_FALSE(stop.requested());
  }
  std::signal(SIGHUP, before);
}

TEST(StopRequest, AReaderThatGoesAsksForAnEnd) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  ASSERT_EQ(::close(ends[0]), 0);
  {
    StopRequest stop;
    EXPECT_EQ(::write(ends[1], "x", 1), -1);
    EXPECT_TRUE(stop.requested());
    EXPECT_EQ(::write(ends[1], "x", 1), -1) << "and what follows does not end the program";
  }
  ASSERT_EQ(::close(ends[1]), 0);
}

TEST(StopRequest, OnlySigtermEndsAServiceWithZero) {
  MemoryEnv memory;
  std::stringstream stream;
  for (const auto& [signal, code] :
       {std::pair{SIGTERM, 0}, std::pair{-1, 0}, std::pair{SIGINT, kExitStopped},
        std::pair{SIGHUP, kExitStopped}}) {
    Context context{memory.env, stream, stream, stream};
    take_stop(context, signal);
    EXPECT_EQ(context.exit_code, code) << signal;
  }
}

}  // namespace
}  // namespace sixpoint::cli

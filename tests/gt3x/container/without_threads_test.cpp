// Where the system gives no more threads ("ulimit -u", "ulimit -v"), the caller's does their work.
#include <fstream>
#include <string>
#include <system_error>
#include <thread>

#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include "gt3x/container/pack_line.h"
#include "gt3x/container/piecewise_source.h"
#include "gt3x/container/read_ahead.h"

namespace sixpoint::gt3x {
namespace {

// From here on a new thread's stack has no place.
void take_threads_away() {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, std::size_t{256} << 20);
  pthread_setattr_default_np(&attributes);
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const auto now = pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  const rlimit limit{now + (64U << 20), now + (64U << 20)};
  ::setrlimit(RLIMIT_AS, &limit);
}

// 0: three sources of bytes gave the bytes that went in.
int work_without_threads() {
  take_threads_away();
  try {
    std::thread([] {}).join();
    return 2;  // there are some
  } catch (const std::system_error&) {
  }
  Bytes all(300'000);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i] = static_cast<std::uint8_t>(i * i / 1000);
  }
  SyncPoints points;
  points.piece_size = 100'000;
  Bytes stream;
  PackLine line(2, [&](std::span<const std::uint8_t> packed) -> Status {
    points.packed_sizes.push_back(static_cast<std::uint32_t>(packed.size()));
    stream.insert(stream.end(), packed.begin(), packed.end());
    return {};
  });
  for (std::size_t i = 0; i < 3; ++i) {
    Bytes piece(all.begin() + static_cast<std::ptrdiff_t>(i * points.piece_size),
                all.begin() + static_cast<std::ptrdiff_t>((i + 1) * points.piece_size));
    if (!line.put(piece, i < 2 ? PiecePacker::Place::inner : PiecePacker::Place::last)) {
      return 3;
    }
  }
  if (!line.finish()) {
    return 4;
  }
  ReadAhead source(unpack_pieces(std::make_unique<MemorySource>(stream), points, all.size()));
  const auto read = read_all(source, 1U << 20);
  return read && *read == all ? 0 : 5;
}

TEST(WithoutThreads, TheCallerDoesTheWork) {
  EXPECT_EXIT(::_exit(work_without_threads()), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace sixpoint::gt3x

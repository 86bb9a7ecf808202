// Runs the tests under umockdev's preload library. Exit code 77, and a line that names the package,
// where it is not installed; 1 where SIXPOINT_MUST_NOT_SKIP is set, as scripts/test.sh does after
// it installed everything.
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include <gtest/gtest.h>

#include "mocks/umockdev/umockdev_bus.h"

// umockdev's own thread, in which the virtual units hash, may still be ending when the leak
// sanitizer looks: libcrypto's error state of a thread goes with the thread. Leaks of contexts show
// in the mocks' own tests.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:CRYPTO_zalloc"; }

int main(int argc, char** argv) {
  // ctest lists the tests before it runs them: that needs nothing.
  const bool only_listed = argc > 1 && std::string_view(argv[1]).starts_with("--gtest_list_tests");
  if (only_listed) {
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
  }
  if (const auto why = sixpoint::mocks::UmockdevBus::enter(argv); !why.empty()) {
    std::fprintf(stderr, "SKIPPED: %s\n", why.c_str());
    return std::getenv("SIXPOINT_MUST_NOT_SKIP") != nullptr ? 1 : 77;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}

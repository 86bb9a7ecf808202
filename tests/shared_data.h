// Where the real recordings are, and the loud skip where they are not.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

namespace sixpoint::tests {

// ../shared beside the checkout, or $SIXPOINT_SHARED.
inline std::filesystem::path shared_folder() {
  const char* chosen = std::getenv("SIXPOINT_SHARED");
  return chosen != nullptr ? std::filesystem::path(chosen)
                           : std::filesystem::path(SIXPOINT_SOURCE_DIR) / ".." / "shared";
}

inline std::string shared_file(const std::string& relative) {
  return (shared_folder() / relative).string();
}

}  // namespace sixpoint::tests

// First line of a test that needs a real recording. The recordings belong to others and may not be
// copied into the project, so a checkout alone has none. Without them the test cannot say anything,
// and says so; scripts/test.sh counts and prints these skips. Where SIXPOINT_MUST_HAVE_SHARED is
// set, as in CI, that is a failure.
#define SIXPOINT_NEED_SHARED(relative)                                                            \
  if (!std::filesystem::exists(::sixpoint::tests::shared_file(relative))) {                       \
    ASSERT_EQ(std::getenv("SIXPOINT_MUST_HAVE_SHARED"), nullptr)                                  \
        << "the recording " << (relative) << " is not in " << ::sixpoint::tests::shared_folder(); \
    GTEST_SKIP() << "SKIPPED, NOT PASSED: the recording " << (relative) << " is not in "          \
                 << ::sixpoint::tests::shared_folder()                                            \
                 << "; put the shared folder beside the checkout or set SIXPOINT_SHARED";         \
  }                                                                                               \
  static_assert(true)

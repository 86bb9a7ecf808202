// A test that needs something that a developer's machine may lack (a PostgreSQL server, the right
// to make devices); `why` names it. Where SIXPOINT_MUST_NOT_SKIP is set, as in CI after everything
// was installed and as root, that is a failure (tests/skip.sh does so for scripts).
#pragma once

#include <cstdlib>

#include <gtest/gtest.h>

#define SIXPOINT_SKIP_UNLESS(there, why)                              \
  if (!(there)) {                                                     \
    ASSERT_EQ(std::getenv("SIXPOINT_MUST_NOT_SKIP"), nullptr) << why; \
    GTEST_SKIP() << "SKIPPED: " << why;                               \
  }                                                                   \
  static_assert(true)

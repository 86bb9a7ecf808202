// Assertions on Result<T> that print the error.
#pragma once

#include <gtest/gtest.h>

#include "base/result.h"

#define ASSERT_OK(result) ASSERT_TRUE((result).has_value()) << (result).error().brief()
#define EXPECT_OK(result) EXPECT_TRUE((result).has_value()) << (result).error().brief()
#define EXPECT_FAILS(result, expected_code)                                                        \
  do {                                                                                             \
    const auto& sixpoint_result = (result);                                                        \
    EXPECT_FALSE(sixpoint_result.has_value());                                                     \
    if (!sixpoint_result.has_value()) {                                                            \
      EXPECT_EQ(sixpoint_result.error().code, (expected_code)) << sixpoint_result.error().brief(); \
      EXPECT_FALSE(sixpoint_result.error().what.empty());                                          \
      EXPECT_FALSE(sixpoint_result.error().hint.empty())                                           \
          << "an error must say what to do: " << sixpoint_result.error().brief();                  \
    }                                                                                              \
  } while (false)

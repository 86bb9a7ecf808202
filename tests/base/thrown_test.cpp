#include "base/thrown.h"

#include <new>
#include <stdexcept>
#include <system_error>

#include <gmock/gmock.h>

namespace sixpoint {
namespace {

// Oracle: the table of error_of(). What C++ and the system throw where memory or threads end.
TEST(Thrown, ALimitOfTheMachineIsNoDefectOfTheProgram) {
  const auto of_system = [](std::errc code) {
    return std::system_error(std::make_error_code(code));
  };
  const Error no_memory = error_of(std::bad_alloc());
  EXPECT_EQ(no_memory.code, ErrorCode::io);
  EXPECT_EQ(no_memory.what, "not enough memory");
  EXPECT_THAT(no_memory.hint, testing::HasSubstr("ulimit -v"));
  EXPECT_EQ(error_of(std::bad_array_new_length()).what, no_memory.what);
  EXPECT_EQ(error_of(of_system(std::errc::not_enough_memory)).what, no_memory.what);
  const Error no_thread = error_of(of_system(std::errc::resource_unavailable_try_again));
  EXPECT_EQ(no_thread.code, ErrorCode::io);
  EXPECT_THAT(no_thread.what, testing::HasSubstr("no more threads"));
  EXPECT_THAT(no_thread.hint, testing::HasSubstr("--jobs"));
  for (const Error& defect :
       {error_of(std::logic_error("odd")), error_of(of_system(std::errc::invalid_argument))}) {
    EXPECT_EQ(defect.code, ErrorCode::internal);
    EXPECT_THAT(defect.what, testing::StartsWith("internal error: "));
    EXPECT_THAT(defect.hint, testing::HasSubstr("please report it"));
  }
}

}  // namespace
}  // namespace sixpoint

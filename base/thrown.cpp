#include "base/thrown.h"

#include <new>
#include <system_error>

#include <fmt/format.h>

namespace sixpoint {

Error error_of(const std::exception& exception) {
  constexpr const char* kNoMemory = "not enough memory";
  constexpr const char* kMoreMemory =
      "end other programs, raise the limit ('ulimit -v', or the batch system's), or work on fewer "
      "files at a time (--jobs)";
  if (dynamic_cast<const std::bad_alloc*>(&exception) != nullptr) {
    return {ErrorCode::io, kNoMemory, "", kMoreMemory};
  }
  if (const auto* of_system = dynamic_cast<const std::system_error*>(&exception)) {
    if (of_system->code() == std::errc::not_enough_memory) {
      return {ErrorCode::io, kNoMemory, "", kMoreMemory};
    }
    if (of_system->code() == std::errc::resource_unavailable_try_again) {
      return {ErrorCode::io, "the system gives this program no more threads", "",
              "end other programs, raise the limits ('ulimit -u', 'ulimit -v'), or work on fewer "
              "files at a time (--jobs)"};
    }
  }
  return {ErrorCode::internal, fmt::format("internal error: {}", printable(exception.what())), "",
          "please report it with the command line"};
}

Error error_of(const std::exception_ptr& thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const std::exception& exception) {
    return error_of(exception);
  }
}

}  // namespace sixpoint

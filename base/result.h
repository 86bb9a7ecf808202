// Result<T>: a value, or the Error that explains why there is none.
//
//   Result<double> to_g(int count, double scale_lsb_per_g) {
//     if (scale_lsb_per_g <= 0) return fail(ErrorCode::bad_data, "the scale is not positive");
//     return count / scale_lsb_per_g;
//   }
//   Status add_g(double& sum_g, int count) {
//     SIXPOINT_ASSIGN(const double value_g, to_g(count, 256));  // an error goes to the caller
//     sum_g += value_g;
//     return {};
//   }
#pragma once

#include <string>
#include <utility>

#include <tl/expected.hpp>

#include "base/error.h"

namespace sixpoint {

template <class T>
using Result = tl::expected<T, Error>;

// For functions that have nothing to return but whether they succeeded.
using Status = Result<void>;

// return fail(ErrorCode::bad_data, "not a zip archive", path, "download the file again");
inline tl::unexpected<Error> fail(ErrorCode code, std::string what, std::string where = {},
                                  std::string hint = {}) {
  return tl::unexpected<Error>(Error{code, std::move(what), std::move(where), std::move(hint)});
}
inline tl::unexpected<Error> fail(Error error) { return tl::unexpected<Error>(std::move(error)); }

}  // namespace sixpoint

// NOLINTBEGIN(bugprone-macro-parentheses): a declaration cannot stand in parentheses.
// The two ways to pass an error on to the caller:
//   SIXPOINT_CHECK(file->sync());                     for a Status (or to ignore the value)
//   SIXPOINT_ASSIGN(const auto header, parse(bytes));  for a Result<T>
#define SIXPOINT_CONCAT_INNER(a, b) a##b
#define SIXPOINT_CONCAT(a, b) SIXPOINT_CONCAT_INNER(a, b)
#define SIXPOINT_CHECK(expression) \
  SIXPOINT_CHECK_INNER(expression, SIXPOINT_CONCAT(sixpoint_status_, __LINE__))
#define SIXPOINT_CHECK_INNER(expression, status)                             \
  do {                                                                       \
    if (auto status = (expression); !status) {                               \
      return ::tl::unexpected<::sixpoint::Error>(std::move(status).error()); \
    }                                                                        \
  } while (false)
#define SIXPOINT_ASSIGN(declaration, expression) \
  SIXPOINT_ASSIGN_INNER(declaration, expression, SIXPOINT_CONCAT(sixpoint_result_, __LINE__))
#define SIXPOINT_ASSIGN_INNER(declaration, expression, result)                          \
  auto result = (expression);                                                           \
  if (!(result)) return ::tl::unexpected<::sixpoint::Error>(std::move(result).error()); \
  declaration = *std::move(result)
// NOLINTEND(bugprone-macro-parentheses)

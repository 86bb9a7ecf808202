// Errors of the project as exceptions of Python.
//
//   const gt3x::Recording recording = value_or_throw(gt3x::Recording::open(files, path));
//
// register_failures() makes a Failure that leaves a function an exception of sixpoint._errors.
#pragma once

#include <stdexcept>
#include <utility>

#include <pybind11/pybind11.h>

#include "base/result.h"

namespace sixpoint::python {

struct Failure : std::runtime_error {
  explicit Failure(Error what_happened)
      : std::runtime_error(what_happened.brief()), error(std::move(what_happened)) {}
  Error error;
};

template <class Value>
Value value_or_throw(Result<Value> result) {
  if (!result) {
    throw Failure(std::move(result).error());
  }
  if constexpr (!std::is_void_v<Value>) {
    return *std::move(result);
  }
}

void register_failures(pybind11::module_& module);

}  // namespace sixpoint::python

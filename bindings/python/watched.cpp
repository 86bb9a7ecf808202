#include "bindings/python/watched.h"

namespace sixpoint::python {

namespace py = pybind11;

Watched::Watched()
    : files_(posix_env().files, stop_), env_{posix_env().clock, files_, posix_env().seed} {}

void Watched::look() {
  if (signalled_) {
    return;
  }
  const py::gil_scoped_acquire acquired;
  if (PyErr_CheckSignals() != 0) {
    raised_.emplace();
    signalled_ = true;
    stop_ = true;
  }
}

void Watched::rethrow() {
  if (signalled_) {
    raised_->restore();
    raised_.reset();
    throw py::error_already_set();
  }
}

}  // namespace sixpoint::python

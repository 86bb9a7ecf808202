#include "bindings/python/failures.h"

#include "bindings/python/values.h"

namespace sixpoint::python {

namespace py = pybind11;

void register_failures(py::module_& /*module*/) {
  // NOLINTNEXTLINE(performance-unnecessary-value-param): the type is pybind11's.
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) {
        std::rethrow_exception(thrown);
      }
    } catch (const Failure& failure) {
      const Error& error = failure.error;
      const py::object made =
          py::module_::import("sixpoint._errors")
              .attr("error_of")(std::string(to_string(error.code)), text_of(error.what),
                                text_of(error.where), text_of(error.hint));
      PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(made.ptr())), made.ptr());
    }
  });
}

}  // namespace sixpoint::python

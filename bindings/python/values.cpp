#include "bindings/python/values.h"

#include <cmath>
#include <cstdint>
#include <string>

namespace sixpoint::python {

namespace py = pybind11;
using repair::Json;

namespace {

py::object object_of(const Json& json) {
  switch (json.type()) {
    case Json::value_t::object:
      return dict_of(json);
    case Json::value_t::array: {
      py::list list;
      for (const Json& value : json) {
        list.append(object_of(value));
      }
      return list;
    }
    case Json::value_t::string:
      return text_of(json.get_ref<const std::string&>());
    case Json::value_t::boolean:
      return py::bool_(json.get<bool>());
    case Json::value_t::number_integer:
      return py::int_(json.get<std::int64_t>());
    case Json::value_t::number_unsigned:
      return py::int_(json.get<std::uint64_t>());
    case Json::value_t::number_float: {
      const auto number = json.get<double>();
      return std::isfinite(number) ? py::object(py::float_(number)) : py::object(py::none());
    }
    default:
      return py::none();
  }
}

Json number_of(py::handle value) {
  const auto whole = PyLong_AsUnsignedLongLong(value.ptr());
  if (PyErr_Occurred() == nullptr) {
    return whole;
  }
  PyErr_Clear();  // below 0, or above what 64 bits hold
  const double number = PyLong_AsDouble(value.ptr());
  PyErr_Clear();
  return number;
}

}  // namespace

py::str text_of(std::string_view bytes) {
  PyObject* const text =
      PyUnicode_DecodeUTF8(bytes.data(), static_cast<Py_ssize_t>(bytes.size()), "surrogateescape");
  if (text == nullptr) {
    throw py::error_already_set();
  }
  return py::reinterpret_steal<py::str>(text);
}

py::dict dict_of(const Json& json) {
  py::dict dict;
  for (const auto& [key, value] : json.items()) {
    dict[text_of(key)] = object_of(value);
  }
  return dict;
}

Json json_of(py::handle value) {
  if (value.is_none()) {
    return nullptr;
  }
  if (py::isinstance<py::dict>(value)) {
    Json json = Json::object();
    for (const auto& [key, inner] : py::reinterpret_borrow<py::dict>(value)) {
      json[py::cast<std::string>(key)] = json_of(inner);
    }
    return json;
  }
  if (py::isinstance<py::bool_>(value)) {  // before int: a bool is one
    return py::cast<bool>(value);
  }
  if (py::isinstance<py::int_>(value)) {
    return number_of(value);
  }
  if (py::isinstance<py::float_>(value)) {
    return py::cast<double>(value);
  }
  if (py::isinstance<py::bytes>(value) || py::isinstance<py::str>(value)) {
    return py::cast<std::string>(value);
  }
  throw py::type_error("an option has a value of type " +
                       std::string(Py_TYPE(value.ptr())->tp_name));
}

}  // namespace sixpoint::python

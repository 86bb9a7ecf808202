// The extension module sixpoint._core: what the Python files of the package call. Answers are JSON
// documents as dicts, which sixpoint/_answers.py turns into dataclasses.
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "base/bytes.h"
#include "bindings/python/failures.h"
#include "bindings/python/reading.h"
#include "bindings/python/values.h"
#include "bindings/python/watched.h"
#include "calib/poses/efficiency.h"
#include "calib/poses/gravity.h"
#include "calib/solve.h"
#include "gt3x/container/byte_source.h"
#include "gt3x/recording.h"
#include "repair/batch/answers.h"
#include "repair/batch/requests.h"
#include "repair/rescale/constants_finder.h"
#include "repair/triage/inspection.h"
#include "repair/triage/survey.h"

namespace sixpoint::python {
namespace {

namespace py = pybind11;
using repair::Json;

gt3x::RowValue value_of(const std::string& unit, const std::string& dtype) {
  if (unit == "lsb") {
    return gt3x::RowValue::lsb_int16;
  }
  return dtype == "float32" ? gt3x::RowValue::g_float32 : gt3x::RowValue::g_float64;
}

std::unique_ptr<Reading> open_reading(const std::string& path, const std::string& unit,
                                      const std::string& dtype, bool fill,
                                      std::uint64_t fill_limit_s, bool salvage) {
  ReadingOptions options;
  options.value = value_of(unit, dtype);
  options.stream.raw_lsb = unit == "lsb";
  options.stream.fill = fill;
  options.stream.fill_limit_s = fill_limit_s;
  options.salvage = salvage;
  return std::make_unique<Reading>(path, options);
}

py::dict inspect(const std::string& path, bool salvage) {
  Watched watched;
  const auto found = watched.run([&] {
    return repair::inspect(watched.files(), path, {salvage, {}});
  });
  return dict_of(repair::inspection_to_json(value_or_throw(found), path));
}

// The bytes of a small entry of a recording; nothing where it has none of this name.
std::optional<py::bytes> entry(const std::string& path, const std::string& name) {
  const auto bytes = [&]() -> std::optional<Bytes> {
    const py::gil_scoped_release released;
    gt3x::Recording recording = value_or_throw(gt3x::Recording::open(posix_env().files, path));
    if (!recording.has_entry(name)) {
      return std::nullopt;
    }
    const auto source = value_or_throw(recording.open_entry(name));
    return value_or_throw(gt3x::read_all(*source, 1U << 20U));
  }();
  return bytes ? std::optional(py::bytes(std::string(as_text(*bytes)))) : std::nullopt;
}

// The answer of run_scan() and run_repair(), which are watched on this thread.
template <class Request>
py::dict answer_of(const std::vector<std::string>& paths, const py::dict& options, Request request,
                   Result<Json> (*run)(Env&, const Request&, const repair::Watching&)) {
  request.paths = paths;
  value_or_throw(repair::take_parsed_options(json_of(options), request));
  Watched watched;
  const auto answer = [&] {
    const py::gil_scoped_release released;
    return run(watched.env(), request, {[&](std::size_t) { watched.look(); }, &watched.stop()});
  }();
  watched.rethrow();
  return dict_of(value_or_throw(answer));
}

py::dict scan(const std::vector<std::string>& paths, const py::dict& options) {
  return answer_of(paths, options, repair::ScanRequest{}, &repair::run_scan);
}

py::dict repair_into(const std::vector<std::string>& paths, const std::string& folder,
                     const py::dict& options) {
  repair::RepairRequest request;
  request.folder = folder;
  return answer_of(paths, options, std::move(request), &repair::run_repair);
}

py::dict solve(const std::string& path, const std::string& method,
               std::optional<std::uint64_t> seed, bool strict_nonzero, bool population_prior,
               std::optional<double> gravity_m_per_s2, std::optional<double> latitude_deg,
               std::optional<double> altitude_m) {
  Watched watched;
  auto report = watched.run([&]() -> Result<calib::SolveReport> {
    calib::SolveOptions options;
    SIXPOINT_ASSIGN(options.method, calib::parse_solve_method(method));
    options.seed = seed.value_or(options.seed);
    SIXPOINT_ASSIGN(const auto gravity,
                    calib::local_gravity({gravity_m_per_s2, latitude_deg, altitude_m}));
    if (gravity) {
      options.gravity_g = gravity->g();
      options.gravity_sd_g = gravity->sd_g();
    }
    calib::StillBlockOptions still;
    still.strict_nonzero = strict_nonzero;
    SIXPOINT_ASSIGN(const repair::Survey found, repair::survey(watched.files(), path, still));
    if (population_prior) {
      const auto filter =
          repair::filter_in_force(found.facts).value_or(calib::FilterConfiguration::current);
      SIXPOINT_ASSIGN(options.prior, calib::population_prior(found.facts.serial, filter));
    }
    const auto start = posix_env().clock.elapsed();
    SIXPOINT_ASSIGN(auto solved, repair::solve_survey(path, found, options));
    solved.seconds = std::chrono::duration<double>(posix_env().clock.elapsed() - start).count();
    return solved;
  });
  Json json;
  json["file"] = path;
  json.update(calib::solve_json(value_or_throw(std::move(report))));
  return dict_of(json);
}

}  // namespace
}  // namespace sixpoint::python

PYBIND11_MODULE(_core, module) {
  namespace py = pybind11;
  using namespace sixpoint::python;
  register_failures(module);
  py::class_<Reading>(module, "Reading")
      .def(py::init(&open_reading), py::arg("path"), py::arg("unit"), py::arg("dtype"),
           py::arg("fill"), py::arg("fill_limit_s"), py::arg("salvage"))
      .def("read_all", &Reading::read_all)
      .def("block", &Reading::block, py::arg("most"))
      .def("times_ns", &Reading::times_ns, py::arg("first_row"), py::arg("rows"))
      .def("rows", &Reading::rows)
      .def("runs", &Reading::runs)
      .def("rate_hz", &Reading::rate_hz)
      .def("gaps", &Reading::gaps)
      .def("facts", &Reading::facts)
      .def("info", &Reading::info);
  module.def("inspect", &inspect, py::arg("path"), py::arg("salvage"));
  module.def("entry", &entry, py::arg("path"), py::arg("name"));
  module.def("scan", &scan, py::arg("paths"), py::arg("options"));
  module.def("solve", &solve, py::arg("path"), py::arg("method"), py::arg("seed"),
             py::arg("strict_nonzero"), py::arg("population_prior"), py::arg("gravity_m_per_s2"),
             py::arg("latitude_deg"), py::arg("altitude_m"));
  module.def("times_of_runs", &times_of_runs, py::arg("runs"), py::arg("rate_hz"), py::arg("rows"));
  module.def("repair", &repair_into, py::arg("paths"), py::arg("folder"), py::arg("options"));
}

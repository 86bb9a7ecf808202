// The extension module sixpoint._core: what the Python files of the package call. Answers are JSON
// documents, which sixpoint/_answers.py turns into dataclasses.
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "bindings/python/failures.h"
#include "bindings/python/reading.h"
#include "bindings/python/watched.h"
#include "calib/solve.h"
#include "db/store.h"
#include "repair/batch/answers.h"
#include "repair/batch/repair_files.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/known_calibration.h"
#include "repair/triage/scan_file.h"

namespace sixpoint::python {
namespace {

namespace py = pybind11;
using repair::Json;

// Paths may hold bytes that are no UTF-8.
std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

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

std::string inspect(const std::string& path, bool salvage) {
  Watched watched;
  const auto found = watched.run([&] {
    return repair::inspect(watched.files(), path, {salvage, {}});
  });
  return text_of(repair::inspection_to_json(value_or_throw(found), path));
}

std::string scan(const std::vector<std::string>& paths, unsigned jobs, const std::string& store) {
  Watched watched;
  std::optional<db::Store> opened;
  if (!store.empty()) {
    opened = value_or_throw(db::Store::open_to_read(posix_env(), store));
  }
  std::mutex mutex;
  const auto date_of = [&](const std::string& serial) -> repair::KnownDate {
    if (!opened) {
      return {};
    }
    const std::scoped_lock lock(mutex);
    const auto history = opened->unit_history(serial);
    return history ? repair::calibration_date(*history)
                   : repair::KnownDate{std::nullopt, history.error().brief()};
  };
  std::vector<repair::ScannedFile> scanned;
  {
    const py::gil_scoped_release released;
    const auto named =
        repair::named_files(watched.files(), paths, {".gt3x", ".agdc", ".agd"}).files;
    scanned.resize(named.size());
    repair::for_each_job(
        named.size(), jobs,
        [&](std::size_t i) {
          scanned[i] = named[i].error ? repair::unreadable_file(named[i].path, *named[i].error)
                                      : repair::scan_file(watched.files(), named[i].path, date_of);
        },
        [&](std::size_t) { watched.look(); }, &watched.stop());
  }
  watched.rethrow();
  Json json;
  json["files"] = Json::array();
  for (const repair::ScannedFile& file : scanned) {
    json["files"].push_back(repair::scanned_to_json(file));
  }
  json["summary"] = repair::scan_summary(scanned);
  return text_of(json);
}

std::string solve(const std::string& path, const std::string& method,
                  std::optional<std::uint64_t> seed, bool strict_nonzero, bool population_prior) {
  Watched watched;
  auto report = watched.run([&]() -> Result<calib::SolveReport> {
    calib::SolveOptions options;
    SIXPOINT_ASSIGN(options.method, calib::parse_solve_method(method));
    options.seed = seed.value_or(options.seed);
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
  json.update(calib::to_json(value_or_throw(std::move(report))));
  return text_of(json);
}

struct RepairSources {
  std::string constants;
  std::string calibration_file;
  std::string store;
  bool scan = false;
  bool or_scan = false;
};

std::string repair_into(const std::vector<std::string>& paths, const std::string& folder,
                        const RepairSources& sources, repair::RepairOptions how, unsigned jobs) {
  Watched watched;
  std::optional<db::Store> store;
  std::vector<repair::RepairReport> reports;
  {
    const py::gil_scoped_release released;
    repair::ConstantsFinderOptions finder;
    finder.still = how.still;
    finder.scan = sources.scan;
    finder.or_scan = sources.or_scan;
    finder.store_named = !sources.store.empty();
    finder.allow_prior = how.allow_prior;
    if (!sources.constants.empty()) {
      finder.given = value_or_throw(repair::read_constants(watched.files(), sources.constants));
    }
    if (!sources.store.empty()) {
      store = value_or_throw(db::Store::open_to_read(posix_env(), sources.store));
      finder.store = &*store;
    }
    if (!sources.calibration_file.empty()) {
      value_or_throw(watched.files().info(sources.calibration_file));
      finder.calibration_file = sources.calibration_file;
    }
    repair::ConstantsFinder constants(watched.env(), std::move(finder));
    auto named = repair::named_files(watched.files(), paths, {".gt3x"}).files;
    repair::refuse_same_outputs(named, folder);
    reports = repair::repair_files(
        watched.env(), named, {folder, how, jobs}, constants, [&](std::size_t) { watched.look(); },
        &watched.stop());
  }
  watched.rethrow();
  Json json;
  json["files"] = Json::array();
  for (const repair::RepairReport& report : reports) {
    json["files"].push_back(report.to_json());
  }
  json["summary"] = repair::repair_summary(repair::count_by_status(reports), how.dry_run);
  return text_of(json);
}

std::string repair_call(const std::vector<std::string>& paths, const std::string& folder,
                        const py::dict& options) {
  RepairSources sources;
  repair::RepairOptions how;
  unsigned jobs = 0;
  const auto take = [&](const char* name, auto& value) {
    value = options[name].cast<std::remove_reference_t<decltype(value)>>();
  };
  take("constants", sources.constants);
  take("calibration_file", sources.calibration_file);
  take("store", sources.store);
  take("scan", sources.scan);
  take("or_scan", sources.or_scan);
  take("wide", how.wide);
  take("store_only", how.store_only);
  take("undo_rotation", how.undo_rotation);
  take("allow_prior", how.allow_prior);
  take("salvage", how.salvage);
  take("force", how.force);
  take("dry_run", how.dry_run);
  take("resume", how.resume);
  take("redo_outdated", how.redo_outdated);
  take("jobs", jobs);
  return repair_into(paths, folder, sources, how, jobs);
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
      .def("gaps", &Reading::gaps)
      .def("facts", &Reading::facts)
      .def("info", &Reading::info);
  module.def("inspect", &inspect, py::arg("path"), py::arg("salvage"));
  module.def("scan", &scan, py::arg("paths"), py::arg("jobs"), py::arg("store"));
  module.def("solve", &solve, py::arg("path"), py::arg("method"), py::arg("seed"),
             py::arg("strict_nonzero"), py::arg("population_prior"));
  module.def("repair", &repair_call, py::arg("paths"), py::arg("folder"), py::arg("options"));
}

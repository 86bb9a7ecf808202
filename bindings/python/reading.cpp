#include "bindings/python/reading.h"

#include <memory>
#include <span>
#include <utility>

#include "bindings/python/failures.h"
#include "bindings/python/values.h"
#include "repair/batch/answers.h"
#include "repair/batch/reading.h"

namespace sixpoint::python {

namespace py = pybind11;

namespace {

py::dtype dtype_of(gt3x::RowValue value) {
  switch (value) {
    case gt3x::RowValue::lsb_int16:
      return py::dtype::of<std::int16_t>();
    case gt3x::RowValue::g_float32:
      return py::dtype::of<float>();
    case gt3x::RowValue::g_float64:
      break;
  }
  return py::dtype::of<double>();
}

// An array that takes the memory over.
py::array array_of(gt3x::RowArray rows, gt3x::RowValue value) {
  const auto shape = std::vector<py::ssize_t>{static_cast<py::ssize_t>(rows.rows), 3};
  if (rows.rows == 0) {
    return {dtype_of(value), shape};
  }
  void* const memory = rows.data.release();
  const py::capsule owner(memory, [](void* held) { std::free(held); });
  return {dtype_of(value), shape, memory, owner};
}

template <class Row>
Result<std::size_t> read_rows(gt3x::SampleStream& stream, void* memory, std::size_t most) {
  return stream.read(std::span(static_cast<Row*>(memory), most));
}

}  // namespace

Reading::Reading(const std::string& path, const ReadingOptions& options)
    : path_(path), options_(options) {
  const py::gil_scoped_release released;
  recording_.emplace(
      value_or_throw(gt3x::Recording::open(posix_env().files, path, {options.salvage, {}})));
  stream_.emplace(value_or_throw(gt3x::SampleStream::open(*recording_, options.stream)));
}

py::array Reading::read_all() {
  bool signalled = false;
  gt3x::RowArrayOptions how;
  how.most_bytes = repair::half_of_memory();
  how.go_on = [&]() -> Status {
    const py::gil_scoped_acquire acquired;
    signalled = PyErr_CheckSignals() != 0;
    return signalled ? Status(fail(ErrorCode::io, "it was stopped", path_, "read it again"))
                     : Status();
  };
  auto rows = [&] {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    return gt3x::read_all_rows(*stream_, options_.value, how);
  }();
  if (signalled) {
    throw py::error_already_set();
  }
  return array_of(value_or_throw(std::move(rows)), options_.value);
}

py::array Reading::block(std::size_t most) {
  py::array rows(dtype_of(options_.value),
                 std::vector<py::ssize_t>{static_cast<py::ssize_t>(most), 3});
  void* const memory = rows.mutable_data();
  const std::size_t count = value_or_throw([&] {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    switch (options_.value) {
      case gt3x::RowValue::lsb_int16:
        return read_rows<gt3x::Counts>(*stream_, memory, most);
      case gt3x::RowValue::g_float32:
        return read_rows<PerAxis<float>>(*stream_, memory, most);
      case gt3x::RowValue::g_float64:
        break;
    }
    return read_rows<PerAxis<double>>(*stream_, memory, most);
  }());
  if (PyErr_CheckSignals() != 0) {
    throw py::error_already_set();
  }
  if (count < most) {
    rows.resize({static_cast<py::ssize_t>(count), py::ssize_t{3}});
  }
  return rows;
}

py::array Reading::times_ns(std::uint64_t first_row, std::uint64_t rows) {
  py::array_t<std::int64_t> times(static_cast<py::ssize_t>(rows));
  std::int64_t* const memory = times.mutable_data();
  const py::gil_scoped_release released;
  const std::scoped_lock lock(mutex_);
  gt3x::row_times_ns(stream_->runs(), stream_->rate_hz(), first_row,
                     std::span(memory, static_cast<std::size_t>(rows)));
  return times;
}

std::uint64_t Reading::rows() const { return stream_->rows(); }

std::uint64_t Reading::rate_hz() const { return stream_->rate_hz(); }

py::array Reading::runs() const {
  const auto& runs = stream_->runs();
  py::array_t<std::int64_t> list({static_cast<py::ssize_t>(runs.size()), py::ssize_t{2}});
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const auto row = static_cast<py::ssize_t>(i);
    list.mutable_at(row, 0) = static_cast<std::int64_t>(runs[i].first_row);
    list.mutable_at(row, 1) = runs[i].unix_time;
  }
  return list;
}

py::dict Reading::facts() {
  const repair::Inspection found = [this] {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    return value_or_throw(repair::reading_of(*recording_, *stream_, options_.salvage));
  }();
  gaps_ = found.gaps;
  return dict_of(repair::inspection_to_json(found, path_));
}

py::list Reading::gaps() const {
  py::list gaps;
  for (const gt3x::Gap& gap : gaps_) {
    gaps.append(
        py::make_tuple(gap.start, gap.seconds, std::string(gt3x::to_string(gap.kind)), gap.filled));
  }
  return gaps;
}

py::list Reading::info() const {
  py::list pairs;
  for (const auto& [key, value] : recording_->info().pairs()) {
    pairs.append(py::make_tuple(py::bytes(key), py::bytes(value)));
  }
  return pairs;
}

py::array times_of_runs(const py::array_t<std::int64_t, py::array::c_style>& runs,
                        std::uint64_t rate_hz, std::uint64_t rows) {
  if (runs.ndim() != 2 || runs.shape(1) != 2 || rate_hz == 0 || (rows > 0 && runs.shape(0) == 0)) {
    throw py::value_error("these are no runs of rows");
  }
  std::vector<gt3x::RowRun> list;
  for (py::ssize_t i = 0; i < runs.shape(0); ++i) {
    list.push_back(
        {static_cast<std::uint64_t>(runs.at(i, 0)), static_cast<std::uint32_t>(runs.at(i, 1))});
  }
  py::array_t<std::int64_t> times(static_cast<py::ssize_t>(rows));
  std::int64_t* const memory = times.mutable_data();
  const py::gil_scoped_release released;
  gt3x::row_times_ns(list, rate_hz, 0, std::span(memory, static_cast<std::size_t>(rows)));
  return times;
}

}  // namespace sixpoint::python

// read() and stream() of the package.
//
//   Reading reading("unit.gt3x", options);  // opens it
//   reading.read_all();                     // or block after block: reading.block(100'000)
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "gt3x/recording.h"
#include "gt3x/rows/sample_stream.h"

namespace sixpoint::python {

struct ReadingOptions {
  gt3x::RowValue value = gt3x::RowValue::g_float64;
  gt3x::SampleStreamOptions stream;
  bool salvage = false;
};

// Safe to call from several threads, one call after the other.
class Reading {
 public:
  Reading(const std::string& path, const ReadingOptions& options);

  // All rows, n x 3. The array owns its memory.
  pybind11::array read_all();
  // The next rows, at most `most`; none at the end.
  pybind11::array block(std::size_t most);
  // Of the rows before this call's block and of it: nanoseconds since 1970 by the file's clock.
  pybind11::array times_ns(std::uint64_t first_row, std::uint64_t rows);
  std::uint64_t rows() const;

  std::uint64_t rate_hz() const;
  pybind11::array runs() const;  // of the rows so far, m x 2: first row, Unix time (gt3x::RowRun)

  // Behind the end: a JSON document, as repair::reading_of().
  pybind11::dict facts();
  pybind11::list gaps() const;  // behind facts(): (Unix time, seconds, kind, filled)
  pybind11::list info() const;  // pairs of info.txt

 private:
  std::string path_;
  std::mutex mutex_;  // two threads of Python may share one object
  ReadingOptions options_;
  std::optional<gt3x::Recording> recording_;
  std::optional<gt3x::SampleStream> stream_;
  std::vector<gt3x::Gap> gaps_;
};

// Reading::times_ns(0, rows) by what Reading::runs() and rate_hz() were; the reading may be gone.
pybind11::array times_of_runs(const pybind11::array_t<std::int64_t, pybind11::array::c_style>& runs,
                              std::uint64_t rate_hz, std::uint64_t rows);

}  // namespace sixpoint::python

#include "bindings/r/calls.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "gt3x/recording.h"
#include "gt3x/rows/sample_stream.h"
#include "repair/batch/answers.h"
#include "repair/batch/reading.h"
#include "repair/batch/requests.h"
#include "repair/batch/stoppable_files.h"

namespace {

using sixpoint::Error;
using sixpoint::ErrorCode;
using sixpoint::PerAxis;
using sixpoint::Result;
using sixpoint::Status;
using sixpoint::repair::Json;
namespace gt3x = sixpoint::gt3x;
namespace repair = sixpoint::repair;

// For C: freed by free(). Paths may hold bytes that are no UTF-8.
char* text_for_c(const Json& json) {
  return strdup(json.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
}

char* error_for_c(const Error& error) { return text_for_c(repair::error_document(error)); }

char* stopped() {
  Json json = repair::error_document({ErrorCode::io, "it was stopped", {}, "run it again"});
  json["code"] = "stopped";
  return text_for_c(json);
}

// No exception of C++ may pass through R.
template <class Work>
char* guarded(Work work) {
  try {
    return work();
  } catch (const std::exception& thrown) {
    return error_for_c({ErrorCode::internal, thrown.what(), {}, "report it with the file"});
  }
}

// The answer of run_scan() and run_repair(), watched on this thread.
template <class Request>
char* answer_for_c(const char* const* paths, int count, const char* options, Request request,
                   Result<Json> (*run)(sixpoint::Env&, const Request&, const repair::Watching&),
                   sixpoint_stop stop, char** json) {
  request.paths.assign(paths, paths + count);
  if (const Status taken = repair::take_options(options, request); !taken) {
    return error_for_c(taken.error());
  }
  std::atomic<bool> stopping{false};
  sixpoint::Env& posix = sixpoint::posix_env();
  repair::StoppableFiles files(posix.files, stopping);
  sixpoint::Env env{posix.clock, files, posix.seed};
  const auto watch = [&](std::size_t) { stopping = stopping || stop() != 0; };
  const auto answer = run(env, request, {watch, &stopping});
  if (stopping) {
    return stopped();
  }
  if (!answer) {
    return error_for_c(answer.error());
  }
  *json = text_for_c(*answer);
  return nullptr;
}

}  // namespace

struct sixpoint_reading {
  gt3x::Recording recording;
  gt3x::SampleStream stream;
  gt3x::RowArray rows;
  std::string path;
};

namespace {

// Values of one axis, by the scale in force.
void fill_axis(const sixpoint_reading& reading, std::size_t axis, double* values_g) {
  const auto* const rows = static_cast<const gt3x::Counts*>(reading.rows.data.get());
  const auto& scales = reading.stream.scales();
  constexpr int kLeast = -32768;
  std::vector<double> value_of(65536);  // of each count
  for (std::size_t i = 0; i < scales.size(); ++i) {
    const auto value_g = [scale = scales[i].lsb_per_g](int count) -> double {
      return scale > 0 ? static_cast<double>(gt3x::round_to_mg(count, scale)) / 1000 : count;
    };
    const std::uint64_t begin = scales[i].first_row;
    const std::uint64_t end = i + 1 < scales.size() ? scales[i + 1].first_row : reading.rows.rows;
    if (end < begin + value_of.size()) {  // fewer than the table has
      for (std::uint64_t row = begin; row < end; ++row) {
        values_g[row] = value_g(rows[row][axis]);
      }
      continue;
    }
    for (int count = kLeast; count < -kLeast; ++count) {
      value_of[static_cast<std::size_t>(count - kLeast)] = value_g(count);
    }
    for (std::uint64_t row = begin; row < end; ++row) {
      values_g[row] = value_of[static_cast<std::size_t>(rows[row][axis] - kLeast)];
    }
  }
}

void fill_times(const sixpoint_reading& reading, double* times_s) {
  constexpr std::uint64_t kPiece = 1U << 16U;
  std::vector<std::int64_t> times_ns(kPiece);
  for (std::uint64_t row = 0; row < reading.rows.rows; row += kPiece) {
    const auto count = static_cast<std::size_t>(std::min(kPiece, reading.rows.rows - row));
    gt3x::row_times_ns(reading.stream.runs(), reading.stream.rate_hz(), row,
                       std::span(times_ns).first(count));
    for (std::size_t i = 0; i < count; ++i) {
      constexpr std::int64_t kHundredth_ns = 10'000'000;
      const std::int64_t hundredths = (times_ns[i] + kHundredth_ns / 2) / kHundredth_ns;
      times_s[row + i] = static_cast<double>(hundredths) / 100;
    }
  }
}

}  // namespace

extern "C" {

char* sixpoint_reading_open(const char* path, int fill, sixpoint_stop stop,
                            sixpoint_reading** out) {
  return guarded([&]() -> char* {
    auto recording = gt3x::Recording::open(sixpoint::posix_env().files, path);
    if (!recording) {
      return error_for_c(recording.error());
    }
    gt3x::SampleStreamOptions options;
    options.fill = fill != 0;
    options.fill_zeros = true;
    auto stream = gt3x::SampleStream::open(*recording, options);
    if (!stream) {
      return error_for_c(stream.error());
    }
    bool stopping = false;
    gt3x::RowArrayOptions how;
    // R gets four columns of doubles beside the three counts of a row.
    how.most_bytes = repair::half_of_memory() / (4 * sizeof(double) + 3 * sizeof(std::int16_t)) *
                     (3 * sizeof(std::int16_t));
    how.go_on = [&]() -> Status {
      if (std::ranges::find(stream->scales(), 0, &gt3x::RowScale::lsb_per_g) !=
          stream->scales().end()) {
        return sixpoint::fail(ErrorCode::bad_data, "this is an .agdc file of raw counts", path,
                              "export it as a CSV by sixpoint export");
      }
      stopping = stop() != 0;
      return stopping ? Status(sixpoint::fail(ErrorCode::io, "it was stopped")) : Status();
    };
    auto rows = gt3x::read_all_rows(*stream, gt3x::RowValue::lsb_int16, how);
    if (stopping) {
      return stopped();
    }
    if (!rows) {
      return error_for_c(rows.error());
    }
    *out = new sixpoint_reading{*std::move(recording), *std::move(stream), *std::move(rows), path};
    return nullptr;
  });
}

void sixpoint_reading_close(sixpoint_reading* reading) { delete reading; }

double sixpoint_reading_rows(const sixpoint_reading* reading) {
  return static_cast<double>(reading->rows.rows);
}

char* sixpoint_reading_columns(const sixpoint_reading* reading, double* x_g, double* y_g,
                               double* z_g, double* times_s) {
  return guarded([&]() -> char* {
    const PerAxis<double*> axes = {x_g, y_g, z_g};
    PerAxis<std::exception_ptr> failures;  // what leaves a thread's function ends the program
    const auto fill = [&](std::size_t axis) {
      try {
        fill_axis(*reading, axis, axes[axis]);
      } catch (...) {
        failures[axis] = std::current_exception();
      }
    };
    {
      std::array<std::jthread, 3> threads;
      for (std::size_t axis = 0; axis < axes.size(); ++axis) {
        try {
          threads[axis] = std::jthread(fill, axis);
        } catch (const std::system_error&) {  // the system has no thread for it
          fill(axis);
        }
      }
      fill_times(*reading, times_s);
    }
    for (const std::exception_ptr& failure : failures) {
      if (failure) {
        std::rethrow_exception(failure);
      }
    }
    return nullptr;
  });
}

char* sixpoint_reading_facts(const sixpoint_reading* reading, char** json) {
  return guarded([&]() -> char* {
    gt3x::Recording recording = reading->recording;
    const auto found = repair::reading_of(recording, reading->stream);
    if (!found) {
      return error_for_c(found.error());
    }
    Json all;
    all["facts"] = repair::inspection_to_json(*found, reading->path);
    all["info"] = Json::object();
    for (const auto& [key, value] : recording.info().pairs()) {
      all["info"].emplace(key, value);  // of a key that stands twice, the first
    }
    all["gaps"] = Json::array();
    for (const gt3x::Gap& gap : found->gaps) {
      all["gaps"].push_back({{"unix_start", gap.start},
                             {"seconds", gap.seconds},
                             {"kind", gt3x::to_string(gap.kind)}});
    }
    *json = text_for_c(all);
    return nullptr;
  });
}

char* sixpoint_scan_json(const char* const* paths, int count, const char* options,
                         sixpoint_stop stop, char** json) {
  return guarded([&] {
    return answer_for_c(paths, count, options, repair::ScanRequest{}, &repair::run_scan, stop,
                        json);
  });
}

char* sixpoint_repair_json(const char* const* paths, int count, const char* folder,
                           const char* options, sixpoint_stop stop, char** json) {
  return guarded([&] {
    repair::RepairRequest request;
    request.folder = folder;
    return answer_for_c(paths, count, options, std::move(request), &repair::run_repair, stop, json);
  });
}

}  // extern "C"

// Diagnosis of a table of readings: text or CSV, also gzipped, of a sensor that rested in many
// directions.
//
//   SIXPOINT_ASSIGN(const Diagnosis diagnosis, diagnose_table(env.files, "readings.csv"));
//   std::cout << diagnosis.brief() << '\n';
//
// There is no header, no constants and no protocol: gain and zero of each axis are free. What the
// lengths at rest say beyond them is judged, which is whether the axes are square.
//
// A line holds time and three readings, or three readings (then the rate must be given), separated
// by spaces, commas, semicolons or tabs. Time is in seconds; readings are in any unit that is
// linear in acceleration. A first line that is not numbers names the columns. Lines that begin with
// # are skipped.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "gap/judge/diagnose.h"
#include "gap/judge/diagnosis.h"

namespace sixpoint::gap {

struct ReadingsTableOptions {
  double rate_hz = 0;  // of tables without a time column; 0: not given
};

// A stretch of blocks in which the sensor lay still in one direction.
struct RestingReading {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();  // in the table's unit
  Eigen::Vector3d sd = Eigen::Vector3d::Zero();    // of one reading
  double readings = 0;
};

struct ReadingsTable {
  double rate_hz = 0;
  std::size_t readings = 0;
  std::size_t blocks = 0;
  std::vector<RestingReading> rests;  // in order of time
};

// True for the names that such tables have: .txt, .csv, .tsv, also with .gz behind.
bool is_readings_table(const std::string& path);

// no_input, io; bad_data naming the line for what is no table; usage where the rate must be given.
// Memory is bounded by the number of blocks, 500,000 at most.
Result<ReadingsTable> read_readings_table(FileSystem& files, const std::string& path,
                                          const ReadingsTableOptions& options = {});

// `non_orthogonality` by the evidence of the lengths, held out by direction; inconclusive with
// fewer than sixteen directions or where they do not span. Errors as above.
Result<Diagnosis> diagnose_table(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options = {},
                                 const ReadingsTableOptions& table = {});

}  // namespace sixpoint::gap

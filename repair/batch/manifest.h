// What a run of repair leaves in its output folder: manifest.csv for people, manifest.json for
// programs. One line per file: input, output, status, source of the constants, still error before
// and after, hashes.
//
//   SIXPOINT_CHECK(check_manifest(files, "repaired"));  // before the work
//   SIXPOINT_CHECK(write_manifest(files, "repaired", reports, now, "sixpoint 1.0.0"));
//
// units.csv beside them has a line per unit of the run (repair/units/unit_needs.h).
//
// A line says of a file what the last run that met it says, and no output that lies in the folder
// loses its line. Of the lines of earlier runs, the first row that fits decides:
//
// | line of an earlier run                                       | becomes                      |
// |--------------------------------------------------------------|------------------------------|
// | of a file of this run that is `outdated`, or `failed` because| stays, under this run's      |
// | its output is there (cannot_create); the line has an output, | status, and is the file's    |
// | made of this very input (SHA-256)                            | line of this run             |
// | has an output that is one of this run                        | goes                         |
// | of a file that is not in this run                            | stays                        |
// | has an output that is there                                  | stays, beside this run's line|
// | otherwise                                                    | goes                         |
//
// Files are named from the root of the disk (place_of()), so a file is the same one in every run.
// Names that are no UTF-8 are escaped (\xNN); the CSV is quoted as RFC 4180 has it.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "repair/rescale/repair_file.h"
#include "repair/units/unit_needs.h"

namespace sixpoint::repair {

// cannot_create where one of manifest.json, manifest.csv, units.csv and report.html is there and is
// not ours.
Status check_manifest(FileSystem& files, const std::string& folder);

// What the manifest of a folder knew of its outputs when it was read (earlier_output.h).
class KnownOutputs {
 public:
  KnownOutputs(FileSystem& files, const std::string& folder);
  std::optional<KnownOutput> of(const std::string& output) const;

 private:
  FileSystem& files_;
  std::map<std::string, KnownOutput> known_;  // by the name that stands in the manifest
};

Status write_manifest(FileSystem& files, const std::string& folder,
                      const std::vector<RepairReport>& reports, UtcTime now,
                      const std::string& software);
Status write_units(FileSystem& files, const std::string& folder,
                   const std::vector<UnitNeeds>& units);

}  // namespace sixpoint::repair

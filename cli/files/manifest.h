// What a run of repair leaves in its output folder: manifest.csv for people, manifest.json for
// programs. One line per file: input, output, status, source of the constants, still error before
// and after, hashes.
//
//   SIXPOINT_CHECK(check_manifest(files, "repaired"));            // before the work
//   SIXPOINT_CHECK(write_manifest(files, "repaired", reports, now));
//
// units.csv beside them has a line per unit of the run (repair/units/unit_needs.h).
//
// Files of earlier runs into the same folder stay in it, unless this run met them again; where it
// was refused because their output is there (cannot_create), they stay, too; where that output is
// `outdated`, they stay with this status. Names that are no
// UTF-8 are escaped (\xNN); the CSV is quoted as RFC 4180 has it.
#pragma once

#include <string>
#include <vector>

#include "base/env.h"
#include "repair/rescale/repair_file.h"
#include "repair/units/unit_needs.h"

namespace sixpoint::cli {

// cannot_create where one of manifest.json, manifest.csv, units.csv and report.html is there and is
// not ours.
Status check_manifest(FileSystem& files, const std::string& folder);

Status write_manifest(FileSystem& files, const std::string& folder,
                      const std::vector<repair::RepairReport>& reports, UtcTime now);
Status write_units(FileSystem& files, const std::string& folder,
                   const std::vector<repair::UnitNeeds>& units);

}  // namespace sixpoint::cli

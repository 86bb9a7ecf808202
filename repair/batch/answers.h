// What was found, as the JSON documents of the commands have it (docs/recordings.md,
// docs/repair.md).
//
//   SIXPOINT_ASSIGN(const Inspection found, inspect(env.files, "a.gt3x"));
//   const Json json = inspection_to_json(found, "a.gt3x");
//   const Json scanned = scanned_to_json(scan_file(env.files, "a.gt3x"));
//
// The documents of repair and solve are RepairReport::to_json() and calib::to_json().
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "repair/rescale/repair_file.h"
#include "repair/triage/inspection.h"
#include "repair/triage/scan_file.h"

namespace sixpoint::repair {

using Json = nlohmann::ordered_json;

Json error_document(const Error& error);  // {code, what, where, hint}

// "current", "legacy"; "unknown" where the facts do not suffice.
std::string filter_name(std::optional<calib::FilterConfiguration> filter);

// The document of `sixpoint inspect` without its "schema".
Json inspection_to_json(const Inspection& found, const std::string& path);

// One of `files` of `sixpoint scan`, and its `summary`.
Json scanned_to_json(const ScannedFile& file);
Json scan_summary(const std::vector<ScannedFile>& files);

// The `summary` of `sixpoint repair`: {files, repaired, not_affected, not_repairable,
// already_repaired, outdated, failed, dry_run}.
using RepairCounts = std::map<RepairStatus, std::size_t>;
Json repair_summary(RepairCounts counts, bool dry_run);
RepairCounts count_by_status(const std::vector<RepairReport>& reports);

}  // namespace sixpoint::repair

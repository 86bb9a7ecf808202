// Which source of constants is asked, and which constants do not fit a file.
//
//   NamedSources named;
//   named.calibration_file = true;
//   sources_in_order(named);  // {SourceKind::calibration_file}
//
// What the user names wins and stands alone. The first row that fits decides:
//
// | named                      | order                                                      |
// |----------------------------|------------------------------------------------------------|
// | --constants                | constants                                                  |
// | --calibration-file         | calibration_file                                           |
// | --scan                     | scan                                                       |
// | --store                    | store                                                      |
// | nothing, a default store   | store, scan                                                |
// | nothing, no default store  | scan                                                       |
// | any of them, and --or-scan | as above, then scan                                        |
// | scan stands in the order,  | as above, with unit_files behind scan                      |
// | no --no-pool               |                                                            |
//
// The next source of the order is asked only where the one before has no constants that fit.
// unit_files are the still periods of the unit's other files in the same run (repair/units).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/time.h"
#include "calib/constants.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {

enum class SourceKind { constants, calibration_file, scan, store, unit_files };
std::string_view to_string(SourceKind kind);  // as `method` and `source.kind` have it
// Were the still periods of affected files asked, of the file or of its unit's?
bool is_of_still_periods(std::string_view kind);

struct NamedSources {
  bool constants = false;
  bool calibration_file = false;
  bool scan = false;
  bool store = false;
  bool or_scan = false;
  bool default_store = false;  // no one named it, and it is there
  bool unit_files = false;     // the unit's other files may be asked: no --no-pool
};
std::vector<SourceKind> sources_in_order(const NamedSources& named);

// Why constants must not be applied to a file of these facts; nothing where they may. The first row
// that fits decides:
//
// | constants                                           | fit |
// |-----------------------------------------------------|-----|
// | of another serial number                            | no  |
// | measured under `legacy`                             | no  |
// | resting on a population prior, without `allow_prior`| no  |
// | that no sensor can have (calib::why_no_sensor())    | no  |
// | otherwise                                           | yes |
std::optional<std::string> why_unfit(const calib::ConstantsRecord& record, const FileFacts& file,
                                     bool allow_prior);

// Two sets have one digest when they do the same to a file: serial number, filter, constants and
// cross-axis terms. 32 hex digits.
std::string digest_of(const calib::ConstantsRecord& record);

// Where the constants of a repair came from, for people.
struct SourceUsed {
  std::string kind;  // to_string(SourceKind)
  std::string id;    // in the store; else digest_of() the constants
  std::optional<UtcTime> made_at;
  // Of a value of 1 g by what is applied (map_to_apply.h), the largest of the axes.
  std::optional<double> standard_uncertainty_mg;
  bool from_prior = false;  // they rest on a population prior: --allow-prior

  std::string brief() const;  // "store 5c0f91aa (2026-11-22, +- 1.2 mg)"
  nlohmann::ordered_json to_json() const;
};
// `id`: in the store, or empty.
SourceUsed source_used(const std::string& kind, const std::string& id,
                       const calib::ConstantsRecord& record);
// null and what to_json() does not write give nothing.
std::optional<SourceUsed> parse_source_used(const nlohmann::ordered_json& json);

}  // namespace sixpoint::repair

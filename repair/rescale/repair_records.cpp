#include "repair/rescale/repair_records.h"

#include <algorithm>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;
using Constants = std::vector<db::ConstantsRecord>;

db::RepairRecord record_of(const RepairReport& report, const std::string& software) {
  db::RepairRecord record;
  record.serial = report.serial;
  record.made_at = report.repaired_at.value_or(UtcTime{});
  record.input = report.input;
  record.input_sha256 = report.input_sha256;
  record.output_sha256 = report.output_sha256;
  record.method = report.method;
  record.constants_id = report.constants_id;
  record.document = report.to_json().dump(-1, ' ', false, Json::error_handler_t::replace);
  record.software = software;
  return record;
}

}  // namespace

RepairRecords records_of(db::Store& store, const std::vector<RepairReport>& reports,
                         const std::string& software) {
  RepairRecords made;
  std::map<std::string, std::set<std::string>> ids;  // of the constants of each serial
  for (const RepairReport& report : reports) {
    if (report.status != RepairStatus::repaired || report.dry_run) {
      continue;
    }
    db::RepairRecord record = record_of(report, software);
    // One file with a serial number that no store keeps must not stand in the way of the others.
    if (const auto rows = db::rows_of(record); !rows) {
      made.refused.push_back({report.input, rows.error()});
      continue;
    }
    const auto known = store.repair_of_output(report.output_sha256);
    if (known && *known && (*known)->input_sha256 == report.input_sha256) {
      continue;
    }
    if (!record.constants_id.empty()) {
      auto place = ids.find(report.serial);
      if (place == ids.end()) {
        place = ids.emplace(report.serial, std::set<std::string>()).first;
        const auto history = store.history(report.serial);
        if (!history && !report.resumed) {
          place->second.insert(record.constants_id);  // chosen from this store a moment ago
        }
        for (const db::ConstantsRecord& constants : history.value_or(Constants())) {
          place->second.insert(constants.id);
        }
      }
      if (!place->second.contains(record.constants_id)) {
        record.constants_id.clear();
      }
    }
    made.records.push_back(std::move(record));
  }
  return made;
}

}  // namespace sixpoint::repair

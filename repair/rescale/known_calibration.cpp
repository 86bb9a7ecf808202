#include "repair/rescale/known_calibration.h"

#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

void add_date(const Json& from, const char* key, std::set<UtcTime>& dates) {
  if (!from.is_object() || !from.contains(key) || !from[key].is_string()) {
    return;
  }
  if (const auto date = parse_iso8601(from[key].get<std::string>())) {
    dates.insert(*date);
  }
}

}  // namespace

KnownDate calibration_date(const db::UnitHistory& history) {
  std::set<UtcTime> of_repairs;
  for (const db::RepairRecord& repair : history.repairs) {
    add_date(parse_json(repair.document), "calibration_time", of_repairs);
  }
  std::set<UtcTime> dates = of_repairs;
  for (const db::RunRecord& run : history.runs) {
    const Json document = parse_json(run.document);
    for (const char* page : {"as_found", "as_left"}) {
      if (document.is_object() && document.contains(page)) {
        add_date(document[page], "calibrated", dates);
      }
    }
  }
  if (dates.empty()) {
    return {};
  }
  if (dates.size() > 1) {
    return {std::nullopt,
            fmt::format("the store knows {} dates of calibration of this unit, and not which of "
                        "them held for this file",
                        dates.size())};
  }
  return {*dates.begin(), of_repairs.empty()
                              ? "the date of calibration is that of the unit's memory, by a jig "
                                "run in the store"
                              : "the date of calibration is that of another recording of the "
                                "unit, by a repair in the store"};
}

}  // namespace sixpoint::repair

// What the store says about a station's work: its runs for statistics, its check units, whether it
// is locked, and whether a unit may be measured again.
//
// A check unit is a unit that stays at the station and is measured regularly. Its sensitivities and
// zeros are charted; when a chart is out of control (a locking rule of the limits, statistics.h),
// the station measures nothing but check units until an engineer has signed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "db/store.h"
#include "station/limits.h"
#include "station/statistics.h"
#include "station/verdict.h"

namespace sixpoint::station {

RunSummary summary_of(const db::RunRecord& run);

// Of all runs that `filter` takes, without those of check units.
Result<std::vector<RunSummary>> summaries(db::Store& store, const db::RunFilter& filter);

struct CheckUnitChart {
  std::string serial;
  std::vector<UtcTime> times;  // of the points
  ControlChart chart;          // "zero_offset_mg x" ...
};

struct StationState {
  std::string station;
  std::vector<std::string> check_units;  // of any station: they are carried about
  std::vector<CheckUnitChart> charts;    // six for each check unit that was measured here
  bool locked = false;
  std::vector<std::string> reasons;           // why, for people
  std::optional<db::StationEvent> signature;  // the last one

  bool usable() const { return !locked; }
  std::string brief() const;
  nlohmann::ordered_json to_json() const;
};
Result<StationState> station_state(db::Store& store, const std::string& station,
                                   const CheckUnitPolicy& policy);

// What a unit's earlier jig runs and releases demand of the next one.
Result<RetestState> unit_retest_state(db::Store& store, const std::string& serial,
                                      const RetestPolicy& policy);

// Before a run: configuration error where the station is locked (unless the unit is a check unit)
// or the unit failed too often, with what to do; else what its earlier runs demand of this one.
Result<RetestState> may_start(db::Store& store, const std::string& serial,
                              const std::string& station, const Limits& limits);

// Runs of a gage study are kept under this kind, with the study's name as `study` in the document:
// they count neither for yields nor as retests, and make no constants.
inline constexpr const char* kStudyKind = "study";

// The readings of a gage study: `quantity` and `axis` as in JudgedQuantity, part = serial, operator
// = the run's operator. no_input where the store has no such study.
Result<std::vector<GageReading>> gage_readings(db::Store& store, const std::string& study,
                                               const std::string& quantity,
                                               const std::string& axis);

// A page of its own: yields, failure codes, capabilities, and the charts as SVG.
std::string statistics_html(const StatisticsReport& report,
                            const std::vector<StationState>& states);
std::string chart_svg(const CheckUnitChart& chart);

}  // namespace sixpoint::station

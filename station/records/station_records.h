// A station's work as the store has it: its runs for statistics, its check units, its lock, and
// whether a unit may be measured again.
//
//   SIXPOINT_ASSIGN(const StationState state, station_state(store, "bench-1", limits.check_unit));
//   if (state.locked) { std::cout << state.brief(); }
//   SIXPOINT_ASSIGN(const auto runs, summaries(store, {}));
//   SIXPOINT_ASSIGN(const StatisticsReport report, statistics(runs, "station"));
//
// A check unit is a unit that stays at the station and is measured regularly. Its sensitivities and
// zeros are charted; when a chart is out of control (a locking rule of the limits, statistics.h),
// the station measures nothing but check units until an engineer has signed. A check unit that is
// removed counts until that signature: taking it away lifts no lock.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "db/store.h"
#include "station/limits/limits.h"
#include "station/limits/verdict.h"
#include "station/statistics/statistics.h"

namespace sixpoint::station {

RunSummary summary_of(const db::RunRecord& run);

// Of the runs that `filter` selects, without those of check units (db::CheckUnitTimes). Oldest
// first.
Result<std::vector<RunSummary>> summaries(db::Store& store, const db::RunFilter& filter);

// Runs that started on or after the day `from` ("2027-03-31") and before the day `to`; empty: no
// limit. usage where a text is no day, and where `from` is after `to`; `prefix` and from or to is
// then where ("--from").
Result<db::RunFilter> runs_between(const std::string& from, const std::string& to,
                                   const std::string& prefix);

struct CheckUnitChart {
  std::string serial;
  std::vector<UtcTime> times;  // of the points
  ControlChart chart;          // "zero_offset_mg x" ...
};

// A known-bad check unit: it must fail, with just its codes, at the start of each shift. It shows
// that the station still finds what is wrong. The rule, for each such unit that was named for this
// station:
//
// | its last run here                       | the station                                         |
// |-----------------------------------------|-----------------------------------------------------|
// | none in the last kShift                 | locked: measure it first (known where `now` is)     |
// | failed with just its codes              | open                                                |
// | passed, or other codes, or no verdict   | locked until it fails as it must                    |
//
// A signature opens none of these. A unit that was removed, or named again without codes, need not
// be measured any more; but where its last run before that locks the station, an engineer signs.
inline constexpr std::chrono::hours kShift{12};
struct KnownBad {
  std::string serial;
  std::vector<std::string> codes;  // sorted
  std::optional<UtcTime> until;    // when it ceased to be one
};
// The decision's reason with the codes in front, and back; none where it names no codes. usage for
// a code that is not in the catalogue (verdict.h).
Result<std::string> reason_with_codes(const std::string& codes, const std::string& reason);
std::vector<std::string> codes_in_reason(const std::string& reason);

struct StationState {
  std::string station;
  std::vector<std::string> check_units;  // of all stations: a check unit may be moved
  std::vector<KnownBad> known_bad;       // of this station, and those that ceased unsigned
  std::vector<CheckUnitChart> charts;    // six for each check unit that was measured here
  bool locked = false;
  std::vector<std::string> reasons;           // why, for people
  std::optional<db::StationEvent> signature;  // the last one

  bool usable() const { return !locked; }
  std::string brief() const;
  nlohmann::ordered_json to_json() const;
};
// `now`: to know whether a known-bad unit was measured in this shift; without it that is not asked.
Result<StationState> station_state(db::Store& store, const std::string& station,
                                   const CheckUnitPolicy& policy,
                                   const std::optional<UtcTime>& now = {});

// Adds an engineer's decision about a station or a unit to the store, and gives its id.
//
//   decision                                          answer
//   check_unit_end of a unit that is no check unit    no_input error: a mistyped serial
//   release of a unit that the store does not know    no_input error: the same
//   without a name or without a reason (blanks only)  usage error
//   any other                                         added
Result<std::string> add_decision(db::Store& store, const db::StationEvent& decision);

// A run of a unit, and when it ended.
struct EndedRun {
  EarlierRun run;
  UtcTime ended;
};
// What a unit's earlier jig runs and releases demand of the next one. `waiting`: runs that the
// store does not have yet.
Result<RetestState> unit_retest_state(db::Store& store, const std::string& serial,
                                      const RetestPolicy& policy,
                                      const std::vector<EndedRun>& waiting = {});

// The rule that decides whether a unit may be measured now, in this order:
//
//   unit                        station   answer
//   a check unit                any       yes, without demands
//   any other                   locked    configuration error: an engineer signs for the station
//   failed too often (limits)   open      configuration error: an engineer releases the unit
//   any other                   open      yes, with what its earlier runs demand of this one
Result<RetestState> may_start(db::Store& store, const std::string& serial,
                              const std::string& station, const Limits& limits,
                              const std::vector<EndedRun>& waiting = {});

// May the constants of a run be written into their unit now ("write now")? The store took them when
// the run ended, or they were kept in the journal, which goes into the store when that answers.
// The answer is why they are written no more, or nothing: they may be. An error is no answer: they
// wait on. `is_in_journal`: the journal holds them now, as it was seen before `store` was opened.
//
//   constants                                  in journal  answer
//   of the store, and not withdrawn            any         they may be
//   withdrawn (db::UnitHistory::is_withdrawn)  any         no more, with the reason of who did it
//   not of this store                          no          no more
//   not of this store                          yes         they may be: only what is in the store
//                                                          can be withdrawn
//   the store does not answer                  no          its error, whatever code it has
//   the store does not answer                  yes         they may be, likewise
Result<std::optional<Error>> may_write(Result<db::Store>& store, const std::string& serial,
                                       const std::string& constants_id, bool is_in_journal);

// The two configuration errors, with what lifts them.
Error station_is_locked(const std::string& why, const std::string& station);
Error unit_needs_release(const RetestState& state, const std::string& serial);

// Runs of a gage study are stored under this kind, with the study's name as `study` in the
// document: they count neither for yields nor as retests, and make no constants.
inline constexpr const char* kStudyKind = "study";

// The readings of a gage study: `quantity` and `axis` as in JudgedQuantity, part = serial, operator
// = the run's operator. A quantity without axes is found whatever `axis` says. no_input where the
// store has no such study.
Result<std::vector<GageReading>> gage_readings(db::Store& store, const std::string& study,
                                               const std::string& quantity,
                                               const std::string& axis);

// A page of its own: yields, failure codes, capabilities, and the charts as SVG.
std::string statistics_html(const StatisticsReport& report,
                            const std::vector<StationState>& states);
std::string chart_svg(const CheckUnitChart& chart);

}  // namespace sixpoint::station

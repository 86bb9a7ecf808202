#include "db/questions.h"

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "db/store.h"

namespace sixpoint::db {
namespace {

// Withdrawals w that no later correction reinstated.
constexpr std::string_view kStillWithdrawn =
    "w.about_table = 'constants' AND w.action = 'withdraw' AND NOT EXISTS (SELECT 1 FROM "
    "corrections r WHERE r.about_table = 'constants' AND r.about_id = w.about_id "
    "AND r.action = 'reinstate' AND r.seq > w.seq)";

// The verdicts after which the constants are used.
bool is_passed(std::string_view verdict) {
  return verdict == "pass" || verdict == "conditional_pass";
}

// Does a run of this verdict say something about the unit?
bool is_judged(std::string_view verdict) {
  return verdict != "stopped" && verdict != "inconclusive";
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? std::numeric_limits<double>::quiet_NaN()
                    : static_cast<double>(part) / static_cast<double>(whole);
}

bool is_null(const Value& value) { return std::holds_alternative<std::monostate>(value); }

}  // namespace

std::string not_withdrawn() {
  return fmt::format(
      "NOT EXISTS (SELECT 1 FROM corrections w WHERE w.about_id = constants.id AND {})",
      kStillWithdrawn);
}

bool UnitHistory::empty() const {
  return constants.empty() && runs.empty() && writes.empty() && repairs.empty() &&
         corrections.empty();
}

bool UnitHistory::is_withdrawn(const std::string& constants_id) const {
  bool withdrawn = false;
  for (const Correction& correction : corrections) {
    if (correction.table == "constants" && correction.row_id == constants_id &&
        (correction.action == "withdraw" || correction.action == "reinstate")) {
      withdrawn = correction.action == "withdraw";
    }
  }
  return withdrawn;
}

const Correction* UnitHistory::preference(const std::string& filter) const {
  const Correction* last = nullptr;
  for (const Correction& correction : corrections) {
    const bool applies = correction.table == "constants" && correction.action == "prefer" &&
                         !is_withdrawn(correction.row_id) &&
                         std::ranges::any_of(constants, [&](const ConstantsRecord& set) {
                           return set.id == correction.row_id && set.filter == filter;
                         });
    last = applies ? &correction : last;
  }
  return last;
}

CheckUnitTimes::CheckUnitTimes(const std::vector<StationEvent>& events) {
  for (const StationEvent& event : events) {
    if (event.action != "check_unit" && event.action != "check_unit_end") {
      continue;
    }
    std::vector<Period>& periods = of_[event.serial];
    const bool is_one = !periods.empty() && !periods.back().until;
    if (event.action == "check_unit" && !is_one) {
      periods.push_back({event.made_at, std::nullopt});
    } else if (event.action == "check_unit_end" && is_one) {
      periods.back().until = event.made_at;
    }
  }
}

bool CheckUnitTimes::hold(const std::string& serial, UtcTime started) const {
  const auto unit = of_.find(serial);
  return unit != of_.end() && std::ranges::any_of(unit->second, [&](const Period& period) {
           return started >= period.from && (!period.until || started < *period.until);
         });
}

double YieldReport::yield() const { return share(passed, judged); }
double YieldReport::first_pass_yield() const { return share(passed_first_time, judged); }

Result<UnitHistory> Store::unit_history(const std::string& serial) {
  // One moment: a run and the constants that it made belong together.
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(*database_));
  const std::vector<Value> unit = {serial};
  const std::string of_unit = "WHERE serial = $1 ORDER BY seq";
  UnitHistory all;
  SIXPOINT_ASSIGN(all.constants, select<ConstantsRecord>(of_unit, unit));
  SIXPOINT_ASSIGN(all.runs, select<RunRecord>(of_unit, unit));
  SIXPOINT_ASSIGN(all.writes, select<UnitWrite>(of_unit, unit));
  SIXPOINT_ASSIGN(all.repairs, select<RepairRecord>(of_unit, unit));
  std::string about = "WHERE (about_table = 'units' AND about_id = $1)";
  for (const char* name : {"constants", "runs", "unit_writes", "repairs"}) {
    about += fmt::format(
        " OR (about_table = '{0}' AND about_id IN (SELECT id FROM {0} WHERE serial = $1))", name);
  }
  SIXPOINT_ASSIGN(all.corrections, select<Correction>(about + " ORDER BY seq", unit));
  return all;
}

Result<std::vector<UnitRecord>> Store::units() {
  SIXPOINT_ASSIGN(
      const auto rows,
      database_->query("SELECT serial, model, first_seen_ns, "
                       "(SELECT count(*) FROM constants WHERE constants.serial = units.serial) "
                       "FROM units"));
  std::vector<UnitRecord> records;
  records.reserve(rows.size());
  for (const Row& row : rows) {
    records.push_back({text_of(row[0]), text_of(row[1]), from_ns(integer_of(row[2])),
                       static_cast<std::size_t>(integer_of(row[3]))});
  }
  // Here and not by the server, whose order depends on its locale.
  std::ranges::sort(records, {}, &UnitRecord::serial);
  return records;
}

Result<std::vector<RecallEntry>> Store::recall_list(const std::string& constants_id) {
  const Table& repairs = table("repairs");
  std::vector<Value> parameters;
  if (!constants_id.empty()) {
    parameters.emplace_back(constants_id);
  }
  SIXPOINT_ASSIGN(
      const auto rows,
      database_->query(
          fmt::format("SELECT {0}, w.made_at_ns, w.reason, "
                      "(SELECT max(again.made_at_ns) FROM repairs again WHERE again.input_sha256 = "
                      "repairs.input_sha256 AND again.input_sha256 <> '' "
                      "AND again.seq > repairs.seq AND NOT EXISTS (SELECT 1 FROM corrections w "
                      "WHERE w.about_id = again.constants_id AND {1})) FROM corrections w "
                      "JOIN repairs ON repairs.constants_id = w.about_id "
                      "WHERE {1}{2} ORDER BY repairs.seq, w.seq",
                      record_columns(repairs), kStillWithdrawn,
                      constants_id.empty() ? "" : " AND w.about_id = $1"),
          parameters));
  std::vector<RecallEntry> entries;
  for (const Row& row : rows) {
    const std::size_t next = repairs.columns.size();
    RecallEntry entry{record_of<RepairRecord>(row), from_ns(integer_of(row[next])),
                      text_of(row[next + 1]), std::nullopt};
    if (!is_null(row[next + 2])) {
      entry.repaired_again_at = from_ns(integer_of(row[next + 2]));
    }
    // Constants may have been withdrawn twice, by two people: one line per file.
    if (entries.empty() || entries.back().repair.id != entry.repair.id) {
      entries.push_back(std::move(entry));
    }
  }
  return entries;
}

Result<std::vector<JigUnit>> Store::units_of_jig(const std::string& jig) {
  const std::vector<Value> parameters = {jig};
  SIXPOINT_ASSIGN(
      const auto rows,
      database_->query(
          "SELECT serial, ended_ns, verdict FROM runs WHERE jig = $1 AND kind <> 'write' "
          "ORDER BY started_ns, seq",
          parameters));
  std::map<std::string, JigUnit> units;
  for (const Row& row : rows) {
    JigUnit& unit = units[text_of(row[0])];
    unit = {text_of(row[0]), unit.runs + 1, from_ns(integer_of(row[1])), text_of(row[2])};
  }
  std::vector<JigUnit> list;
  list.reserve(units.size());
  for (auto& [serial, unit] : units) {
    list.push_back(std::move(unit));
  }
  return list;
}

Result<YieldReport> Store::yield(UtcTime from, UtcTime to) {
  const std::vector<Value> parameters = {to_ns(from), to_ns(to)};
  SIXPOINT_ASSIGN(const auto events, station_events());
  const CheckUnitTimes check_unit_times(events);
  SIXPOINT_ASSIGN(
      const auto rows,
      database_->query("SELECT serial, verdict, retest_of, started_ns FROM runs WHERE kind = 'jig' "
                       "AND started_ns >= $1 AND started_ns < $2 ORDER BY started_ns, seq",
                       parameters));
  YieldReport report;
  std::set<std::string> units;
  std::map<std::string, bool> last_passed;  // of each unit that was judged
  for (const Row& row : rows) {
    if (check_unit_times.hold(text_of(row[0]), from_ns(integer_of(row[3])))) {
      continue;
    }
    ++report.runs;
    report.retests += is_null(row[2]) ? 0 : 1;
    units.insert(text_of(row[0]));
    const std::string verdict = text_of(row[1]);
    if (is_judged(verdict)) {
      const bool passed = is_passed(verdict);
      const bool is_first = last_passed.insert_or_assign(text_of(row[0]), passed).second;
      report.passed_first_time += is_first && passed ? 1 : 0;
    }
  }
  report.units = units.size();
  report.judged = last_passed.size();
  for (const auto& [serial, passed] : last_passed) {
    report.passed += passed ? 1 : 0;
  }
  return report;
}

Result<std::vector<DueUnit>> Store::units_due(UtcTime older_than) {
  SIXPOINT_ASSIGN(const auto rows,
                  database_->query("SELECT serial, model, (SELECT max(made_at_ns) FROM constants "
                                   "WHERE constants.serial = units.serial AND " +
                                   not_withdrawn() + ") FROM units"));
  std::vector<DueUnit> due;
  for (const Row& row : rows) {
    DueUnit unit{text_of(row[0]), text_of(row[1]), std::nullopt};
    if (!is_null(row[2])) {
      unit.last_constants = from_ns(integer_of(row[2]));
    }
    if (!unit.last_constants || *unit.last_constants < older_than) {
      due.push_back(std::move(unit));
    }
  }
  // The longest overdue first; nullopt sorts before every time.
  std::ranges::sort(due, {},
                    [](const DueUnit& unit) { return std::tie(unit.last_constants, unit.serial); });
  return due;
}

Result<std::vector<TrendPoint>> Store::trend(const std::string& serial) {
  const Table& constants = table("constants");
  const std::vector<Value> parameters = {serial};
  SIXPOINT_ASSIGN(
      const auto rows,
      database_->query(
          fmt::format("SELECT {}, runs.jig, runs.station, runs.verdict, "
                      "CASE WHEN {} THEN 0 ELSE 1 END "
                      "FROM constants LEFT JOIN runs ON runs.id = constants.run_id "
                      "WHERE constants.serial = $1 ORDER BY constants.made_at_ns, constants.seq",
                      record_columns(constants), not_withdrawn()),
          parameters));
  std::vector<TrendPoint> points;
  for (const Row& row : rows) {
    const std::size_t next = constants.columns.size();
    points.push_back({record_of<ConstantsRecord>(row), text_of(row[next]), text_of(row[next + 1]),
                      text_of(row[next + 2]), integer_of(row[next + 3]) > 0});
  }
  return points;
}

}  // namespace sixpoint::db

// Quality control of the station, for the page: check units and the lock, statistics, gage studies
// (docs/statistics.md), and the decisions of engineers about them.
//
//   QualityControl quality(open_store, "bench-1", default_limits(), env.clock);
//   const bool locked = quality.lock()["locked"] == true;
//   StatisticsQuery query;
//   query.by = "operator";
//   SIXPOINT_ASSIGN(const auto yields, quality.statistics(query));
//
// lock() is what a thread of its own read from the store last; all other functions ask the store on
// the caller's thread. All functions may be called from any thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/result.h"
#include "db/store.h"
#include "station/limits/limits.h"
#include "station/page/repair_job.h"
#include "station/records/station_records.h"

namespace sixpoint::station {

struct StatisticsQuery {
  std::string by;    // station, jig, operator, firmware; empty: one group
  std::string from;  // "2027-03-31"; runs that started then or later; empty: all
  std::string to;    // before
};

struct GageQuery {
  std::string study;
  std::string quantity = "zero_offset_mg";
  std::string axis = "x";
  double tolerance = 0;  // width of the specification, in the quantity's unit; 0: not stated
};

class QualityControl {
 public:
  // `open_store` is called from any thread. Reads the store every 15 s: another station, or the
  // command line, may have signed.
  QualityControl(StoreOpener open_store, std::string station, Limits limits, Clock& clock);
  QualityControl(const QualityControl&) = delete;
  QualityControl& operator=(const QualityControl&) = delete;

  // {locked, reasons[], check_units[], signature, problem}
  nlohmann::ordered_json lock() const;
  std::uint64_t changes() const;  // of lock()
  void refresh_soon();            // a run was stored

  // lock() read anew, with all charts: {station, locked, ..., charts[]}.
  Result<nlohmann::ordered_json> check_units();
  // Of an engineer, for this station. Answers with the event's id. usage where name or reason is
  // missing.
  Result<std::string> decide(db::StationEvent decision);
  // As `sixpoint statistics --json`, with the meaning of the codes and the titles of the
  // quantities.
  Result<nlohmann::ordered_json> statistics(const StatisticsQuery& query);
  // {runs[{run, serial, started, verdict, operator, written, documents[]}]}, newest first, 200 at
  // most: this station's runs that started at `from` or later (ISO 8601), or all runs of a unit.
  Result<nlohmann::ordered_json> runs(const std::string& from, const std::string& serial);
  Result<nlohmann::ordered_json> studies();  // {studies[], quantities[{name, title, unit, axes[]}]}
  Result<nlohmann::ordered_json> gage_study(const GageQuery& query);

 private:
  Result<StationState> read_state();
  void watch(const std::stop_token& stop);
  void refresh();
  void show_problem(const std::string& problem);
  void show(nlohmann::ordered_json now);  // under the mutex

  const StoreOpener open_store_;
  const std::string station_;
  const Limits limits_;
  Clock& clock_;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable_any wake_;
  bool refresh_asked_ = false;
  nlohmann::ordered_json lock_;
  std::atomic<std::uint64_t> changes_{0};
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace sixpoint::station

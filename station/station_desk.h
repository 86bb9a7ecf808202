// What a page shows and decides about the station itself: check units and the lock, statistics,
// gage studies (docs/statistics.md). The store is asked on the caller's thread.
//
// All functions may be called from any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "station/limits.h"
#include "station/repair_job.h"

namespace sixpoint::station {

struct StatisticsQuestion {
  std::string by;    // station, jig, operator, firmware; empty: one group
  std::string from;  // "2027-03-31"; runs that started then or later; empty: all
  std::string to;    // before
};

struct GageQuestion {
  std::string study;
  std::string quantity = "zero_offset_mg";
  std::string axis = "x";
  double tolerance = 0;  // width of the specification; 0: not stated
};

// What a person decides, with name and reason for the record.
struct Decision {
  std::string action;  // of db::StationEvent
  std::string serial;  // of the unit, where it is about one
  std::string operator_name;
  std::string reason;
};

class StationDesk {
 public:
  // `open_store` is called from any thread; `env` outlives the desk. Looks at the store from time
  // to time: another station, or the command line, may have signed.
  StationDesk(Env& env, StoreOpener open_store, std::string station, Limits limits);
  ~StationDesk();
  StationDesk(const StationDesk&) = delete;
  StationDesk& operator=(const StationDesk&) = delete;

  // {locked, reasons[], check_units[], signature, problem}, as it was when it was looked at last.
  nlohmann::ordered_json lock() const;
  std::uint64_t changes() const;  // how often that changed
  void look_soon();               // a run was stored

  // The same with all charts: {station, locked, ..., charts[]}.
  Result<nlohmann::ordered_json> check_units();
  // Answers with the event's id. usage where name or reason is missing.
  Result<std::string> decide(const Decision& decision);
  // As `sixpoint statistics --json`, and what codes and quantities mean.
  Result<nlohmann::ordered_json> statistics(const StatisticsQuestion& question);
  Result<nlohmann::ordered_json> studies();  // {studies[], quantities[{name, title, unit, axes[]}]}
  Result<nlohmann::ordered_json> gage_study(const GageQuestion& question);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station

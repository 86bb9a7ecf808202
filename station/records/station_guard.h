// May this station measure a unit now? Also where the store does not answer, and whatever name the
// station goes by.
//
//   StationGuard guard(env, "data/station/3f2a", limits);
//   SIXPOINT_ASSIGN(const RetestState state, guard.may_start(opened, "MOS2A45130007", "bench-1"));
//   SIXPOINT_CHECK(guard.note_run(record, /*is_stored=*/true));  // after it
//
// The station has an identity of its own: the folder beside its state, one for each store. Its file
// memory.json holds an identifier that is made once, the names that the station went by, and what
// the store said last: whether it is locked and why, its check units, and the units that have
// failed. The rule:
//
// | store   | the station, under any of its names | unit                    | answer              |
// |---------|-------------------------------------|-------------------------|---------------------|
// | any     | any                                 | any, for a gage study   | as below; what its  |
// |         |                                     |                         | runs demand is left |
// |         |                                     |                         | out                 |
// | answers | open or locked                      | any                     | as may_start() of   |
// |         |                                     |                         | station_records.h,  |
// |         |                                     |                         | with the runs that  |
// |         |                                     |                         | it does not have    |
// | away    | locked when the store said it last  | a check unit            | yes                 |
// | away    | locked when the store said it last  | any other               | configuration error |
// | away    | open                                | failed too often        | configuration error |
// | away    | open                                | any other               | yes, with what its  |
// |         |                                     |                         | runs here demand    |
// | any     | its memory cannot be read           | any                     | configuration error |
//
// A station that is called without a name, or by another spelling, is locked where it is locked
// under one of the names that it went by. Errors: configuration, and those of the disk. One thread
// at a time; several programs of one station wait for each other (memory.lock), where the disk has
// locks.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "db/store.h"
#include "station/limits/limits.h"
#include "station/limits/verdict.h"
#include "station/records/station_records.h"

namespace sixpoint::station {

struct StationMemory {
  std::string id;                  // hexadecimal, made once
  std::vector<std::string> names;  // empty text: called without a name
  bool locked = false;
  std::string locked_as;  // the name that it is locked under
  std::string why;        // for people
  std::vector<std::string> check_units;
  std::map<std::string, RetestState> units;  // those whose earlier runs demand something
  std::map<std::string, std::vector<EndedRun>> waiting;  // runs that the store does not have yet
};

// A gage study measures a unit that failed often, too.
enum class StartOf : std::uint8_t { run, study };

class StationGuard {
 public:
  // `folder` is made when it is asked.
  StationGuard(Env& env, std::string folder, Limits limits)
      : env_(env), folder_(std::move(folder)), limits_(std::move(limits)) {}

  // `store`: the store, or why it does not answer.
  Result<RetestState> may_start(Result<db::Store>& store, const std::string& serial,
                                const std::string& name, StartOf what = StartOf::run);
  // What the unit's runs demand of the next one, those too that the store does not have yet.
  Result<RetestState> unit_state(db::Store& store, const std::string& serial) const;
  // After a run. Only those of kind "jig" count, as in the store. `run.id` is empty where nothing
  // took the run.
  Status note_run(const db::RunRecord& run, bool is_stored);

  Result<StationMemory> memory() const;  // empty where nothing was remembered

 private:
  Result<RetestState> ask_store(db::Store& store, const std::string& serial,
                                const std::string& name, StartOf what);
  Result<RetestState> ask_memory(const std::string& serial, StartOf what) const;
  // Held while the memory is read, changed and written. Null where the disk has no locks.
  Result<std::unique_ptr<FileLock>> hold() const;
  // Brings what `memory` holds about the unit up to what the store has now.
  Result<RetestState> refresh(StationMemory& memory, db::Store& store,
                              const std::string& serial) const;
  Status remember(StationMemory memory) const;

  Env& env_;
  std::string folder_;
  Limits limits_;
};

}  // namespace sixpoint::station

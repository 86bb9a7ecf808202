#include "station/records/station_guard.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/json_text.h"
#include "station/records/station_records.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kName = "/memory.json";
constexpr std::uint64_t kMostMemory_bytes = 16U << 20U;
constexpr std::size_t kMostNames = 64;
constexpr std::size_t kMostWaiting = 64;  // runs of one unit
// A minute: the store is asked while it is held, and one that is silent is given up after ten seconds.
constexpr int kLockAttempts = 3000;
constexpr std::chrono::milliseconds kLockPause{20};

bool contains(const std::vector<std::string>& list, const std::string& text) {
  return std::ranges::find(list, text) != list.end();
}

bool demands_something(const RetestState& state) {
  return state.failures_in_row > 0 || state.passes_needed > 1 || !state.retest_of.empty();
}

Json to_json(const StationMemory& memory) {
  Json json = {{"schema", "sixpoint/station-memory/1"},
               {"id", memory.id},
               {"names", memory.names},
               {"locked", memory.locked},
               {"locked_as", memory.locked_as},
               {"why", memory.why},
               {"check_units", memory.check_units},
               {"units", Json::object()}};
  for (const auto& [serial, state] : memory.units) {
    json["units"][serial] = {{"failures_in_row", state.failures_in_row},
                             {"passes_needed", state.passes_needed},
                             {"may_start", state.may_start},
                             {"retest_of", state.retest_of},
                             {"reason", state.reason}};
  }
  json["waiting"] = Json::object();
  for (const auto& [serial, runs] : memory.waiting) {
    for (const EndedRun& each : runs) {
      json["waiting"][serial].push_back({{"run", each.run.id},
                                         {"verdict", to_string(each.run.verdict)},
                                         {"ended", to_iso8601(each.ended)}});
    }
  }
  return json;
}

StationMemory parse_memory(const Json& json) {
  StationMemory memory;
  json.at("id").get_to(memory.id);
  json.at("names").get_to(memory.names);
  json.at("locked").get_to(memory.locked);
  json.at("locked_as").get_to(memory.locked_as);
  json.at("why").get_to(memory.why);
  json.at("check_units").get_to(memory.check_units);
  for (const auto& [serial, item] : json.at("units").items()) {
    RetestState state;
    item.at("failures_in_row").get_to(state.failures_in_row);
    item.at("passes_needed").get_to(state.passes_needed);
    item.at("may_start").get_to(state.may_start);
    item.at("retest_of").get_to(state.retest_of);
    item.at("reason").get_to(state.reason);
    memory.units[serial] = state;
  }
  const Json waiting = json.value("waiting", Json::object());  // earlier versions did not note it
  for (const auto& [serial, runs] : waiting.items()) {
    for (const Json& item : runs) {
      const auto verdict = parse_jig_verdict(item.at("verdict").get<std::string>());
      const auto ended = parse_iso8601(item.at("ended").get<std::string>());
      if (!verdict || !ended) {
        throw std::invalid_argument("waiting");
      }
      memory.waiting[serial].push_back(
          {{item.at("run").get<std::string>(), *verdict, {}, false}, *ended});
    }
  }
  return memory;
}

}  // namespace

Result<StationMemory> StationGuard::memory() const {
  const std::string path = folder_ + kName;
  if (const auto there = env_.files.info(path);
      !there && there.error().code == ErrorCode::no_input) {
    return StationMemory{};
  }
  const auto damaged = [&path] {
    return fail(ErrorCode::configuration,
                "the station's memory of its lock and of units that failed cannot be read", path,
                "an engineer looks at the station, then removes this file");
  };
  const auto bytes = read_file(env_.files, path, kMostMemory_bytes);
  if (!bytes) {
    // A disk that fails says nothing about the file: it stays.
    return bytes.error().code == ErrorCode::bad_data ? damaged() : fail(bytes.error());
  }
  try {
    return parse_memory(parse_json(as_text(*bytes)));
  } catch (const std::exception&) {  // of nlohmann, and a value that is none
    return damaged();
  }
}

Status StationGuard::remember(StationMemory memory) const {
  const bool known = env_.files.info(folder_ + kName).has_value();
  if (!known && !memory.locked && memory.check_units.empty() && memory.units.empty() &&
      memory.waiting.empty()) {
    return {};
  }
  if (memory.id.empty()) {
    memory.id = text_sha256(folder_ + to_iso8601(env_.clock.now())).substr(0, 16);
  }
  SIXPOINT_CHECK(make_synced_folders(env_.files, folder_));
  return write_file(env_.files, folder_ + kName,
                    to_json(memory).dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

Result<std::unique_ptr<FileLock>> StationGuard::hold() const {
  if (!make_synced_folders(env_.files, folder_)) {
    return nullptr;  // remember() says so, where there is something to remember
  }
  for (int attempt = 0; attempt < kLockAttempts; ++attempt) {
    auto lock = env_.files.lock(folder_ + "/memory.lock");
    if (!lock) {
      return nullptr;
    }
    if (*lock != nullptr) {
      return lock;
    }
    env_.clock.sleep(kLockPause);
  }
  return fail(ErrorCode::io, "another program holds this station's memory", folder_,
              "end it, then run this again");
}

Result<RetestState> StationGuard::may_start(Result<db::Store>& store, const std::string& serial,
                                            const std::string& name, StartOf what) {
  if (store) {
    auto allowed = ask_store(*store, serial, name, what);
    // A store that fails in mid-question is away.
    if (allowed || allowed.error().code == ErrorCode::configuration) {
      return allowed;
    }
  }
  return ask_memory(serial, what);
}

Result<RetestState> StationGuard::ask_store(db::Store& store, const std::string& serial,
                                            const std::string& name, StartOf what) {
  SIXPOINT_ASSIGN(const auto lock, hold());
  SIXPOINT_ASSIGN(StationMemory known, memory());
  if (!contains(known.names, name) && known.names.size() < kMostNames) {
    known.names.push_back(name);
  }
  known.locked = false;
  known.why.clear();
  known.locked_as.clear();
  for (const std::string& each : known.names) {
    SIXPOINT_ASSIGN(const StationState state,
                    station_state(store, each, limits_.check_unit, env_.clock.now()));
    known.check_units = state.check_units;
    if (state.locked && !known.locked) {
      known.locked = true;
      known.why = state.brief();
      known.locked_as = each;
    }
  }
  SIXPOINT_CHECK(refresh(known, store, serial));
  SIXPOINT_CHECK(remember(known));
  if (known.locked && !contains(known.check_units, serial)) {
    return fail(station_is_locked(known.why, known.locked_as));
  }
  if (what == StartOf::study) {
    return RetestState{};
  }
  const auto waiting = known.waiting.find(serial);
  return station::may_start(
      store, serial, name, limits_,
      waiting == known.waiting.end() ? std::vector<EndedRun>{} : waiting->second);
}

Result<RetestState> StationGuard::refresh(StationMemory& memory, db::Store& store,
                                          const std::string& serial) const {
  std::vector<EndedRun> waiting;
  for (const EndedRun& each : memory.waiting[serial]) {
    const auto found = each.run.id.empty() ? Result<std::string>(fail(ErrorCode::no_input, ""))
                                           : store.whole_key("runs", each.run.id);
    if (!found && found.error().code != ErrorCode::no_input) {
      return fail(found.error());
    }
    if (!found) {
      waiting.push_back(each);
    }
  }
  SIXPOINT_ASSIGN(RetestState state, unit_retest_state(store, serial, limits_.retest, waiting));
  memory.units.erase(serial);
  if (demands_something(state)) {
    memory.units[serial] = state;
  } else {
    // A run that nothing took will never be in the store.
    std::erase_if(waiting, [](const EndedRun& each) { return each.run.id.empty(); });
  }
  memory.waiting[serial] = std::move(waiting);
  if (memory.waiting[serial].empty()) {
    memory.waiting.erase(serial);
  }
  return state;
}

Result<RetestState> StationGuard::unit_state(db::Store& store, const std::string& serial) const {
  SIXPOINT_ASSIGN(StationMemory known, memory());
  return refresh(known, store, serial);
}

Result<RetestState> StationGuard::ask_memory(const std::string& serial, StartOf what) const {
  SIXPOINT_ASSIGN(const StationMemory known, memory());
  if (contains(known.check_units, serial)) {
    return RetestState{};
  }
  if (known.locked) {
    return fail(
        station_is_locked(known.why + " (the store does not answer now; this is what it said last)",
                          known.locked_as));
  }
  const auto unit = known.units.find(serial);
  if (unit == known.units.end() || what == StartOf::study) {
    return RetestState{};
  }
  if (!unit->second.may_start) {
    return fail(unit_needs_release(unit->second, serial));
  }
  return unit->second;
}

Status StationGuard::note_run(const db::RunRecord& run, bool is_stored) {
  const auto verdict = parse_jig_verdict(run.verdict);
  const bool failed =
      verdict && (*verdict == JigVerdict::fail || *verdict == JigVerdict::conditional_fail);
  if (run.kind != "jig" || !verdict || (!failed && !is_passed(*verdict))) {
    return {};
  }
  SIXPOINT_ASSIGN(const auto lock, hold());
  SIXPOINT_ASSIGN(StationMemory known, memory());
  const auto found = known.units.find(run.serial);
  if (!is_stored && (failed || found != known.units.end())) {
    std::vector<EndedRun>& waiting = known.waiting[run.serial];
    waiting.push_back({{run.id, *verdict, {}, false}, run.ended});
    if (waiting.size() > kMostWaiting) {
      waiting.erase(waiting.begin());
    }
  }
  RetestState state = found == known.units.end() ? RetestState{} : found->second;
  if (failed) {
    ++state.failures_in_row;
    state.passes_needed = limits_.retest.passes_after_failure;
    if (state.failures_in_row >= limits_.retest.most_failures) {
      state.may_start = false;
      state.reason = fmt::format("the unit failed {} times in a row, as often as the limits allow",
                                 state.failures_in_row);
    }
    known.units[run.serial] = state;
  } else if (found != known.units.end()) {
    state.failures_in_row = 0;
    if (--state.passes_needed > 0) {
      known.units[run.serial] = state;
    } else {
      known.units.erase(found);
    }
  }
  return remember(std::move(known));
}

}  // namespace sixpoint::station

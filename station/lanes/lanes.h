// Lanes: up to sixteen units at once, each with a thread and a run of its own.
//
// A lane is a device string. While nothing runs, its thread opens the unit, shows what it reads and
// notices within a second when it goes or another comes. A run is the same state machine as in the
// terminal (jig_run.h), driven by run_jig(); what it has is on the disk from the first sample, so
// that it goes on after a restart of the program, and a unit that was pulled out goes on when it is
// back. A run belongs to the client that started it: others get `conflict` until they take it over.
//
// All functions may be called from any thread; none waits for a unit.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "device/transport.h"
#include "station/capture_run.h"
#include "station/jig_session.h"

namespace sixpoint::station {

inline constexpr std::size_t kMostLanes = 16;

// Who runs it and where, for the record.
struct RunLabels {
  std::string operator_name;
  std::string station;
  std::string retest_of;  // the run that this one repeats, or empty
};
struct KeptRun {
  std::string run_id;
  std::optional<std::string> constants_id;
  std::string verdict;  // as it was stored; empty: the report's own
};
// Puts a run into the store. Called from any lane's thread, one at a time.
using RunKeeper = std::function<Result<KeptRun>(const JigReport&, const RunLabels&)>;
// Before a run: whether this unit may be measured now and what its earlier runs demand. An error is
// told to the operator and nothing is measured. May be empty.
using StartGate = std::function<Result<RetestState>(const std::string& serial)>;
// Keeps the constants of a calibration file; answers with their id in the store.
using CaptureKeeper = std::function<Result<std::string>(const CaptureReport&)>;

struct LanesOptions {
  std::vector<std::string> devices;  // one lane each, 1 to kMostLanes
  std::string state_folder;          // of this station; made when it is not there
  std::string station;               // its name, for the record
  JigSessionOptions session;
  StartGate may_start;
  // A calibration file: rate, seconds per side, folder.
  CaptureOptions capture;
  std::string capture_folder = ".";
  // How long a run waits for its unit. A person who went for a spare cable comes back in that time.
  double unit_wait_s = 600;
  // Without an accepted pose. One pair of hands serves sixteen lanes, and goes to lunch.
  double pose_time_out_s = 3600;
  double silence_s = 0.9;  // a unit that stopped streaming is noticed within a second
  double retry_s = 0.3;    // between attempts to open a unit
};

enum class LaneState {
  absent,      // no unit
  idle,        // a unit, and nothing runs
  resuming,    // a run of an earlier program waits for its unit
  running,     // a jig run
  unit_away,   // the run waits for its unit
  wrong_unit,  // ... and another one was plugged in
  capturing,   // a calibration file is being recorded
  done,        // a run or capture has ended; the next may start
};
std::string_view to_string(LaneState state);

// Why a lane did not do what it was told.
struct LaneRefusal {
  enum class Kind { no_such_lane, conflict, bad_request } kind = Kind::bad_request;
  std::string what;
  std::string hint;
};
template <class T>
using LaneAnswer = tl::expected<T, LaneRefusal>;

struct StartOrder {
  std::string operator_name;
  std::string client;  // who may command the run
  std::string serial;  // as scanned; empty: not scanned. Must be the unit's own.
  bool write = false;
};

// Calibrated readings for the traces, newest last.
struct LaneTrace {
  std::uint64_t first = 0;  // number of the first one since the lane began
  std::vector<PerAxis<std::int16_t>> force_mg;
  double host_ms = 0;  // Unix time at which the newest came from the unit
};

class Lanes {
 public:
  // `env` and `devices` outlive the lanes. Starts their threads. usage for no or too many devices.
  static Result<std::unique_ptr<Lanes>> open(Env& env, const device::TransportRegistry& devices,
                                             LanesOptions options, RunKeeper keep_run,
                                             CaptureKeeper keep_capture);
  ~Lanes();  // ends the threads; runs stay on the disk, to be resumed
  Lanes(const Lanes&) = delete;
  Lanes& operator=(const Lanes&) = delete;

  std::size_t size() const;
  const std::string& device(std::size_t number) const;

  // Lanes are numbered from 1.
  LaneAnswer<void> start(std::size_t number, const StartOrder& order);
  LaneAnswer<void> start_capture(std::size_t number, const StartOrder& order);
  LaneAnswer<void> say(std::size_t number, const std::string& client, OperatorWord word);
  // The unit lies on the side that the capture asked for.
  LaneAnswer<void> side_is_placed(std::size_t number, const std::string& client);
  // A scanned serial number for this lane, or (number 0) for the lane whose unit it is. Answers
  // with the lane; a mismatch is `conflict` and stays until the right one is scanned.
  LaneAnswer<std::size_t> scan(std::size_t number, const std::string& serial);
  // From now on the run obeys this client.
  LaneAnswer<void> take_over(std::size_t number, const std::string& client,
                             const std::string& operator_name);

  // How often anything but the readings changed, over all lanes.
  std::uint64_t changes() const;
  std::uint64_t changes(std::size_t number) const;
  LaneState state(std::size_t number) const;
  nlohmann::ordered_json to_json(std::size_t number) const;  // docs/station.md
  // The readings from number `first` on, as many as are kept (six seconds), and beside them where
  // the unit lies: {stillness, dwell, face, angle_deg}.
  LaneTrace trace(std::size_t number, std::uint64_t first) const;
  nlohmann::ordered_json live(std::size_t number) const;
  // Lanes that want a hand, the one to serve first in front: one that is being handled already,
  // then by how long they have been waiting.
  std::vector<std::size_t> queue() const;

 private:
  class Lane;
  struct Shared;
  Lanes();
  LaneAnswer<Lane*> lane(std::size_t number) const;

  std::unique_ptr<Shared> shared_;
  std::vector<std::unique_ptr<Lane>> lanes_;
};

}  // namespace sixpoint::station

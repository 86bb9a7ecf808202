// Lanes: up to sixteen units at once, each with a thread and a run of its own.
//
//   LanesOptions options;
//   options.devices = {"virtual:seed=7"};
//   options.state_folder = "state";
//   SIXPOINT_ASSIGN(const auto lanes,
//                   Lanes::open(env, devices, options, store_run, store_constants));
//   StartOrder order;
//   order.operator_name = "Ada";
//   const LaneAnswer<void> started = lanes->start(1, order);
//   std::cout << lanes->to_json(1);
//
// A lane is a device string (docs/virtual.md). While nothing runs, its thread opens the unit, takes
// its samples, and notices within a second when the unit is pulled out or exchanged. A jig run is
// the same state machine as in the terminal (jig_run.h). Its state and its samples are on the disk
// from the first sample: the run continues after a restart of the program, and when a unit that was
// pulled out is plugged in again. A run belongs to the client that started it; other clients get
// `conflict` until they take it over.
//
// Threads: all functions may be called from any thread; none waits for a unit. The callbacks are
// called on the threads of the lanes, StoreRun and StoreConstants by one lane at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "device/transport.h"
#include "station/capture/capture_run.h"
#include "station/records/run_records.h"
#include "station/run/jig_session.h"

namespace sixpoint::station {

inline constexpr std::size_t kMostLanes = 16;

// Operator and place of a run, for its record.
struct RunLabels {
  std::string operator_name;
  bool is_authenticated = false;  // by a PIN
  std::string station;
  std::string retest_of;     // the run that this one repeats, or empty
  std::string kind = "jig";  // or kWriteKind
  std::string jig_id = {};   // the jig's own number, or empty
};
// What became of a run that was to be stored.
struct RunInStore {
  RunIds ids;
  bool is_kept_here = false;           // not in the store; it goes there with the next one
  std::vector<std::string> documents;  // that can be asked for: "certificate.pdf" ...
  std::string said = {};               // that other constants apply, or disagree with these
};
// Puts a run into the store.
using StoreRun = std::function<Result<RunInStore>(const JigReport&, const RunLabels&)>;
// Before a run or a capture: may this unit be measured now, and what do its earlier runs demand? On
// an error nothing is measured, and the operator reads why. May be empty.
using StartCheck = std::function<Result<RetestState>(const std::string& serial)>;
// Constants of a run that passed and was not written.
struct WaitingConstants {
  std::string serial;
  std::string id;
};
// Before they are written: may they be (may_write() of station_records.h)? Answers with why they
// are written no more, or with nothing. On an error they wait on. May be empty.
using WriteCheck = std::function<Result<std::optional<Error>>(const WaitingConstants&)>;
// What became of the constants of a calibration file.
struct KeptConstants {
  std::string id;                     // in the store
  std::optional<Error> file_problem;  // why FILE.constants.json was not written
  std::string said = {};              // as in RunInStore
};
// Stores the constants of a calibration file, and writes them beside it.
using StoreConstants = std::function<Result<KeptConstants>(const CaptureReport&)>;

struct LanesOptions {
  std::vector<std::string> devices;  // one lane each, 1 to kMostLanes
  std::string state_folder;          // of this station; made when it is not there
  std::string station;               // its name, for the record
  std::string jig_id;                // the jig's own number: a run goes on on that jig alone
  JigSessionOptions session;
  StartCheck may_start;
  WriteCheck may_write;
  CaptureOptions capture;  // of a calibration file: rate, seconds per side
  std::string capture_folder = ".";
  double unit_wait_s = 600;       // a run waits so long for its unit: time to fetch a spare cable
  double pose_time_out_s = 3600;  // without an accepted pose: one operator serves sixteen lanes
  double silence_s = 0.9;         // a unit without samples is noticed within a second
  double retry_s = 0.3;           // between attempts to open a unit
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

// Why a lane did not take a command.
struct LaneRefusal {
  enum class Kind { no_such_lane, conflict } kind = Kind::conflict;
  std::string what;
  std::string hint;
};
template <class T>
using LaneAnswer = tl::expected<T, LaneRefusal>;

// What others are shown of a client: its identifier is a secret, because it commands a run. Empty
// for none.
std::string public_name(const std::string& client);

struct StartOrder {
  std::string operator_name;
  bool is_authenticated = false;  // by a PIN
  std::string client;             // that may command the run; a secret of this client
  std::string serial;             // as scanned; the unit must have it. Empty: not scanned.
  bool write = false;
  // No new run: the constants of the lane's last one, which passed, are written into the same unit,
  // read back, and two placements are measured with them.
  bool last_run = false;
};

// Calibrated readings, newest last.
struct LaneTrace {
  std::uint64_t first = 0;  // number of the first reading, counted since the lane was opened
  std::vector<PerAxis<std::int16_t>> force_mg;
  double host_ms = 0;  // Unix time at which the newest reading came from the unit
};

class Lanes {
 public:
  // `env` and `devices` outlive the lanes. Starts their threads. usage for no or too many devices.
  static Result<std::unique_ptr<Lanes>> open(Env& env, const device::TransportRegistry& devices,
                                             LanesOptions options, StoreRun store_run,
                                             StoreConstants store_constants);
  ~Lanes();  // ends the threads; runs stay on the disk, to be continued
  Lanes(const Lanes&) = delete;
  Lanes& operator=(const Lanes&) = delete;

  std::size_t size() const;
  const std::string& device(std::size_t number) const;

  // Lanes are numbered from 1.
  LaneAnswer<void> start(std::size_t number, const StartOrder& order);
  LaneAnswer<void> start_capture(std::size_t number, const StartOrder& order);
  LaneAnswer<void> command(std::size_t number, const std::string& client, OperatorCommand command);
  // The unit lies on the side that the capture asked for.
  LaneAnswer<void> confirm_side(std::size_t number, const std::string& client);
  // The operator saw the lane's motorised jig, which was stopped or had a fault, and says that it
  // is free. Only when no run is under way. `name`: of this operator, for the log; may be empty.
  LaneAnswer<void> release_jig(std::size_t number, const std::string& client,
                               const std::string& name);
  // A scanned serial number for this lane, or (number 0) for the lane that holds this unit. Answers
  // with the lane. A serial of another unit is `conflict`, until the right one is scanned. Where no
  // lane holds the unit, this client's next start is refused, until one does or dismiss_scan().
  LaneAnswer<std::size_t> scan(std::size_t number, const std::string& serial,
                               const std::string& client);
  void dismiss_scan(const std::string& client);
  // From now on the run takes commands from this client.
  LaneAnswer<void> take_over(std::size_t number, const std::string& client,
                             const std::string& operator_name);

  // Counts every change but that of the readings, over all lanes or in one.
  std::uint64_t changes() const;
  std::uint64_t changes(std::size_t number) const;
  LaneState state(std::size_t number) const;
  nlohmann::ordered_json to_json(std::size_t number) const;  // docs/station.md
  // Readings from number `first` on; six seconds of them are held.
  LaneTrace trace(std::size_t number, std::uint64_t first) const;
  // How the unit lies: {stillness, dwell, face, angle_deg}.
  nlohmann::ordered_json live(std::size_t number) const;
  // Lanes that wait for the operator, the one to serve next in front: a lane with a unit that is
  // being moved, then the lane that has waited longest.
  std::vector<std::size_t> queue() const;

 private:
  class Lane;
  struct Shared;
  Lanes();
  LaneAnswer<Lane*> lane(std::size_t number) const;

  struct Unmatched {
    std::string client;
    std::string serial;  // was scanned, and no lane held it
  };
  void forget_scan(const std::string& client);  // under the mutex

  // Refuses while this client's last scan was of a unit that is not in this lane.
  LaneAnswer<Lane*> lane_to_start(std::size_t number, const std::string& client);

  std::unique_ptr<Shared> shared_;
  std::vector<std::unique_ptr<Lane>> lanes_;
  std::mutex mutex_;                 // guards what follows
  std::deque<Unmatched> unmatched_;  // oldest first, one of a client
};

}  // namespace sixpoint::station

// A unit that can be calibrated, whatever it speaks.
//
//   SIXPOINT_ASSIGN(auto unit, devices.open_unit("virtual:seed=7", env));   // unit_registry.h
//   SIXPOINT_CHECK(unit->set_filter(FilterConfiguration::current));
//   SIXPOINT_CHECK(unit->start_stream(100));
//   SIXPOINT_ASSIGN(auto block, unit->next_samples(std::chrono::seconds(1)));
//
// The project's own protocol is WireUnit (wire_unit.h). A vendor's is one folder of its own with a
// class over this interface and one line in a UnitRegistry; a unit that offers files and nothing
// else is DriveUnit (drive/drive_unit.h). What a unit cannot do answers `usage`, and
// abilities() says so beforehand.
//
// Every function blocks, at most for its time-outs on the link's clock, and may be called from one
// thread at a time; cancel() from any. Errors: device_unavailable when the unit is gone or silent,
// bad_data when what it says cannot be, io when it refused.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "device/calibration_page.h"
#include "device/protocol.h"
#include "device/transport.h"

namespace sixpoint::device {

struct UnitOptions {
  // Docs/protocol.md: a unit answers in 200 ms; the rest is for the host's scheduling.
  std::chrono::nanoseconds reply_time_out = std::chrono::milliseconds(300);
  std::chrono::nanoseconds commit_time_out = std::chrono::milliseconds(1500);
  std::chrono::nanoseconds bulk_time_out = std::chrono::seconds(1);
  int attempts = 4;  // per request; the first and three repeats
  // A download that made no progress at all in this many requests is given up.
  int download_attempts = 5;
  // Blocks of samples that wait while a command is under way: 40 s at 100 Hz. What comes beyond is
  // counted as lost, so that a program that never reads cannot fill the memory.
  std::size_t waiting_blocks = 700;
  // After a transfer that failed (a stall): long enough for the host's recovery, short against the
  // time-outs, and time passes even where failing takes none.
  std::chrono::nanoseconds after_failure = std::chrono::milliseconds(10);
  // Between two looks whether a unit that went away is back.
  std::chrono::nanoseconds reopen_interval = std::chrono::milliseconds(100);
};

struct StreamStatistics {
  std::uint64_t samples = 0;
  std::uint64_t lost_samples = 0;       // by the sample index
  std::uint64_t duplicate_reports = 0;  // delivered once
  std::uint64_t damaged_reports = 0;    // CRC, header or content; of every kind
  std::uint64_t overflowed_blocks = 0;  // came while nobody read
  std::uint64_t failed_transfers = 0;   // stalls and the like; repeated
  // Device time against sample index: more apart than a clock can drift.
  std::uint64_t clock_jumps = 0;
  double clock_jumped_s = 0;  // their sum
};

// What a unit can be asked for.
struct UnitAbilities {
  bool streams = false;             // live samples, filter configuration
  bool holds_constants = false;     // a calibration page that can be read and written
  bool records_on_command = false;  // start_recording(), stop_recording()
  bool offers_recordings = false;   // recordings(), download()
};

class Unit {
 public:
  // A unit of the project's own protocol; identifies it. The link is closed with the Unit.
  static Result<std::unique_ptr<Unit>> open(Link link, UnitOptions options = {});

  virtual ~Unit() = default;
  Unit(const Unit&) = delete;
  Unit& operator=(const Unit&) = delete;

  virtual UnitAbilities abilities() const = 0;
  virtual const Identity& identity() const = 0;
  virtual Clock& clock() = 0;
  virtual Jig* jig() { return nullptr; }  // one that is part of the device; mostly none
  virtual const std::string& address() const = 0;
  // Anew: the battery changes. device_unavailable when another unit is there now.
  virtual Result<Identity> identify() = 0;
  // After device_unavailable: waits for the same unit to be back at the same place and opens it
  // again. What was in its RAM (stream, filter) may be lost. device_unavailable when it did not
  // come within `patience`, or another unit came.
  virtual Status reconnect(std::chrono::nanoseconds patience) = 0;

  // What follows answers `usage` unless the unit overrides it (abilities()).
  virtual Result<CalibrationPage> read_calibration();
  // The whole transaction: stage, read back, compare, commit, read, compare. After an error the
  // unit holds the old page or the new one; read_calibration() tells which.
  virtual Status write_calibration(const CalibrationPage& page);

  virtual Result<FilterState> filter();
  virtual Status set_filter(FilterConfiguration filter);  // reads it back

  virtual Status start_stream(int rate_hz);
  // The next block in order. Empty when none came in time.
  virtual Result<std::optional<SampleBlock>> next_samples(std::chrono::nanoseconds time_out);
  virtual Status stop_stream();  // what still waits is dropped
  virtual const StreamStatistics& stream_statistics() const;

  virtual Result<std::uint16_t> start_recording(int rate_hz, UtcTime now);
  virtual Result<std::uint16_t> stop_recording();
  virtual Result<std::vector<RecordingInfo>> recordings();
  // Saves a recording under `path`. What arrives is kept in `path`.HASH.part, and goes on from
  // there in a later call; `path` appears when the whole has the announced SHA-256. cannot_create
  // where `path` exists. `progress` gets the bytes so far.
  virtual Status download(const RecordingInfo& recording, FileSystem& files,
                          const std::string& path,
                          const std::function<void(std::uint64_t)>& progress = {});

  virtual void cancel() = 0;

 protected:
  Unit() = default;
  tl::unexpected<Error> cannot(const char* what) const;
};

}  // namespace sixpoint::device

// A unit that can be calibrated, whatever its protocol.
//
//   Status stream(const device::UnitRegistry& registry, Env& env) {  // unit_registry.h
//     SIXPOINT_ASSIGN(const auto unit, registry.open("virtual:seed=7", env));
//     SIXPOINT_CHECK(unit->set_filter(device::FilterConfiguration::current));
//     SIXPOINT_CHECK(unit->start_stream(100));
//     SIXPOINT_ASSIGN(const auto block, unit->next_samples(std::chrono::seconds(1)));
//     return unit->stop_stream();
//   }
//
// The project's own protocol is WireUnit (wire/wire_unit.h). A vendor's protocol is one folder with
// a class over this interface and one line in a UnitRegistry. A unit that offers files alone is
// DriveUnit (drive/drive_unit.h). abilities() lists what a unit can do; everything else fails with
// `usage`.
//
// Every function blocks, at most for its time-outs on the link's clock, and may be called from one
// thread at a time; cancel() from any. Errors: device_unavailable when the unit is gone or silent,
// bad_data when its answer is impossible, io when it refused.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "device/unit_types.h"

namespace sixpoint::device {

class Jig;

class Unit {
 public:
  virtual ~Unit() = default;
  Unit(const Unit&) = delete;
  Unit& operator=(const Unit&) = delete;

  virtual UnitAbilities abilities() const = 0;
  virtual const Identity& identity() const = 0;
  virtual Clock& clock() = 0;
  virtual Jig* jig() { return nullptr; }  // one that is part of the device; mostly none
  virtual const std::string& address() const = 0;
  // Asks the unit again: the battery changes. device_unavailable when it is another unit now.
  virtual Result<Identity> identify() = 0;
  // After device_unavailable: waits for the same unit at the same address and opens it again. The
  // content of its RAM (stream, filter) may be lost. device_unavailable when it did not come within
  // `patience`, or another unit came. `look` is called between two attempts, where it is not empty;
  // its error ends the wait.
  virtual Status reconnect(std::chrono::nanoseconds patience,
                           const std::function<Status()>& look) = 0;
  Status reconnect(std::chrono::nanoseconds patience) { return reconnect(patience, {}); }

  // The functions below fail with `usage` where a unit does not have them (abilities()).
  virtual Result<CalibrationPage> read_calibration();
  // The whole transaction: stage, read back, compare, commit, read, compare. After an error the
  // unit holds the old page or the new one: read_calibration().
  virtual Status write_calibration(const CalibrationPage& page);

  virtual Result<FilterState> filter();
  virtual Status set_filter(FilterConfiguration filter);  // reads it back

  virtual Status start_stream(int rate_hz);
  // The next block in order. Empty when none came in time.
  virtual Result<std::optional<SampleBlock>> next_samples(std::chrono::nanoseconds time_out);
  virtual Status stop_stream();  // blocks that wait are dropped
  virtual const StreamStatistics& stream_statistics() const;

  virtual Result<std::uint16_t> start_recording(int rate_hz, UtcTime now);
  virtual Result<std::uint16_t> stop_recording();
  virtual Result<std::vector<RecordingInfo>> recordings();
  // Saves a recording as `path`. An incomplete download stays in `path`.HASH.part and a later call
  // continues it; `path` appears when the whole has the announced SHA-256. cannot_create where
  // `path` exists. `progress` gets the bytes so far.
  virtual Status download(const RecordingInfo& recording, FileSystem& files,
                          const std::string& path,
                          const std::function<void(std::uint64_t)>& progress = {});

  virtual void cancel() = 0;

 protected:
  Unit() = default;
  tl::unexpected<Error> cannot(const char* what) const;
};

}  // namespace sixpoint::device

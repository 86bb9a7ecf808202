// An activity monitor on a link, typed.
//
//   SIXPOINT_ASSIGN(auto link, registry.open("virtual:seed=7", env));
//   SIXPOINT_ASSIGN(auto unit, Unit::open(std::move(link)));
//   SIXPOINT_CHECK(unit->set_filter(FilterConfiguration::current));
//   SIXPOINT_CHECK(unit->start_stream(100));
//   SIXPOINT_ASSIGN(auto block, unit->next_samples(std::chrono::seconds(1)));
//
// Every function blocks, at most for its time-outs on the link's clock, and may be called from one
// thread at a time; cancel() from any. Requests that got lost are repeated with the same sequence,
// which a unit executes once (docs/protocol.md). Errors: device_unavailable when the unit is gone
// or silent, bad_data when what it says cannot be, io when it refused.
#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

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
};

struct StreamStatistics {
  std::uint64_t samples = 0;
  std::uint64_t lost_samples = 0;       // by the sample index
  std::uint64_t duplicate_reports = 0;  // delivered once
  std::uint64_t damaged_reports = 0;    // CRC, header or content; of every kind
  std::uint64_t overflowed_blocks = 0;  // came while nobody read
};

class Unit {
 public:
  // Identifies the unit. The link is closed with the Unit.
  static Result<std::unique_ptr<Unit>> open(Link link, UnitOptions options = {});

  const Identity& identity() const { return identity_; }
  Clock& clock() { return *link_.clock; }
  Jig* jig() { return link_.jig.get(); }  // one that is part of the device; else null
  const std::string& address() const { return link_.address; }
  Result<Identity> identify();  // anew: the battery changes

  Result<CalibrationPage> read_calibration();
  // The whole transaction: stage, read back, compare, commit, read, compare. After an error the
  // unit holds the old page or the new one; read_calibration() tells which.
  Status write_calibration(const CalibrationPage& page);

  Result<FilterState> filter();
  Status set_filter(FilterConfiguration filter);  // reads it back

  Status start_stream(int rate_hz);
  // The next block in order. Empty when none came in time.
  Result<std::optional<SampleBlock>> next_samples(std::chrono::nanoseconds time_out);
  Status stop_stream();  // what still waits is dropped
  const StreamStatistics& stream_statistics() const { return statistics_; }

  Result<std::uint16_t> start_recording(int rate_hz, UtcTime now);
  Result<std::uint16_t> stop_recording();
  Result<std::vector<RecordingInfo>> recordings();
  // Saves a recording under `path`. What arrives is kept in `path`.HASH.part, and goes on from
  // there in a later call; `path` appears when the whole has the announced SHA-256. cannot_create
  // where `path` exists. `progress` gets the bytes so far.
  Status download(const RecordingInfo& recording, FileSystem& files, const std::string& path,
                  const std::function<void(std::uint64_t)>& progress = {});

  void cancel();

 private:
  Unit(Link link, UnitOptions options) : link_(std::move(link)), options_(options) {}

  Result<Bytes> ask(Command command, Bytes payload = {}, bool first = false);
  // One report from the unit; empty when none came in time or it was damaged.
  Result<std::optional<Message>> receive(std::chrono::nanoseconds time_out);
  void take_samples(const Message& message);
  Result<Bytes> read_page();
  Status download_from(const RecordingInfo& recording, std::uint64_t& offset, WritableFile& file,
                       Sha256& hash, const std::function<void(std::uint64_t)>& progress);

  Link link_;
  UnitOptions options_;
  Identity identity_;
  std::uint16_t sequence_ = 0;
  std::deque<SampleBlock> waiting_;
  StreamStatistics statistics_;
  bool streaming_ = false;
  std::optional<std::uint32_t> next_index_;
};

}  // namespace sixpoint::device

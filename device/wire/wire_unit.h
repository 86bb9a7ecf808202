// A unit of the project's own protocol (docs/protocol.md), over any pair of channels.
//
//   Result<std::unique_ptr<Unit>> unit = WireUnit::open(std::move(link));  // transport.h
//
// A request that was lost, or whose transfer failed, is repeated with the same sequence; a unit
// executes a sequence once. Nothing else is repeated: only the caller knows whether a whole
// transaction may be.
#pragma once

#include <atomic>
#include <deque>
#include <mutex>

#include "device/jig.h"
#include "device/transport.h"
#include "device/unit.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

struct WireOptions {
  // Docs/protocol.md: a unit answers in 200 ms; the rest is for the host's scheduling.
  std::chrono::nanoseconds reply_time_out = std::chrono::milliseconds(300);
  std::chrono::nanoseconds commit_time_out = std::chrono::milliseconds(1500);
  std::chrono::nanoseconds bulk_time_out = std::chrono::seconds(1);
  int attempts = 4;  // per request; the first and three repeats
  // A download ends after so many requests without progress.
  int download_attempts = 5;
  // Blocks of samples that wait while a command is under way: 40 s at 100 Hz. More are counted as
  // lost, so that a program that never reads cannot fill the memory.
  std::size_t waiting_blocks = 700;
  // After a transfer that failed (a stall): long enough for the host's recovery, short against the
  // time-outs, and time passes even where failing takes none.
  std::chrono::nanoseconds after_failure = std::chrono::milliseconds(10);
  // Between two attempts to open a unit that went away.
  std::chrono::nanoseconds reopen_interval = std::chrono::milliseconds(100);
};

class WireUnit final : public Unit {
 public:
  // Identifies the unit. The link is closed with the WireUnit.
  static Result<std::unique_ptr<Unit>> open(Link link, WireOptions options = {});

  UnitAbilities abilities() const override { return {true, true, true, link_.bulk != nullptr}; }
  const Identity& identity() const override { return identity_; }
  Clock& clock() override { return *link_.clock; }
  Jig* jig() override { return link_.jig.get(); }
  const std::string& address() const override { return link_.address; }
  Result<Identity> identify() override;
  using Unit::reconnect;
  Status reconnect(std::chrono::nanoseconds patience, const std::function<Status()>& look) override;

  Result<CalibrationPage> read_calibration() override;
  Status write_calibration(const CalibrationPage& page) override;

  Result<FilterState> filter() override;
  Status set_filter(FilterConfiguration filter) override;

  Status start_stream(int rate_hz) override;
  Result<std::optional<SampleBlock>> next_samples(std::chrono::nanoseconds time_out) override;
  Status stop_stream() override;
  const StreamStatistics& stream_statistics() const override { return statistics_; }

  Result<std::uint16_t> start_recording(int rate_hz, UtcTime now) override;
  Result<std::uint16_t> stop_recording() override;
  Result<std::vector<RecordingInfo>> recordings() override;
  Status download(const RecordingInfo& recording, FileSystem& files, const std::string& path,
                  const std::function<void(std::uint64_t)>& progress) override;

  void cancel() override;

 private:
  WireUnit(Link link, WireOptions options) : link_(std::move(link)), options_(options) {}

  Result<Bytes> ask(Command command, Bytes payload = {}, bool first = false);
  // One report from the unit; empty when none came in time or it was damaged.
  Result<std::optional<Message>> receive(std::chrono::nanoseconds time_out);
  void take_samples(const Message& message);
  Result<Bytes> read_page();
  Result<std::uint16_t> ask_recording(Command command, Bytes payload);  // the id that it answers
  tl::unexpected<Error> bad_answer(std::string what) const;
  Status download_from(const RecordingInfo& recording, std::uint64_t& offset, WritableFile& file,
                       Sha256& hash, const std::function<void(std::uint64_t)>& progress);
  // The first IDENTIFY of a link; the serial must be `expected`, or any where that is empty.
  Status introduce(const std::string& expected);

  // The last accepted block, to check the next one.
  struct LastBlock {
    std::uint32_t first_index;
    std::uint16_t sequence;
    std::uint64_t device_time_us;
  };

  Link link_;
  std::mutex channels_mutex_;  // for cancel() while reconnect() puts new channels in
  std::atomic<bool> cancelled_ = false;
  bool identity_is_another_ = false;  // by introduce()
  WireOptions options_;
  Identity identity_;
  std::uint16_t sequence_ = 0;
  std::deque<SampleBlock> waiting_;
  StreamStatistics statistics_;
  bool streaming_ = false;
  int rate_hz_ = 0;
  std::optional<std::uint32_t> next_index_;
  std::optional<LastBlock> last_block_;
};

}  // namespace sixpoint::device

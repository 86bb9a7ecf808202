// A unit of the project's own protocol (docs/protocol.md), over any pair of channels.
//
// Requests that got lost are repeated with the same sequence, which a unit executes once; so are
// transfers that failed. Nothing else is repeated here: whether a whole transaction may be, is
// known to who began it.
#pragma once

#include <atomic>
#include <deque>
#include <mutex>

#include "device/unit.h"

namespace sixpoint::device {

class WireUnit final : public Unit {
 public:
  static Result<std::unique_ptr<Unit>> open(Link link, UnitOptions options);

  UnitAbilities abilities() const override { return {true, true, true, link_.bulk != nullptr}; }
  const Identity& identity() const override { return identity_; }
  Clock& clock() override { return *link_.clock; }
  Jig* jig() override { return link_.jig.get(); }
  const std::string& address() const override { return link_.address; }
  Result<Identity> identify() override;
  Status reconnect(std::chrono::nanoseconds patience) override;

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
  WireUnit(Link link, UnitOptions options) : link_(std::move(link)), options_(options) {}

  Result<Bytes> ask(Command command, Bytes payload = {}, bool first = false);
  // One report from the unit; empty when none came in time or it was damaged.
  Result<std::optional<Message>> receive(std::chrono::nanoseconds time_out);
  void take_samples(const Message& message);
  Result<Bytes> read_page();
  Status download_from(const RecordingInfo& recording, std::uint64_t& offset, WritableFile& file,
                       Sha256& hash, const std::function<void(std::uint64_t)>& progress);
  // IDENTIFY as a station does it first of all; the serial must be `expected`, or any where empty.
  Status introduce(const std::string& expected);

  // Of the block that was accepted last, to judge the next by.
  struct LastBlock {
    std::uint32_t first_index;
    std::uint16_t sequence;
    std::uint64_t device_time_us;
  };

  Link link_;
  std::mutex channels_mutex_;  // for cancel() while reconnect() puts new channels in
  std::atomic<bool> cancelled_ = false;
  bool identity_is_another_ = false;  // what introduce() met
  UnitOptions options_;
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

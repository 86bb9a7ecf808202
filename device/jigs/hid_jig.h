// The motorised jig over USB HID (docs/devices/motorised-jig.md), and its messages, which its twin
// in software speaks too (mocks/virtual_hid_jig.h).
//
// Reports are framed as the units' are (protocol.h); the commands are others.
#pragma once

#include <atomic>
#include <mutex>

#include "device/jig.h"
#include "device/protocol.h"
#include "device/transport.h"

namespace sixpoint::device {

enum class JigCommand : std::uint8_t {
  identify = 64,
  go_to = 65,
  state = 66,
  stop = 67,
  clear = 68
};
enum class JigMotion : std::uint8_t {
  unknown = 0,
  standing = 1,
  turning = 2,
  stopped = 3,
  fault = 4
};
enum class JigFault : std::uint8_t {
  none = 0,
  overcurrent = 1,
  encoder = 2,
  obstructed = 3,
  door_open = 4,
  not_homed = 5,
  supply_low = 6,
};
std::string_view to_string(JigFault fault);

struct JigIdentity {
  std::uint8_t version = 1;
  std::string serial;    // at most 16 characters, printable ASCII without blanks
  std::string firmware;  // at most 12
  std::string model;     // at most 12

  bool operator==(const JigIdentity&) const = default;
};
Bytes encode_jig_identity(const JigIdentity& identity);
Result<JigIdentity> decode_jig_identity(std::span<const std::uint8_t> payload);

struct JigState {
  JigMotion motion = JigMotion::unknown;
  std::optional<Pose> pose;      // where it stands, or where it turns to
  double angle_off_deg = 0;      // from that pose, by the jig's encoder; in steps of 0.001
  double uncertainty_deg = 0.1;  // of the angle, standard
  JigFault fault = JigFault::none;
};
Bytes encode_jig_state(const JigState& state);
Result<JigState> decode_jig_state(std::span<const std::uint8_t> payload);

struct HidJigOptions {
  std::chrono::nanoseconds reply_time_out = std::chrono::milliseconds(200);
  int attempts = 4;
  // The longest that a read keeps stop() waiting: an emergency stop is at the motor within 100 ms.
  std::chrono::nanoseconds slice = std::chrono::milliseconds(20);
};

class HidJig final : public Jig {
 public:
  // Identifies it. device_unavailable when it does not answer, bad_data when it says nonsense.
  static Result<std::unique_ptr<HidJig>> open(Link link, HidJigOptions options = {});

  const JigIdentity& identity() const { return identity_; }
  std::string name() const override;
  bool turns_by_itself() const override { return true; }
  Status go_to(Pose pose) override;
  Result<JigReport> report() override;
  // From any thread; a request that is under way in another ends with device_unavailable.
  Status stop() override;

 private:
  HidJig(Link link, HidJigOptions options) : link_(std::move(link)), options_(options) {}

  Result<Bytes> ask(JigCommand command, Bytes payload = {});
  // The caller holds the mutex. An urgent one takes no notice of stop().
  Result<Bytes> ask_locked(JigCommand command, Bytes payload, bool urgent);

  Link link_;
  HidJigOptions options_;
  JigIdentity identity_;
  std::mutex mutex_;
  std::atomic<int> stopping_ = 0;
  std::uint16_t sequence_ = 0;
};

}  // namespace sixpoint::device

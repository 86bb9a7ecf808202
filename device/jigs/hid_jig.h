// The motorised jig over USB HID (docs/devices/motorised-jig.md) and its messages. The jig in
// software (mocks/in_process/virtual_hid_jig.h) uses the same messages.
//
//   SIXPOINT_ASSIGN(const std::unique_ptr<HidJig> jig, HidJig::open(std::move(link)));
//   SIXPOINT_CHECK(jig->go_to(Pose::plus_x));
//
// Reports have the frame of the units' reports (protocol.h) and other commands.
#pragma once

#include <atomic>
#include <mutex>

#include "device/jig.h"
#include "device/jig_registry.h"
#include "device/transport.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

// Numbers on the wire, counted from the first.
enum class JigCommand : std::uint8_t { identify = 64, go_to, state, stop, clear };
enum class JigMotion : std::uint8_t { unknown, standing, turning, stopped, fault };
enum class JigFault : std::uint8_t {
  none,
  overcurrent,
  encoder,
  obstructed,
  door_open,
  not_homed,
  supply_low,
};
std::string_view to_string(JigFault fault);

struct JigIdentity : DeviceNames {
  std::uint8_t version = 1;

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
  // Identifies it. device_unavailable when it does not answer, bad_data when its answer is
  // impossible.
  static Result<std::unique_ptr<HidJig>> open(Link link, HidJigOptions options = {});

  const JigIdentity& identity() const { return identity_; }
  std::string name() const override;
  bool turns_by_itself() const override { return true; }
  Status go_to(Pose pose) override;
  Result<JigPosition> position() override;
  // From any thread; a request that is under way in another ends with device_unavailable.
  Status stop() override;
  // Clears the jig's stop, then looks whether it is free.
  Status release() override;

 private:
  HidJig(Link link, HidJigOptions options) : link_(std::move(link)), options_(options) {}

  Result<Bytes> ask(JigCommand command, Bytes payload = {});
  // The caller holds the mutex. An urgent request does not end by stop().
  Result<Bytes> ask_locked(JigCommand command, Bytes payload, bool urgent);
  // Its state; a stop or a fault that it shows is held until release(). The caller holds the mutex.
  Result<JigState> look_locked();

  Link link_;
  HidJigOptions options_;
  JigIdentity identity_;
  std::mutex mutex_;
  std::atomic<int> stopping_ = 0;
  // Stopped or faulty, and not released since: also where the jig itself forgot it, without power.
  std::atomic<bool> held_ = false;
  std::string held_by_ = "emergency stop";
  std::uint16_t sequence_ = 0;
};

// "hid:SERIAL" and "hid:" (the only one that is plugged in): a HidJig.
void register_hid_jig(JigRegistry& registry);

}  // namespace sixpoint::device

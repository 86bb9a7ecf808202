#include "device/jigs/hid_jig.h"

#include <cmath>

#include <fmt/format.h>

#include "device/usb/discovery.h"
#include "device/usb/hid_transport.h"
#include "device/wire/payload.h"

namespace sixpoint::device {

namespace {

using std::chrono::nanoseconds;

constexpr std::uint8_t kNoPose = 255;

tl::unexpected<Error> bad_answer(std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), "jig",
              "switch the jig off and on; if it stays, the jig or its firmware is faulty");
}

}  // namespace

std::string_view to_string(JigFault fault) {
  constexpr std::array<std::string_view, 7> kNames = {"none",
                                                      "the motor draws too much current",
                                                      "the angle encoder contradicts itself",
                                                      "something is in the way",
                                                      "the door is open",
                                                      "it does not know where it stands",
                                                      "its supply voltage is too low"};
  const auto index = static_cast<std::size_t>(fault);
  return index < kNames.size() ? kNames[index] : "a fault of no known code";
}

Bytes encode_jig_identity(const JigIdentity& identity) {
  PayloadWriter writer;
  writer.put(identity.version);
  put_names(writer, identity);
  return writer.take();
}

Result<JigIdentity> decode_jig_identity(std::span<const std::uint8_t> payload) {
  PayloadReader in(payload);
  JigIdentity identity;
  identity.version = in.get<std::uint8_t>();
  const bool named = get_names(in, identity);
  if (!in.ok() || identity.version == 0 || !named || identity.firmware.empty() ||
      identity.model.empty()) {
    return bad_answer("the jig does not say who it is");
  }
  return identity;
}

Bytes encode_jig_state(const JigState& state) {
  return payload_of(static_cast<std::uint8_t>(state.motion),
                    state.pose ? static_cast<std::uint8_t>(*state.pose) : kNoPose,
                    static_cast<std::int32_t>(std::lround(state.angle_off_deg * 1000)),
                    static_cast<std::uint16_t>(std::lround(state.uncertainty_deg * 1000)),
                    static_cast<std::uint8_t>(state.fault));
}

Result<JigState> decode_jig_state(std::span<const std::uint8_t> payload) {
  PayloadReader in(payload);
  const auto motion = in.get<std::uint8_t>();
  const auto pose = in.get<std::uint8_t>();
  const auto angle_mdeg = in.get<std::int32_t>();
  const auto uncertainty_mdeg = in.get<std::uint16_t>();
  const auto fault = in.get<std::uint8_t>();
  if (!in.ok() || motion > static_cast<std::uint8_t>(JigMotion::fault) ||
      (pose >= kPoses.size() && pose != kNoPose) || std::abs(std::int64_t{angle_mdeg}) > 180'000) {
    return bad_answer("the jig's state cannot be");
  }
  JigState state;
  state.motion = static_cast<JigMotion>(motion);
  if (pose != kNoPose) {
    state.pose = static_cast<Pose>(pose);
  }
  state.angle_off_deg = angle_mdeg / 1000.0;
  state.uncertainty_deg = uncertainty_mdeg / 1000.0;
  state.fault = static_cast<JigFault>(fault);
  if (state.motion == JigMotion::standing && !state.pose) {
    return bad_answer("the jig stands, and in no pose");
  }
  return state;
}

Result<std::unique_ptr<HidJig>> HidJig::open(Link link, HidJigOptions options) {
  std::unique_ptr<HidJig> jig(new HidJig(std::move(link), options));
  SIXPOINT_ASSIGN(const Bytes payload, jig->ask(JigCommand::identify));
  SIXPOINT_ASSIGN(jig->identity_, decode_jig_identity(payload));
  return jig;
}

std::string HidJig::name() const { return fmt::format("{} {}", identity_.model, identity_.serial); }

Result<Bytes> HidJig::ask(JigCommand command, Bytes payload) {
  const std::lock_guard lock(mutex_);
  return ask_locked(command, std::move(payload), false);
}

Result<Bytes> HidJig::ask_locked(JigCommand command, Bytes payload, bool urgent) {
  sequence_ = sequence_ == 0xFFFF ? std::uint16_t{1} : static_cast<std::uint16_t>(sequence_ + 1);
  const auto number = static_cast<Command>(command);
  const Report report =
      encode({ReportKind::request, sequence_, number, ReplyCode::ok, std::move(payload)});
  std::array<std::uint8_t, kReportBytes + 1> buffer{};
  for (int attempt = 0; attempt < options_.attempts; ++attempt) {
    const Status written = link_.reports->write(report, options_.reply_time_out);
    if (!written && written.error().code != ErrorCode::io) {
      return fail(written.error());
    }
    const nanoseconds deadline = link_.clock->elapsed() + options_.reply_time_out;
    for (nanoseconds left = options_.reply_time_out; left > nanoseconds::zero();
         left = deadline - link_.clock->elapsed()) {
      if (!urgent && stopping_ > 0) {
        return fail(ErrorCode::device_unavailable, "the jig was stopped", link_.address,
                    "see to the jig, then begin anew");
      }
      const auto count = link_.reports->read(buffer, std::min(left, options_.slice));
      if (!count) {
        if (count.error().code != ErrorCode::io) {
          return fail(count.error());
        }
        link_.clock->sleep(std::chrono::milliseconds(5));  // a failed transfer takes time too
        continue;
      }
      const auto reply = decode(std::span(buffer).first(std::min(*count, buffer.size())));
      if (*count == 0 || !reply || reply->kind != ReportKind::reply ||
          reply->sequence != sequence_ || reply->command != number) {
        continue;
      }
      if (reply->code != ReplyCode::ok) {
        return fail(ErrorCode::device_unavailable,
                    fmt::format("the jig refused: {}", to_string(reply->code)), link_.address,
                    "see to the jig, then begin anew");
      }
      return reply->payload;
    }
  }
  return fail(ErrorCode::device_unavailable, "the jig does not answer", link_.address,
              "look at its cable and its supply");
}

Status HidJig::go_to(Pose pose) {
  const std::lock_guard lock(mutex_);
  SIXPOINT_CHECK(look_locked());
  if (held_) {
    return fail(ErrorCode::device_unavailable, fmt::format("the jig stopped: {}", held_by_),
                link_.address, "look at the jig; when no hand is in it, say that it is free");
  }
  SIXPOINT_CHECK(ask_locked(JigCommand::go_to, payload_of(static_cast<std::uint8_t>(pose)), false));
  return {};
}

Result<JigState> HidJig::look_locked() {
  SIXPOINT_ASSIGN(const Bytes payload, ask_locked(JigCommand::state, {}, false));
  SIXPOINT_ASSIGN(const JigState state, decode_jig_state(payload));
  if (state.motion == JigMotion::fault) {
    held_by_ = to_string(state.fault);
    held_ = true;
  } else if (state.motion == JigMotion::stopped) {
    held_by_ = "emergency stop";
    held_ = true;
  }
  return state;
}

Result<JigPosition> HidJig::position() {
  const std::lock_guard lock(mutex_);
  SIXPOINT_ASSIGN(const JigState state, look_locked());
  JigPosition position;
  if (state.motion == JigMotion::standing) {
    position.pose = state.pose;
  }
  position.angle_off_deg = state.angle_off_deg;
  position.angle_uncertainty_deg = state.uncertainty_deg;
  if (held_) {
    position.fault = held_by_;
  }
  return position;
}

Status HidJig::stop() {
  ++stopping_;
  held_ = true;  // also where the jig does not answer
  const std::lock_guard lock(mutex_);
  const auto answer = ask_locked(JigCommand::stop, {}, true);
  held_ = true;
  --stopping_;
  SIXPOINT_CHECK(answer);
  return {};
}

Status HidJig::release() {
  const std::lock_guard lock(mutex_);
  SIXPOINT_CHECK(ask_locked(JigCommand::clear, {}, false));
  SIXPOINT_ASSIGN(const JigState state, look_locked());
  if (state.motion == JigMotion::fault || state.motion == JigMotion::stopped) {
    return fail(ErrorCode::device_unavailable, fmt::format("the jig is not free yet: {}", held_by_),
                link_.address,
                "repair the fault, switch the jig off and on, then say again that it is free");
  }
  held_ = false;
  held_by_ = "emergency stop";
  return {};
}

void register_hid_jig(JigRegistry& registry) {
  registry.add("hid", "hid:SERIAL",
               [](std::string_view rest, Env& env, Unit&) -> Result<std::unique_ptr<Jig>> {
                 DiscoveryFilter filter;
                 filter.product_ids = {kJigProductId};
                 filter.serial = rest;
                 SIXPOINT_ASSIGN(const AttachedDevice found, find_device(filter, env.clock));
                 Link link;
                 link.address = fmt::format("hid:{}", found.serial);
                 link.clock = borrow_clock(env.clock);
                 SIXPOINT_ASSIGN(link.reports, open_hid_transport(found.hidraw_node));
                 SIXPOINT_ASSIGN(auto jig, HidJig::open(std::move(link)));
                 return std::unique_ptr<Jig>(std::move(jig));
               });
}

}  // namespace sixpoint::device

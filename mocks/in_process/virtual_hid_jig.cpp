#include "mocks/in_process/virtual_hid_jig.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <mutex>

#include <fmt/format.h>

#include "base/serial.h"
#include "device/wire/payload.h"

namespace sixpoint::mocks {

namespace {

using device::JigCommand;
using device::JigFault;
using device::JigMotion;
using device::ReplyCode;
using std::chrono::nanoseconds;

constexpr std::chrono::seconds kTurnByItself{2};

tl::unexpected<Error> wrong(std::string_view key, std::string_view value) {
  return fail(ErrorCode::usage,
              fmt::format("virtual jig: {}={} is no setting it can have", printable(key, 40),
                          printable(value, 40)),
              {}, "docs/devices/motorised-jig.md lists the settings");
}

bool read_fault(std::string_view text, JigFault& fault) {
  constexpr std::array<std::string_view, 7> kNames = {
      "", "overcurrent", "encoder", "obstructed", "door_open", "not_homed", "supply_low"};
  const auto found = std::find(kNames.begin() + 1, kNames.end(), text);
  fault = static_cast<JigFault>(found == kNames.end() ? 0 : found - kNames.begin());
  return found != kNames.end();
}

template <class Number>
bool read_number(std::string_view text, Number low, Number high, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number >= low &&
         number <= high;
}

bool read_pose(std::string_view text, std::optional<device::Pose>& pose) {
  const auto parsed = device::parse_pose(text);
  pose = parsed ? std::optional(*parsed) : std::nullopt;
  return parsed.has_value();
}

bool read_setting(std::string_view key, std::string_view value, VirtualHidJigOptions& options) {
  if (key == "serial") {
    options.serial = std::string(value);
    return is_serial(value);
  }
  return (key == "fault" && read_fault(value, options.fault)) ||
         (key == "fault_at" && read_number(value, 1, 1000, options.fault_at)) ||
         (key == "wrong_pose_at" && read_number(value, 1, 1000, options.wrong_pose_at)) ||
         (key == "stop_at" && read_number(value, 1, 1000, options.stop_at)) ||
         (key == "stopped" && (options.stopped = value == "1")) ||
         (key == "lean_deg" && read_number(value, -10.0, 10.0, options.lean_deg)) ||
         (key == "worn" && read_pose(value, options.worn)) ||
         (key == "worn_deg" && read_number(value, -10.0, 10.0, options.worn_deg)) ||
         (key == "lie_deg" && read_number(value, 0.0, 90.0, options.lie_deg)) ||
         (key == "uncertainty_deg" && read_number(value, 0.0, 60.0, options.uncertainty_deg));
}

class JigTransport final : public device::Transport {
 public:
  JigTransport(std::shared_ptr<VirtualHidJig> jig, std::shared_ptr<Clock> clock)
      : jig_(std::move(jig)), clock_(std::move(clock)) {}
  Status write(std::span<const std::uint8_t> bytes, nanoseconds /*time_out*/) override {
    const std::lock_guard lock(mutex_);
    jig_->take_report(bytes, clock_->elapsed());
    return {};
  }
  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    {
      const std::lock_guard lock(mutex_);
      if (const auto report = jig_->next_report()) {
        const std::size_t count = std::min(out.size(), report->size());
        std::copy_n(report->begin(), count, out.begin());
        return count;
      }
    }
    clock_->sleep(time_out);
    return 0;
  }
  void cancel() override {}

 private:
  std::shared_ptr<VirtualHidJig> jig_;
  std::shared_ptr<Clock> clock_;
  std::mutex mutex_;
};

}  // namespace

Result<VirtualHidJigOptions> parse_virtual_hid_jig(std::string_view text) {
  VirtualHidJigOptions options;
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    const std::string_view setting = text.substr(0, comma);
    text.remove_prefix(std::min(comma + 1, text.size()));
    const std::size_t equals = std::min(setting.find('='), setting.size());
    const std::string_view key = setting.substr(0, equals);
    const std::string_view value = setting.substr(std::min(equals + 1, setting.size()));
    if (!read_setting(key, value, options)) {
      return wrong(key, value);
    }
  }
  return options;
}

VirtualHidJig::VirtualHidJig(VirtualHidJigOptions options, VirtualJig* physics)
    : options_(std::move(options)), physics_(physics) {
  if (options_.stopped) {
    press_stop();
  }
  for (const device::Pose pose : device::kPoses) {
    if (physics_ != nullptr) {
      physics_->set_lean(pose, options_.lean_deg + (options_.worn == pose ? options_.worn_deg : 0));
    }
  }
}

void VirtualHidJig::press_stop() {
  if (physics_ != nullptr) {
    static_cast<void>(physics_->stop());
  }
  motion_ = motion_ == JigMotion::fault ? JigMotion::fault : JigMotion::stopped;
  pose_.reset();
}

device::JigState VirtualHidJig::state(nanoseconds now) {
  if (motion_ == JigMotion::turning) {
    // Its encoder measures the turn, not the pose in which it really ends.
    const bool there = physics_ == nullptr
                           ? now - turned_at_ >= kTurnByItself
                           : physics_->position().value_or(device::JigPosition{}).pose.has_value();
    motion_ = there ? JigMotion::standing : JigMotion::turning;
  }
  device::JigState state;
  state.motion = motion_;
  state.pose = pose_;
  state.uncertainty_deg = options_.uncertainty_deg;
  state.fault = motion_ == JigMotion::fault ? options_.fault : JigFault::none;
  return state;
}

ReplyCode VirtualHidJig::turn_to(device::Pose pose, nanoseconds now) {
  if (motion_ == JigMotion::fault || motion_ == JigMotion::stopped) {
    return ReplyCode::busy;
  }
  ++turns_;
  pose_ = pose;
  turned_at_ = now;
  motion_ = JigMotion::turning;
  if (options_.fault != JigFault::none && turns_ == options_.fault_at) {
    motion_ = JigMotion::fault;
    return ReplyCode::ok;
  }
  if (physics_ != nullptr) {
    device::Pose really = pose;
    if (turns_ == options_.wrong_pose_at) {
      really = device::pose_of(device::axis_of(pose), -device::sign_of(pose));
    }
    physics_->tilt_next(options_.lie_deg);
    static_cast<void>(physics_->go_to(really));
  }
  if (turns_ == options_.stop_at) {
    press_stop();
  }
  return ReplyCode::ok;
}

device::Message VirtualHidJig::answer(const device::Message& request, nanoseconds now) {
  device::PayloadReader in(request.payload);
  device::Message reply;
  reply.kind = device::ReportKind::reply;
  reply.sequence = request.sequence;
  reply.command = request.command;
  const bool with_pose = static_cast<JigCommand>(request.command) == JigCommand::go_to;
  const auto pose = with_pose ? in.get<std::uint8_t>() : std::uint8_t{0};
  if (!in.finished()) {
    reply.code = ReplyCode::bad_length;
    return reply;
  }
  switch (static_cast<JigCommand>(request.command)) {
    case JigCommand::identify:
      reply.payload = device::encode_jig_identity({{options_.serial, "1.0.0", "SixJig"}, 1});
      return reply;
    case JigCommand::go_to:
      reply.code = pose < device::kPoses.size() ? turn_to(static_cast<device::Pose>(pose), now)
                                                : ReplyCode::bad_argument;
      return reply;
    case JigCommand::state:
      reply.payload = device::encode_jig_state(state(now));
      return reply;
    case JigCommand::stop:
      press_stop();
      return reply;
    case JigCommand::clear:
      if (physics_ != nullptr && motion_ == JigMotion::stopped) {
        static_cast<void>(physics_->release());
      }
      motion_ = motion_ == JigMotion::stopped ? JigMotion::unknown : motion_;
      return reply;
  }
  reply.code = ReplyCode::unknown_command;
  return reply;
}

void VirtualHidJig::take_report(std::span<const std::uint8_t> report, nanoseconds now) {
  auto request = device::decode(report);
  if (!request || request->kind != device::ReportKind::request) {
    return;
  }
  // The sequence rule of docs/protocol.md, but for a stop, which is always done.
  if (last_request_ != *request || static_cast<JigCommand>(request->command) == JigCommand::stop) {
    last_reply_ = device::encode(answer(*request, now));
    last_request_ = std::move(*request);
  }
  replies_.put(last_reply_);
}

std::optional<device::Report> VirtualHidJig::next_report() { return replies_.take(); }

device::Link link_to_jig(std::shared_ptr<VirtualHidJig> jig, std::shared_ptr<Clock> clock) {
  device::Link link;
  link.address = "virtual:";
  link.clock = clock;
  link.reports = std::make_unique<JigTransport>(std::move(jig), std::move(clock));
  return link;
}

void register_virtual_hid_jig(device::JigRegistry& registry) {
  registry.add(
      "virtual", "virtual:serial=J600001",
      [](std::string_view rest, Env&, device::Unit& unit) -> Result<std::unique_ptr<device::Jig>> {
        SIXPOINT_ASSIGN(VirtualHidJigOptions options, parse_virtual_hid_jig(rest));
        auto* const physics = dynamic_cast<VirtualJig*>(unit.jig());
        if (physics == nullptr) {
          return fail(ErrorCode::usage, "a virtual jig turns virtual units only", unit.address(),
                      "use --jig manual, or --device virtual:...");
        }
        SIXPOINT_ASSIGN(auto jig, device::HidJig::open(link_to_jig(
                                      std::make_shared<VirtualHidJig>(std::move(options), physics),
                                      device::borrow_clock(unit.clock()))));
        return std::unique_ptr<device::Jig>(std::move(jig));
      });
}

}  // namespace sixpoint::mocks

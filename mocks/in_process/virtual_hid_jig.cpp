#include "mocks/virtual_hid_jig.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <mutex>

#include <fmt/format.h>

#include "device/payload.h"

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

std::optional<JigFault> parse_fault(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, JigFault>, 6> kFaults = {
      {{"overcurrent", JigFault::overcurrent},
       {"encoder", JigFault::encoder},
       {"obstructed", JigFault::obstructed},
       {"door_open", JigFault::door_open},
       {"not_homed", JigFault::not_homed},
       {"supply_low", JigFault::supply_low}}};
  for (const auto& [name, fault] : kFaults) {
    if (name == text) {
      return fault;
    }
  }
  return std::nullopt;
}

template <class Number>
std::optional<Number> number_of(std::string_view text, Number low, Number high) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || !(number >= low) ||
      !(number <= high)) {
    return std::nullopt;
  }
  return number;
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
    bool good = false;
    if (key == "serial") {
      good = !value.empty() && value.size() <= 16 &&
             std::all_of(value.begin(), value.end(), [](char c) { return c > 0x20 && c < 0x7F; });
      options.serial = std::string(value);
    } else if (key == "fault") {
      const auto fault = parse_fault(value);
      good = fault.has_value();
      options.fault = fault.value_or(JigFault::none);
    } else if (key == "fault_at" || key == "wrong_pose_at") {
      const auto turn = number_of<int>(value, 1, 1000);
      good = turn.has_value();
      (key == "fault_at" ? options.fault_at : options.wrong_pose_at) = turn.value_or(0);
    } else if (key == "lie_deg") {
      const auto angle = number_of<double>(value, 0, 90);
      good = angle.has_value();
      options.lie_deg = angle.value_or(0);
    } else if (key == "uncertainty_deg") {
      const auto angle = number_of<double>(value, 0, 60);
      good = angle.has_value();
      options.uncertainty_deg = angle.value_or(0);
    }
    if (!good) {
      return wrong(key, value);
    }
  }
  return options;
}

VirtualHidJig::VirtualHidJig(VirtualHidJigOptions options, VirtualJig* physics)
    : options_(std::move(options)), physics_(physics) {}

device::JigState VirtualHidJig::state(nanoseconds now) {
  if (motion_ == JigMotion::turning) {
    // Its own encoder sees the turn, whatever pose it really ends in.
    const bool there = physics_ == nullptr
                           ? now - turned_at_ >= kTurnByItself
                           : physics_->report().value_or(device::JigReport{}).pose.has_value();
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
      reply.payload = device::encode_jig_identity({1, options_.serial, "1.0.0", "SixJig"});
      return reply;
    case JigCommand::go_to:
      reply.code = pose < device::kPoses.size() ? turn_to(static_cast<device::Pose>(pose), now)
                                                : ReplyCode::bad_argument;
      return reply;
    case JigCommand::state:
      reply.payload = device::encode_jig_state(state(now));
      return reply;
    case JigCommand::stop:
      if (physics_ != nullptr) {
        static_cast<void>(physics_->stop());
      }
      motion_ = motion_ == JigMotion::fault ? JigMotion::fault : JigMotion::stopped;
      pose_.reset();
      return reply;
    case JigCommand::clear:
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
  replies_.push_back(last_reply_);
}

std::optional<device::Report> VirtualHidJig::next_report() {
  if (replies_.empty()) {
    return std::nullopt;
  }
  const device::Report report = replies_.front();
  replies_.pop_front();
  return report;
}

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

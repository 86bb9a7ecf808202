#include "mocks/in_process/in_process.h"

#include <algorithm>

#include "mocks/firmware/virtual_settings.h"
#include "mocks/in_process/scaled_clock.h"
#include "mocks/in_process/virtual_jig.h"

namespace sixpoint::mocks {

namespace {

tl::unexpected<Error> gone() {
  return fail(ErrorCode::device_unavailable, "the unit was unplugged", "virtual unit",
              "plug it in again");
}

Status check(const CableEvent& event) {
  if (event.kind == CableEvent::Kind::gone) {
    return gone();
  }
  if (event.kind == CableEvent::Kind::stalled) {
    return fail(ErrorCode::io, "the endpoint stalled", "virtual unit", "try again");
  }
  return {};
}

class InProcess final : public device::Transport {
 public:
  InProcess(std::shared_ptr<PluggedUnit> plugged, bool bulk)
      : plugged_(std::move(plugged)), bulk_(bulk), enumeration_(plugged_->faults.enumeration()) {}

  Status write(std::span<const std::uint8_t> bytes, nanoseconds /*time_out*/) override {
    const std::lock_guard lock(plugged_->mutex);
    const nanoseconds now = plugged_->clock->elapsed();
    if (is_gone(now)) {
      return gone();
    }
    return bulk_ ? Status{} : check(plugged_->faults.write_report(plugged_->unit, bytes, now));
  }

  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    const nanoseconds deadline = plugged_->clock->elapsed() + time_out;
    // On the machine's clock a sleep is cut so that cancel() and unplugging are seen in time.
    constexpr nanoseconds kLongestSleep = std::chrono::milliseconds(20);
    for (;;) {
      const nanoseconds now = plugged_->clock->elapsed();
      nanoseconds wake = std::min(deadline, now + kLongestSleep);
      {
        const std::lock_guard lock(plugged_->mutex);
        if (is_gone(now)) {
          return gone();
        }
        FaultInjector& faults = plugged_->faults;
        const CableEvent event =
            bulk_ ? faults.read_bulk(plugged_->unit, now) : faults.read_report(plugged_->unit, now);
        SIXPOINT_CHECK(check(event));
        if (event.kind == CableEvent::Kind::data) {
          return copy(event.bytes, out);
        }
        wake = std::min(wake, faults.next_due(plugged_->unit).value_or(wake));
      }
      if (now >= deadline) {
        return 0;
      }
      plugged_->clock->sleep(std::max(wake - now, nanoseconds(1)));
    }
  }

  void cancel() override {
    const std::lock_guard lock(plugged_->mutex);
    plugged_->cancelled = true;
  }

 private:
  static Result<std::size_t> copy(std::span<const std::uint8_t> bytes,
                                  std::span<std::uint8_t> out) {
    if (bytes.size() > out.size()) {
      return fail(ErrorCode::bad_data, "a transfer is longer than the reader's buffer",
                  "virtual unit", "report this as a defect of the program");
    }
    std::copy(bytes.begin(), bytes.end(), out.begin());
    return bytes.size();
  }

  bool is_gone(nanoseconds now) {
    plugged_->faults.advance(plugged_->unit, now);
    return plugged_->unplugged || plugged_->cancelled || !plugged_->faults.plugged() ||
           plugged_->faults.enumeration() != enumeration_;
  }

  std::shared_ptr<PluggedUnit> plugged_;
  bool bulk_;
  std::uint32_t enumeration_;  // the one that this channel belongs to
};

}  // namespace

device::Link link_to(std::shared_ptr<PluggedUnit> plugged, bool with_jig) {
  device::Link link;
  link.address = "virtual:";
  link.clock = plugged->clock;
  link.reports = std::make_unique<InProcess>(plugged, false);
  link.bulk = std::make_unique<InProcess>(plugged, true);
  link.reopen = [plugged]() -> Result<device::Link> {
    {
      const std::lock_guard lock(plugged->mutex);
      plugged->faults.advance(plugged->unit, plugged->clock->elapsed());
      if (plugged->unplugged || !plugged->faults.plugged()) {
        return gone();
      }
    }
    return link_to(plugged, false);
  };
  if (with_jig) {
    link.jig = std::make_unique<VirtualJig>(std::move(plugged));
  }
  return link;
}

std::uint64_t fresh_seed(Env& env) {
  return env.seed ^ static_cast<std::uint64_t>(env.clock.now().time_since_epoch().count());
}

void register_virtual(device::TransportRegistry& registry) {
  registry.add("virtual", "virtual:seed=7,jig=auto",
               [](std::string_view rest, Env& env) -> Result<device::Link> {
                 SIXPOINT_ASSIGN(VirtualSettings settings,
                                 parse_openable_settings(rest, fresh_seed(env)));
                 std::shared_ptr<Clock> clock = clock_of(settings, env.clock);
                 FaultPlan plan;
                 if (!settings.faults_file.empty()) {
                   SIXPOINT_ASSIGN(plan, read_fault_plan(env.files, settings.faults_file));
                 }
                 return link_to(std::make_shared<PluggedUnit>(std::move(settings.unit),
                                                              std::move(plan), std::move(clock)),
                                settings.with_jig);
               });
}

}  // namespace sixpoint::mocks

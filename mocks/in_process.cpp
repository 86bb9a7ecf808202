#include "mocks/in_process.h"

#include <algorithm>

#include "mocks/scaled_clock.h"
#include "mocks/virtual_jig.h"
#include "mocks/virtual_settings.h"

namespace sixpoint::mocks {

namespace {

tl::unexpected<Error> gone() {
  return fail(ErrorCode::device_unavailable, "the unit was unplugged", "virtual unit",
              "plug it in again");
}

class InProcess final : public device::Transport {
 public:
  InProcess(std::shared_ptr<PluggedUnit> plugged, bool bulk)
      : plugged_(std::move(plugged)), bulk_(bulk) {}

  Status write(std::span<const std::uint8_t> bytes, nanoseconds /*time_out*/) override {
    const std::lock_guard lock(plugged_->mutex);
    if (plugged_->unplugged || plugged_->cancelled) {
      return gone();
    }
    if (!bulk_) {
      plugged_->unit.take_report(bytes, plugged_->clock->elapsed());
    }
    return {};
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
        if (plugged_->unplugged || plugged_->cancelled) {
          return gone();
        }
        if (bulk_) {
          if (const auto block = plugged_->unit.next_bulk(now)) {
            return copy(*block, out);
          }
        } else {
          if (const auto report = plugged_->unit.next_report(now)) {
            return copy(*report, out);
          }
          wake = std::min(wake, plugged_->unit.next_due().value_or(wake));
        }
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

  std::shared_ptr<PluggedUnit> plugged_;
  bool bulk_;
};

}  // namespace

device::Link link_to(std::shared_ptr<PluggedUnit> plugged, bool with_jig) {
  device::Link link;
  link.address = "virtual:";
  link.clock = plugged->clock;
  link.reports = std::make_unique<InProcess>(plugged, false);
  link.bulk = std::make_unique<InProcess>(plugged, true);
  if (with_jig) {
    link.jig = std::make_unique<VirtualJig>(std::move(plugged));
  }
  return link;
}

void register_virtual(device::TransportRegistry& registry) {
  registry.add("virtual", "virtual:seed=7,jig=auto",
               [](std::string_view rest, Env& env) -> Result<device::Link> {
                 SIXPOINT_ASSIGN(VirtualSettings settings, parse_virtual_settings(rest, env.seed));
                 std::shared_ptr<Clock> clock = clock_of(settings, env.clock);
                 return link_to(
                     std::make_shared<PluggedUnit>(std::move(settings.unit), std::move(clock)),
                     settings.with_jig);
               });
}

}  // namespace sixpoint::mocks

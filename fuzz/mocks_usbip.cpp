// A USB/IP session: the input is what a peer sends, in pieces whose lengths are the first bytes of
// each. What comes back is whole replies, and never more than was asked for.
#include <algorithm>
#include <cstdlib>

#include "base/memory_env.h"
#include "mocks/usb/usb_unit.h"
#include "mocks/usb/usbip_session.h"

namespace {

std::uint32_t big32(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value = value << 8U | bytes[at + i];
  }
  return value;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  using namespace sixpoint::mocks;
  static const sim::UnitTruth truth = sim::draw_unit(7);
  const auto clock = std::make_shared<ManualClock>();
  VirtualUnitOptions options;
  options.truth = truth;
  const auto unit = std::make_shared<UsbUnit>(std::make_shared<PluggedUnit>(options, clock));
  UsbipBus bus({unit});
  UsbipLimits limits;
  limits.transfer_bytes = 1U << 20U;
  limits.waiting_bytes = 1U << 20U;
  {
    UsbipSession session(bus, limits);
    // Most inputs begin behind the import, where the interesting part is.
    std::span<const std::uint8_t> rest(data, size);
    bool imported = false;
    if (!rest.empty() && (rest[0] & 1U) != 0) {
      Bytes import = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
      import.resize(40, 0);
      session.receive(import);
      if (session.output().size() != 320) {
        std::abort();
      }
      session.sent(320);
      imported = true;
    }
    std::size_t received = 0;
    while (!rest.empty()) {
      const std::size_t piece = std::min<std::size_t>(rest.size() - 1, std::size_t{rest[0]} * 4);
      session.receive(rest.subspan(1, piece));
      received += piece;
      rest = rest.subspan(1 + piece);
      clock->sleep(std::chrono::milliseconds(7));
      session.pump();
      const auto output = session.output();
      // A reply at least for what was answered; 320 bytes is the longest one without data.
      if (output.size() > limits.waiting_bytes + limits.transfer_bytes + 1024) {
        std::abort();
      }
      if (imported && output.size() >= 48 && big32(output, 0) != 3 && big32(output, 0) != 4) {
        std::abort();
      }
      session.sent(output.size());
    }
    if (received == 0 && !session.output().empty()) {
      std::abort();
    }
  }
  // However it ended, the device can be used again.
  UsbipSession again(bus);
  Bytes import = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
  import.resize(40, 0);
  again.receive(import);
  if (again.output().size() != 320) {
    std::abort();
  }
  return 0;
}

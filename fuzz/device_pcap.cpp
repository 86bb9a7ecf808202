// USB captures: an error or a session whose times do not go back and which can be written.
#include <cstdlib>

#include "base/memory_env.h"
#include "device/session/pcap.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  device::PcapOptions any_device;
  device::PcapOptions one;
  one.device = size > 35 ? data[35] : std::uint8_t{1};
  for (const device::PcapOptions& options : {any_device, one}) {
    const auto session = device::session_from_pcap({data, size}, options);
    if (!session) {
      continue;
    }
    const auto again = device::parse_lines(device::to_lines(session->transfers));
    if (!again || *again != session->transfers) {
      std::abort();
    }
  }
  return 0;
}

// Sessions: the lines, the archive, and a unit opened on whatever they say.
#include <cstdlib>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "device/session/session.h"
#include "device/session/session_replay.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (auto transfers = device::parse_lines(text)) {
    const auto again = device::parse_lines(device::to_lines(*transfers));
    if (!again || *again != *transfers) {
      std::abort();
    }
    device::Session session;
    session.transfers = std::move(*transfers);
    for (const auto match : {device::SessionMatch::strict, device::SessionMatch::by_key}) {
      auto unit = device::WireUnit::open(device::replay_link(session, match));
      if (unit) {
        static_cast<void>((*unit)->read_calibration());
        static_cast<void>((*unit)->recordings());
      }
    }
  }
  MemoryFiles files;
  if (write_file(files, "s.zip", text)) {
    static_cast<void>(device::read_session(files, "s.zip"));
  }
  return 0;
}

// What stands behind virtual: on a command line.
#include <cstdlib>
#include <string_view>

#include "mocks/firmware/virtual_settings.h"
#include "mocks/in_process/virtual_hid_jig.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto settings = mocks::parse_virtual_settings(text, 7);
  if (!settings && settings.error().code != ErrorCode::usage) {
    std::abort();
  }
  static_cast<void>(mocks::parse_openable_settings(text, 7));
  static_cast<void>(mocks::parse_virtual_hid_jig(text));
  return 0;
}

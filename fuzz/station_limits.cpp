// A limits file: what is accepted and written out with its reasons is read as the same.
#include <cstdlib>
#include <string_view>

#include "station/limits/limits.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const auto limits =
      station::parse_limits({reinterpret_cast<const char*>(data), size}, "limits.toml");
  if (!limits) {
    if (limits.error().code != ErrorCode::configuration || limits.error().hint.empty()) {
      std::abort();
    }
    return 0;
  }
  const std::string written = station::to_toml(*limits);
  const auto again = station::parse_limits(written, "again.toml");
  if (!again || station::to_toml(*again) != written) {
    std::abort();
  }
  return 0;
}

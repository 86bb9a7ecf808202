// PARAMETERS, EVENT-sized payloads and samples.
#include <cstdlib>

#include "gt3x/forms/agdc.h"
#include "gt3x/forms/parameters.h"
#include "gt3x/log/samples.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const std::span payload(data, size);
  if (const auto parameters = gt3x::parse_parameters(payload)) {
    const Bytes encoded = gt3x::encode_parameters(parameters->values);
    const auto again = gt3x::parse_parameters(encoded);
    // What stands twice with two values is written once, and is then the value that holds.
    if (!again || again->values != parameters->values || !again->doubled.empty() ||
        (parameters->doubled.empty() && again->constants != parameters->constants) ||
        (parameters->constants && !parameters->agrees_with(*parameters->constants))) {
      std::abort();
    }
    for (const auto& [key, value] : parameters->values) {
      gt3x::encode_float(gt3x::decode_float(value));
    }
  }
  std::vector<gt3x::Counts> samples;
  gt3x::unpack_activity(payload, samples);
  Bytes packed;
  gt3x::append_activity(packed, samples);
  std::vector<gt3x::Counts> again;
  gt3x::unpack_activity(packed, again);
  if (again != samples) {
    std::abort();
  }
  gt3x::unpack_activity2(payload, samples);
  static_cast<void>(gt3x::parse_temperature(payload));
  return 0;
}

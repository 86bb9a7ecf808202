// The decoders of everything that a unit or a jig may send. What is decoded encodes to what came.
#include <cstdlib>

#include "device/jigs/hid_jig.h"
#include "device/wire/protocol.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint::device;
  const std::span<const std::uint8_t> bytes(data, size);
  if (const auto message = decode(bytes)) {
    const Report again = encode(*message);
    if (!std::equal(again.begin(), again.end(), bytes.begin(), bytes.end())) {
      std::abort();
    }
    static_cast<void>(decode_samples(*message));
  }
  // A mutated report seldom has the right CRC: the decoders of payloads get theirs directly.
  const auto payload = bytes.first(std::min(size, kPayloadBytes));
  Message samples;
  samples.kind = ReportKind::samples;
  samples.payload.assign(payload.begin(), payload.end());
  if (const auto block = decode_samples(samples)) {
    const Message again = encode_samples(*block);
    if (!decode_samples(again) || *decode_samples(again) != *block) {
      std::abort();
    }
  }
  static_cast<void>(decode_identity(payload));
  static_cast<void>(decode_filter(payload));
  static_cast<void>(decode_recording(payload));
  static_cast<void>(decode_jig_identity(payload));
  static_cast<void>(decode_jig_state(payload));
  if (const auto block = decode_bulk(bytes); block && block->content.size() > size) {
    std::abort();
  }
  return 0;
}

// activity.bin of the old form: as many samples come out as went in, in seconds of the rate.
#include <cstdlib>

#include "base/memory_env.h"
#include "gt3x/recording_writer.h"
#include "gt3x/sample_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  MemoryEnv memory;
  auto out = gt3x::RecordingWriter::create(memory.files, "f", {gt3x::Packing::store, 1});
  const std::string_view info =
      "Serial Number: NEO1B34100019\r\nSample Rate: 30\r\nStart Date: 635641850400000000\r\n";
  if (!out || !out->add("info.txt", info) || !out->add("activity.bin", Bytes(data, data + size)) ||
      !out->commit()) {
    std::abort();
  }
  auto recording = gt3x::Recording::open(memory.files, "f");
  if (!recording) {
    std::abort();
  }
  gt3x::SampleReader reader(*recording);
  std::size_t samples = 0;
  for (;;) {
    const auto item = reader.next();
    if (!item || (*item && (*item)->counts.size() > 30)) {
      std::abort();
    }
    if (!*item) {
      break;
    }
    samples += (*item)->counts.size();
  }
  // Two samples in nine bytes, one in the first five of them.
  if (samples != size / 9 * 2 + (size % 9 >= 5 ? 1 : 0)) {
    std::abort();
  }
  return 0;
}

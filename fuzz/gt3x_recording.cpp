// A whole file: opened, read to its end, exported, copied. Errors are answers; crashes are not.
#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "gt3x/rows/raw_csv.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  MemoryEnv memory;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (!write_file(memory.files, "f", bytes)) {
    return 0;
  }
  auto recording = gt3x::Recording::open(memory.files, "f");
  if (!recording) {
    return 0;
  }
  // Filling may legally write 400 days; ten megabytes tell as much.
  std::size_t written = 0;
  const gt3x::TextSink sink = [&](std::string_view text) -> Status {
    written += text.size();
    if (written > 10'000'000) {
      return fail(ErrorCode::io, "enough", {}, "stop");
    }
    return {};
  };
  static_cast<void>(gt3x::write_raw_csv(*recording, {}, sink));
  gt3x::RawCsvOptions raw;
  raw.raw_lsb = true;
  raw.fill = false;
  raw.time = gt3x::RawCsvOptions::Time::iso;
  static_cast<void>(gt3x::write_raw_csv(*recording, raw, sink));
  auto out = gt3x::RecordingWriter::create(memory.files, "g");
  if (out) {
    for (const gt3x::EntryInfo& entry : recording->entries()) {
      if (entry.size < 1'000'000) {
        static_cast<void>(out->copy(*recording, entry.name));
      }
    }
    static_cast<void>(out->commit());
  }
  return 0;
}

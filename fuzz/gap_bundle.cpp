// A bundle's three text files beside a good recording: the first byte says which of them is
// hostile, and whether what was read is diagnosed, too (slow). Whatever is read is within the
// recording, and a diagnosis of it answers.
#include <cstdlib>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "gap/judge/diagnose.h"
#include "gap/recording/bundle.h"
#include "sim/bundle_writer.h"
#include "sim/scenario.h"

namespace {

using namespace sixpoint;

MemoryEnv& prepared() {
  static MemoryEnv* memory = [] {
    auto* made = new MemoryEnv;  // lives as long as the fuzzer
    const auto scenario = sim::parse_scenario(
        R"({"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production"})");
    if (!scenario || !sim::write_bundle(made->files, "b", *scenario)) {
      std::abort();
    }
    return made;
  }();
  return *memory;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  static const char* const kNames[] = {"b/protocol.json", "b/temperature.csv", "b/host_clock.csv"};
  static const Bytes kGood[] = {*read_file(prepared().files, kNames[0]),
                                *read_file(prepared().files, kNames[1]),
                                *read_file(prepared().files, kNames[2])};
  const std::size_t which = data[0] % 3;
  const bool diagnosed = data[0] >= 0xFC;  // seconds each: few, so that the readers get most
  MemoryFiles& files = prepared().files;
  const auto put = [&](std::string_view text) {
    (void)files.remove(kNames[which]);
    if (!write_file(files, kNames[which], text)) {
      std::abort();
    }
  };
  put({reinterpret_cast<const char*>(data + 1), size - 1});
  const auto bundle = gap::read_bundle(files, "b");
  if (bundle) {
    for (const gap::Segment& segment : bundle->segments) {
      if (segment.first_sample + segment.samples > bundle->samples.size()) {
        std::abort();
      }
    }
    if (diagnosed) {
      const auto diagnosis = gap::diagnose(*bundle);
      if (!diagnosis || diagnosis->brief().empty()) {
        std::abort();
      }
    }
  }
  put({reinterpret_cast<const char*>(kGood[which].data()), kGood[which].size()});
  return 0;
}

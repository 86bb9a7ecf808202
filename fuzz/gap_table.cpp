// A table of readings: read within its bounds, and diagnosed where it is one.
#include <cstdlib>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "gap/unguided/readings_table.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  if (size == 0) {
    return 0;
  }
  MemoryEnv memory;
  // The first byte says whether it is packed, and whether the rate is told.
  const std::string path = (data[0] & 1U) != 0 ? "t.csv.gz" : "t.csv";
  gap::ReadingsTableOptions options;
  if ((data[0] & 2U) != 0) {
    options.rate_hz = 30;
  }
  if (!write_file(memory.files, path, {reinterpret_cast<const char*>(data + 1), size - 1})) {
    std::abort();
  }
  const auto table = gap::read_readings_table(memory.files, path, options);
  if (table && (!(table->rate_hz > 0) || table->rests.size() > table->blocks)) {
    std::abort();
  }
  static_cast<void>(gap::diagnose_table(memory.files, path, {}, options));
  return 0;
}

// A whole file, damaged as it likes: what is read without --salvage is read with it as well, the
// same, and without a loss; what is read with it alone has one. Lengths stay bounded.
#include <cstdlib>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "gt3x/salvage_losses.h"
#include "gt3x/sample_reader.h"

namespace {

using namespace sixpoint;

struct Read {
  std::vector<gt3x::Counts> samples;
  std::size_t losses = 0;
};

Result<Read> read(FileSystem& files, bool salvage) {
  gt3x::RecordingOptions options;
  options.salvage = salvage;
  options.limits.entry_bytes = 4U << 20U;
  options.limits.ratio_matters_from_bytes = 1U << 20U;
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, "f", options));
  gt3x::SampleReader reader(recording);
  Read out;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    out.samples.insert(out.samples.end(), item->counts.begin(), item->counts.end());
  }
  // Damage inside a log is none of the archive's.
  SIXPOINT_CHECK(gt3x::salvage_losses(recording, reader.statistics()));
  out.losses = recording.damage().size();
  return out;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  MemoryEnv memory;
  if (!write_file(memory.files, "f", as_text({data, size}))) {
    return 0;
  }
  const auto strict = read(memory.files, false);
  const auto salvaged = read(memory.files, true);
  if (!salvaged) {
    // Without the option also the entries that no one reads here may be damaged, not the other way.
    return strict ? (std::abort(), 0) : 0;
  }
  if (strict && salvaged->samples != strict->samples) {
    std::abort();
  }
  if (!strict && salvaged->losses == 0 && strict.error().code == ErrorCode::bad_data &&
      !salvaged->samples.empty()) {
    std::abort();
  }
  return 0;
}

// log.bin: the items, one behind the other, are the input; a record that says its checksum holds
// has one that does.
#include <cstdlib>

#include "gt3x/log/log_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const Bytes log(data, data + size);
  gt3x::LogReader reader(std::make_unique<gt3x::MemorySource>(log));
  Bytes joined;
  for (;;) {
    const auto item = reader.next();
    if (!item) {
      std::abort();
    }
    if (!*item) {
      break;
    }
    const gt3x::LogItem& seen = **item;
    if (seen.raw.empty() || seen.offset != joined.size()) {
      std::abort();
    }
    joined.insert(joined.end(), seen.raw.begin(), seen.raw.end());
    if (seen.kind == gt3x::LogItem::Kind::record) {
      const bool holds =
          gt3x::record_checksum(seen.raw.first(seen.raw.size() - 1)) == seen.raw.back();
      if (holds != seen.record.checksum_ok ||
          seen.record.payload.size() + gt3x::kRecordOverhead != seen.raw.size()) {
        std::abort();
      }
    }
  }
  if (joined != log || reader.statistics().bytes != log.size()) {
    std::abort();
  }
  return 0;
}

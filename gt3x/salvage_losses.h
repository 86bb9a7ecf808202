// What a damaged recording lost, with times: what stands beside everything that was made of it.
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, "unit.gt3x", {true, {}}));
//   SIXPOINT_ASSIGN(auto log, recording.open_log());  // read to its end
//   SIXPOINT_ASSIGN(const auto losses, salvage_losses(recording, log.statistics()));
//   for (const SalvageLoss& loss : losses) {
//     std::cout << loss.brief() << '\n';
//   }
//
// | what was found                                     | loss                                     |
// |----------------------------------------------------|------------------------------------------|
// | log.bin ends before its time                       | missing, from the last good record to    |
// |                                                    | Last Sample Time, where info.txt says it |
// | no CRC proves what was read of log.bin             | doubtful, from its first to its last     |
// |                                                    | good record                              |
// | bytes of the log that are no records               | missing, between the records around them |
// | a record with a wrong checksum                     | missing, that second                     |
// | any other damage of the archive or of an entry     | missing or doubtful, without times       |
//
// Records have checksums of 8 bits: of wrong bytes one record in 256 passes. Only a CRC that holds
// proves an entry, so what is read of a log without one is doubtful as a whole.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gt3x/log/log_reader.h"
#include "gt3x/recording.h"

namespace sixpoint::gt3x {

struct SalvageLoss {
  enum class Kind : std::uint8_t { missing, doubtful };
  Kind kind = Kind::missing;
  std::string entry;                  // empty: the archive
  std::optional<std::uint32_t> from;  // Unix time
  std::optional<std::uint32_t> to;
  std::string why;

  // "2015-04-09T14:04:00 .. 2015-04-09T14:05:00 missing: log.bin: the packed data end too early"
  std::string brief() const;
};
std::string_view to_string(SalvageLoss::Kind kind);

// `log`: of the whole log (empty for the old form). The other entries are read here, to find their
// damage; errors are those of the disk. Beyond kMostLosses of one sort, one loss says how many
// there are in all.
inline constexpr std::size_t kMostLosses = 100;
Result<std::vector<SalvageLoss>> salvage_losses(Recording& recording, const LogStatistics& log);
// The same for who has no such statistics: reads the log once more.
Result<std::vector<SalvageLoss>> salvage_losses(Recording& recording);

}  // namespace sixpoint::gt3x

#include "gt3x/salvage_losses.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "gt3x/forms/clock.h"

namespace sixpoint::gt3x {
namespace {

using Kind = SalvageLoss::Kind;

std::string time_or_mark(std::optional<std::uint32_t> unix_time) {
  return unix_time ? clock_time({}, *unix_time) : "?";
}

bool ends_early(Damage kind) {
  return kind == Damage::wrong_length || kind == Damage::broken_stream ||
         kind == Damage::lost_entry;
}

std::optional<std::uint32_t> last_sample_of(const Info& info, std::optional<std::uint32_t> after) {
  const auto last = info.last_sample();
  if (!last) {
    return std::nullopt;
  }
  const std::int64_t seconds = to_unix_seconds(*last);
  const bool fits = seconds >= std::int64_t{after.value_or(0)} &&
                    seconds <= std::numeric_limits<std::uint32_t>::max();
  return fits ? std::optional(static_cast<std::uint32_t>(seconds)) : std::nullopt;
}

Status read_through(Recording& recording, const std::string& name) {
  SIXPOINT_ASSIGN(const auto source, recording.open_entry(name));
  Bytes piece(std::size_t{64} * 1024);
  std::size_t count = 0;
  do {
    SIXPOINT_ASSIGN(count, source->read(piece));
  } while (count > 0);
  return {};
}

}  // namespace

std::string_view to_string(SalvageLoss::Kind kind) {
  return kind == Kind::missing ? "missing" : "doubtful";
}

std::string SalvageLoss::brief() const {
  std::string text;
  if (from || to) {
    text = fmt::format("{} .. {} ", time_or_mark(from), time_or_mark(to));
  }
  return text + fmt::format("{}: {}{}", to_string(kind),
                            entry.empty() ? "" : printable(entry, 60) + ": ", printable(why));
}

Result<std::vector<SalvageLoss>> salvage_losses(Recording& recording, const LogStatistics& log) {
  const std::string samples = recording.has_log() ? "log.bin" : "activity.bin";
  for (const EntryInfo& entry : recording.entries()) {
    if (entry.name != samples) {
      SIXPOINT_CHECK(read_through(recording, entry.name));
    }
  }
  std::vector<SalvageLoss> losses;
  for (const RecordingDamage& damage : recording.damage()) {
    const bool of_samples = damage.entry == samples;
    if (ends_early(damage.kind)) {
      SalvageLoss loss{Kind::missing, damage.entry, {}, {}, damage.why};
      if (of_samples) {
        loss.from = log.last_time;
        loss.to = last_sample_of(recording.info(), log.last_time);
      }
      losses.push_back(std::move(loss));
    }
    if (damage.kind == Damage::no_directory || damage.kind == Damage::no_info) {
      losses.push_back({Kind::missing, damage.entry, {}, {}, damage.why});
    } else if (damage.kind != Damage::lost_entry) {
      SalvageLoss loss{Kind::doubtful, damage.entry, {}, {}, {}};
      loss.why = ends_early(damage.kind)
                     ? "no CRC proves what could be read"
                     : damage.why + "; something in it is damaged, or all of it is right";
      if (of_samples) {
        loss.from = log.first_time;
        loss.to = log.last_time;
      }
      losses.push_back(std::move(loss));
    }
  }
  for (std::size_t i = 0; i < std::min(log.losses.size(), kMostLosses); ++i) {
    const Loss& loss = log.losses[i];
    losses.push_back({Kind::missing, samples, loss.time_before, loss.time_after,
                      fmt::format("{} bytes at {} are no records", loss.bytes, loss.offset)});
  }
  if (log.damaged_stretches > kMostLosses) {
    losses.push_back({Kind::missing,
                      samples,
                      {},
                      {},
                      fmt::format("{} such stretches in all", log.damaged_stretches)});
  }
  for (std::size_t i = 0; i < std::min(log.failures.size(), kMostLosses); ++i) {
    const ChecksumFailure& failure = log.failures[i];
    losses.push_back({Kind::missing, samples, failure.unix_time, failure.unix_time,
                      fmt::format("a record of {} at {} has a wrong checksum",
                                  record_type_name(failure.type), failure.offset)});
  }
  if (log.checksum_failures > kMostLosses) {
    losses.push_back({Kind::missing,
                      samples,
                      {},
                      {},
                      fmt::format("{} such records in all", log.checksum_failures)});
  }
  return losses;
}

Result<std::vector<SalvageLoss>> salvage_losses(Recording& recording) {
  if (!recording.has_log()) {
    SIXPOINT_CHECK(read_through(recording, "activity.bin"));
    return salvage_losses(recording, LogStatistics());
  }
  SIXPOINT_ASSIGN(auto log, recording.open_log());
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      return salvage_losses(recording, log.statistics());
    }
  }
}

}  // namespace sixpoint::gt3x

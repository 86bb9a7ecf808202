#include "gt3x/salvaged_info.h"

#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "gt3x/forms/parameters.h"
#include "gt3x/log/samples.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kEnoughSeconds = 600;

struct LogFacts {
  std::optional<Parameters> parameters;
  std::optional<std::uint32_t> start;
  std::map<std::size_t, std::size_t> seconds_of_size;  // samples in a second: how many seconds
  std::size_t seconds = 0;
};

void take_samples(const Record& record, LogFacts& facts) {
  std::vector<Counts> samples;
  if (record.is(RecordType::activity)) {
    unpack_activity(record.payload, samples);
  } else if (record.is(RecordType::activity2)) {
    unpack_activity2(record.payload, samples);
  } else if (record.is(RecordType::activity3)) {
    unpack_activity3(record.payload, samples);
  }
  if (samples.empty() || record.payload.size() <= 1) {
    return;
  }
  if (!facts.start) {
    facts.start = record.unix_time;
  }
  ++facts.seconds_of_size[samples.size()];
  ++facts.seconds;
}

Result<LogFacts> facts_of_log(Recording& recording) {
  LogFacts facts;
  SIXPOINT_ASSIGN(auto log, recording.open_log());
  while (!facts.parameters || facts.seconds < kEnoughSeconds) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item) {
      break;
    }
    if (item->kind != LogItem::Kind::record || !item->record.checksum_ok) {
      continue;
    }
    if (!facts.parameters && item->record.is(RecordType::parameters)) {
      if (auto parsed = parse_parameters(item->record.payload)) {
        facts.parameters = *std::move(parsed);
      }
    }
    if (facts.seconds < kEnoughSeconds) {
      take_samples(item->record, facts);
    }
  }
  return facts;
}

std::optional<std::size_t> rate_of(const LogFacts& facts) {
  constexpr std::uint32_t kLargestRate_hz = 10'000;
  if (facts.parameters) {
    const auto rate = facts.parameters->values.find(kParameterSampleRate);
    if (rate != facts.parameters->values.end() && rate->second >= 1 &&
        rate->second <= kLargestRate_hz) {
      return rate->second;
    }
  }
  const auto most = std::ranges::max_element(facts.seconds_of_size, {},
                                             [](const auto& entry) { return entry.second; });
  return most == facts.seconds_of_size.end() ? std::nullopt : std::optional(most->first);
}

}  // namespace

Result<SalvagedInfo> salvaged_info(Info left, Recording& recording) {
  SalvagedInfo out{std::move(left), {}};
  std::vector<std::string> given;
  const auto give = [&](const char* key, const std::string& value) {
    if (!out.info.get(key)) {
      out.info.set(key, value);
      given.emplace_back(key);
    }
  };
  if (recording.has_log()) {
    SIXPOINT_ASSIGN(const LogFacts facts, facts_of_log(recording));
    if (facts.parameters && facts.parameters->firmware) {
      give("Firmware", *facts.parameters->firmware);
    }
    if (const auto rate_hz = rate_of(facts)) {
      give("Sample Rate", fmt::format("{}", *rate_hz));
    }
    if (facts.start) {
      give("Start Date", fmt::format("{}", to_ticks(from_unix_seconds(*facts.start))));
    }
    if (facts.parameters && facts.parameters->accel_scale_lsb_per_g) {
      give("Acceleration Scale", fmt::format("{}", *facts.parameters->accel_scale_lsb_per_g));
    }
  }
  constexpr std::array<const char*, 7> kWanted = {"Serial Number",   "Device Type", "Firmware",
                                                  "Sample Rate",     "Start Date",  "Stop Date",
                                                  "Last Sample Time"};
  std::vector<std::string> missing;
  for (const char* key : kWanted) {
    if (!out.info.get(key)) {
      missing.emplace_back(key);
    }
  }
  out.said = fmt::format("info.txt is lost or damaged; from the log: {}; not known: {}",
                         given.empty() ? "nothing" : fmt::format("{}", fmt::join(given, ", ")),
                         missing.empty() ? "nothing" : fmt::format("{}", fmt::join(missing, ", ")));
  return out;
}

}  // namespace sixpoint::gt3x

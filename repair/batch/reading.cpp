#include "repair/batch/reading.h"

#include <algorithm>

#include <fmt/format.h>
#include <unistd.h>

#include "gt3x/forms/agdc.h"
#include "gt3x/log/log_reader.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

std::uint64_t half_of_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page = sysconf(_SC_PAGESIZE);
  return pages > 0 && page > 0
             ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page) / 2
             : UINT64_MAX;
}

namespace {

Status take_constants(Inspection& found, gt3x::Recording& recording,
                      const gt3x::SampleReader& reader) {
  if (!recording.has_log()) {
    if (const auto memory = unit_memory(recording)) {
      found.constants = memory->constants;
      add_facts(*memory, found.facts);
    }
    return {};
  }
  SIXPOINT_ASSIGN(const FirstParameters first, first_parameters(recording, reader));
  if (first.record) {
    add_facts(*first.record, found.facts);
  }
  if (found.form == "agdc") {
    const auto agdc = gt3x::agdc_calibration(recording, found.rate_hz.value_or(0));
    found.constants = agdc ? agdc->constants : std::nullopt;
    if (!agdc || !agdc->already_applied) {
      found.accel_scale_lsb_per_g.reset();  // the file says 1, which is no scale
    }
    return {};
  }
  found.constants = first.known_constants();
  found.accel_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(
      recording.info(), first.record_stands_before ? &*first.record : nullptr);
  return {};
}

void take_gaps(Inspection& found, const gt3x::GapList& gaps) {
  found.gaps = gaps.listed();
  found.gap_count = gaps.count();
  found.gap_seconds = gaps.seconds();
  for (const gt3x::Gap& gap : gaps.listed()) {
    found.end_s =
        std::max(found.end_s, static_cast<double>(gap.start) + static_cast<double>(gap.seconds));
  }
}

}  // namespace

Result<Inspection> reading_of(gt3x::Recording& recording, const gt3x::SampleStream& stream,
                              bool salvage) {
  const gt3x::SampleReader& reader = stream.reader();
  const gt3x::Info& info = recording.info();
  Inspection found;
  found.log = reader.statistics();
  found.form = !recording.has_log()                               ? "gt3x_old"
               : found.log.count(gt3x::RecordType::activity3) > 0 ? "agdc"
                                                                  : "gt3x";
  found.facts = header_facts(info);
  found.device_type = info.device_type();
  found.rate_hz = info.sample_rate_hz();
  found.accel_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(info, nullptr);
  found.entries = recording.entries();
  found.clock = reader.clock();
  SIXPOINT_ASSIGN(found.already_repaired, carries_repair_mark(recording));
  SIXPOINT_CHECK(take_constants(found, recording, reader));
  const std::vector<gt3x::RowRun>& runs = stream.runs();
  if (!runs.empty()) {
    found.start = runs.front().unix_time;
    for (std::size_t i = 0; i < runs.size(); ++i) {  // a clock may have been set back
      const std::uint64_t end_row = i + 1 < runs.size() ? runs[i + 1].first_row : stream.rows();
      found.end_s = std::max(found.end_s,
                             runs[i].unix_time + static_cast<double>(end_row - runs[i].first_row) /
                                                     static_cast<double>(stream.rate_hz()));
    }
  }
  if (const auto start = info.start(); start && found.start) {
    found.first_after_start_s = std::int64_t{*found.start} - to_unix_seconds(*start);
  }
  SIXPOINT_ASSIGN(const gt3x::RawCsvTally tally, stream.tally());
  found.samples = tally.samples + tally.surplus_samples;
  if (stream.fills()) {
    found.irregular = reader.irregular();
    take_gaps(found, stream.gaps());
  } else {
    gt3x::SampleReader by_clock(recording);
    SIXPOINT_ASSIGN(const gt3x::GapList gaps, gt3x::gaps_of(by_clock));
    found.irregular = by_clock.irregular();
    take_gaps(found, gaps);
  }
  if (tally.checksum_failures + tally.damaged_stretches > 0) {
    found.warnings.push_back(
        fmt::format("{} records with a wrong checksum and {} damaged stretches were left out",
                    tally.checksum_failures, tally.damaged_stretches));
  }
  if (salvage) {
    SIXPOINT_ASSIGN(found.losses, gt3x::salvage_losses(recording, found.log));
  }
  return found;
}

}  // namespace sixpoint::repair

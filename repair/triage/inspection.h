// What a recording holds: facts of its header, samples, gaps, damage, still periods. No verdict.
//
//   SIXPOINT_ASSIGN(const Inspection found, inspect(env.files, "a.gt3x"));
//   if (!found.problem) {  // the file can be used
//     for (const InspectedGap& gap : found.gaps) {
//       std::cout << gap.seconds << " s are missing\n";
//     }
//   }
//
// One pass, in bounded memory: the samples themselves are not kept.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/stored_constants.h"
#include "calib/coverage.h"
#include "gt3x/gap_list.h"
#include "gt3x/recording.h"
#include "gt3x/salvage_losses.h"
#include "gt3x/sample_reader.h"
#include "repair/triage/still_scan.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {

using InspectedGap = gt3x::Gap;

struct InspectedStill {
  calib::Coverage coverage;
  MagnitudeError magnitude;
};

struct Inspection {
  std::string form;  // gt3x, gt3x_old, agdc or agd
  FileFacts facts;
  std::string device_type;
  std::optional<double> rate_hz;
  std::optional<double> accel_scale_lsb_per_g;
  gt3x::Clock clock;                   // that the times below are by
  std::optional<std::uint32_t> start;  // Unix time of the first sample
  // That first sample after the Start Date of info.txt; 1 is usual in some firmware.
  std::optional<std::int64_t> first_after_start_s;
  double end_s = 0;  // Unix time after the last sample, or after the last gap where that is later
  std::uint64_t samples = 0;
  std::uint64_t clipped_samples = 0;
  gt3x::LogStatistics log;
  gt3x::Irregular irregular;
  std::optional<StoredConstants> constants;
  std::vector<InspectedGap> gaps;  // gt3x/gap_list.h: the first ones
  std::uint64_t gap_count = 0;
  std::uint64_t gap_seconds = 0;
  std::optional<InspectedStill> still;
  bool already_repaired = false;
  std::vector<gt3x::EntryInfo> entries;
  // With the option salvage: what was lost.
  std::optional<std::vector<gt3x::SalvageLoss>> losses;
  std::vector<std::string> warnings;
  std::optional<Error> problem;  // the file can be read, but not used

  double duration_s() const;
};

// A .gt3x, .agdc or .agd file. Errors as Recording::open() and read_agd_facts(); bad_data for an
// old form without a sample rate.
Result<Inspection> inspect(FileSystem& files, const std::string& path,
                           const gt3x::RecordingOptions& how = {});

}  // namespace sixpoint::repair

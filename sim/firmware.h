// What the unit's firmware does with a raw reading.
//
//   FirmwareScaler firmware(draw_unit(7), 12);                // 12-bit samples
//   const gt3x::Counts stored = firmware.store({5, 3, 262});  // raw counts of the sensor
//   firmware.clipped();                                       // 0
//
// Written from the paper and the table of the affected versions, on purpose without any code of
// calib/ (README.md).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/stored_constants.h"
#include "gt3x/log/samples.h"
#include "sim/effects/effect.h"
#include "sim/unit_truth.h"

namespace sixpoint::sim {

// The release of firmware 1.1.0, from which on units were calibrated under `current`.
inline constexpr std::int64_t kFilterChange_unix_s = 1'395'619'200;  // 2014-03-24T00:00:00Z

// major, minor, patch; nothing where the text is no such version.
std::optional<std::array<int, 3>> parse_version(std::string_view firmware);

// The configuration under which constants of this date were measured. Only MOS units ever had two;
// all others answer `current`.
FilterConfiguration filter_of_constants(std::string_view serial, UtcTime calibrated);

// The configuration that this firmware sets while recording (paper, Issue Description): `legacy`
// for MOS units calibrated before 2014-03-24, except under 1.4.0 to 1.7.0, which lack the run-time
// check and always set `current`. A firmware that is no version counts as older than 1.4.0.
FilterConfiguration filter_of_recording(std::string_view serial, std::string_view firmware,
                                        UtcTime calibrated);

// Firmware 1.6.0 on MOS units stores x' = -y, y' = x.
bool turns_axes(std::string_view serial, std::string_view firmware);

// Scales by the stored constants (paper, Eq. 1-6), rounds half away from zero to the stored scale,
// and clips to `bits` (12 or 16).
class FirmwareScaler {
 public:
  FirmwareScaler(const UnitTruth& unit, int bits, const NumberFormat& format = {});

  gt3x::Counts store(const PerAxis<int>& raw_lsb);
  std::uint64_t clipped() const { return clipped_; }  // samples with at least one clipped axis

 private:
  PerAxis<double> sensitivity_g_per_lsb_{};
  PerAxis<double> zero_lsb_{};
  double scale_lsb_per_g_;
  double low_;
  double high_;
  bool turned_;
  NumberFormat format_;
  std::uint64_t clipped_ = 0;
};

}  // namespace sixpoint::sim

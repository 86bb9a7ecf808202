// What a serial number says about the unit.
//
//   model_of("MOS2A45130450");                       // "wGT3X-BT"
//   default_accel_scale_lsb_per_g("MOS2A45130450");  // 256
//   unit_serial("mos2a45130450");                    // "MOS2A45130450"
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace sixpoint::gt3x {

// By prefix, from the vendor's public descriptions: NEO GT3X+, CLE wGT3X+, MRA ActiSleep+, MOS0 and
// MOS2 wGT3X-BT, MOS3 wActiSleep+, MOS4 wActiSleep-BT, TAS GT9X Link, CPW CentrePoint Insight
// Watch. "unknown" for every other; other MOS prefixes are "wGT3X-BT family".
std::string_view model_of(std::string_view serial);

// The scale of the stored counts where the file does not say: 341 LSB/g for NEO, CLE and MRA (the
// vendor's public library divides by it), 256 for MOS and TAS; nothing for the rest (CPW stores raw
// counts). Capitals or not: files with either are known.
std::optional<double> default_accel_scale_lsb_per_g(std::string_view serial);

// The serial number as the unit itself, its label and the store have it. Some files have it in small
// letters.
//
// | the file's                                              | the unit's   |
// |---------------------------------------------------------|--------------|
// | of a known model, letters and digits alone, 16 at most  | in capitals  |
// | any other, such as another maker's                      | the same     |
std::string unit_serial(std::string_view serial);

}  // namespace sixpoint::gt3x

#include "gap/explain/catalogue.h"

namespace sixpoint::gap {

const std::vector<CatalogueEntry>& catalogue() {
  static const std::vector<CatalogueEntry> kEntries = {
      {"tilt", kPoses, "faces", "geometry", 0, "level the jig's base", "yaw"},
      {"seating", kRepeats, "reseat", "slow", 0,
       "seat the unit more firmly; check the nest for play and dirt"},
      {"settling", kMoves, "faces", "transient", 0,
       "wait longer after each move, or stiffen the jig"},
      {"floor_vibration", kPoses, "faces", "line", 0, "isolate the jig from the floor"},
      {"soft_mount", kShaker, "shaker", "response", 0, "tighten the strap or mount on the shaker"},
      {"local_gravity", kPoses | kShaker, "shaker", "gain", 0.0027,
       "enter the station's own gravity"},
      {"misalignment", kPoses, "faces", "geometry", 0,
       "the sensor sits turned in its case: correct by rotation", "yaw"},
      {"non_orthogonality", kPoses, "faces", "geometry", 0.01, "correct by a cross-axis matrix",
       "oblique"},
      {"second_order", kPoses, "faces", "curvature", 0, "correct by a quadratic per axis",
       "shaker"},
      {"third_order", kHighShaker, "shaker_high", "curvature", 0, "correct by a cubic per axis"},
      {"hysteresis", kBothWays, "faces_reversed", "approach", 0,
       "approach every pose from the same side"},
      {"offset_tempco", kTemperature, "ramp_up", "slow", 1,
       "correct by temperature, or wait until it is steady"},
      {"sensitivity_tempco", kSoak, "soak", "temperature", 0.05, "correct the gain by temperature"},
      {"warm_up", kPoses, "faces", "slow", 0, "wait ten minutes after power-on", "still"},
      {"drift", kPoses | kHours, "still", "slow", 0,
       "repeat the first pose at the end and correct by time"},
      {"filter_mismatch", kPoses, "faces", "gain", 0,
       "the constants belong to another filter configuration: calibrate under the one in force "
       "(16CPAN03)"},
      {"bandwidth", kPoses, "faces", "response", 0, "check the sensor's anti-alias setting"},
      {"flicker", kLongRecord, "still", "slow", 0, "average over shorter times"},
      {"random_walk", kPoses, "still", "slow", 0, "calibrate shortly before use"},
      {"electrical_line", kPoses, "faces", "line", 0,
       "look for a supply or a charger that couples in"},
      {"axis_rotation", kPoses, "faces", "axes", 0, "turn the axes back (firmware 1.6.0)"},
      {"clock_error", kHostClock, "still", "timing", 200, "correct the sample rate"},
      {"jitter", kHighShaker, "shaker_high", "timing", 0, "check the sampling interrupt"},
      {"dropped_samples", kHostClock, "still", "timing", 0, "samples are lost: check the FIFO"},
      {"duplicated_samples", kHostClock, "still", "timing", 0,
       "samples are repeated: check the FIFO"},
      {"truncation", kPoses, "oblique", "number_format", 0,
       "the firmware truncates where it should round"},
      {"rounding_floor", kNever, "", "number_format", 0,
       "not separable from an offset of half an LSB"},
      {"saturation", kFullScale, "shaker_high", "range", 0, "check the sensor's range setting"},
      {"wrap", kFullScale, "shaker_high", "range", 0,
       "the stored number overflows instead of clipping"},
      {"idle_sleep", kPoses, "faces", "holds", 0, "switch idle sleep off for calibration"},
      {"charging_zeros", kPoses, "faces", "holds", 0, "take the unit off its charger"},
  };
  return kEntries;
}

const CatalogueEntry* find_entry(std::string_view name) {
  for (const CatalogueEntry& entry : catalogue()) {
    if (entry.name == name) {
      return &entry;
    }
  }
  return nullptr;
}

}  // namespace sixpoint::gap

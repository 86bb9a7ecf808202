// What the diagnosis knows about each effect of the catalogue beside its forward model: which
// protocol segments show it, which others look like it, what the sensor's datasheet allows.
//
//   const CatalogueEntry* entry = find_entry("drift");  // nullptr for a name that it lacks
//   const std::string_view segment = entry->segment;    // "still" shows it
//
// The list of names is the contract's; sim/ holds the forward models under the same names.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sixpoint::gap {

struct CatalogueEntry {
  std::string_view name;
  // What a protocol needs to show it; see Ability.
  unsigned needs = 0;
  std::string_view segment;  // that would show it
  std::string_view family;   // members of one family look alike where data are few
  // Largest size that the ADXL362's datasheet (or the mechanics of a sound jig) allows, in the unit
  // of the first parameter; 0: nothing said.
  double datasheet = 0;
  std::string_view advice;  // one sentence for a technician
  // The segment that shows smaller sizes, where `segment` is there already; empty: the same.
  std::string_view finer = {};
};

// What a protocol offers.
enum Ability : unsigned {
  kPoses = 1,          // six faces
  kMoves = 2,          // steps between poses with their transients
  kYaws = 4,           // a face at several yaws
  kRepeats = 8,        // a pose placed more than once
  kShaker = 16,        // tones
  kHighShaker = 32,    // tones of 4 g and more
  kFullScale = 64,     // tones beyond full scale
  kTemperature = 128,  // still at temperatures 5 C apart
  kSoak = 256,         // opposite faces at temperatures 5 C apart
  kLongRecord = 512,   // five minutes in one pose
  kHostClock = 1024,
  kHours = 2048,       // half an hour between first and last dwell
  kBothWays = 4096,    // poses approached from both sides
  kNever = 1U << 20U,  // no protocol on one unit shows it
};

const std::vector<CatalogueEntry>& catalogue();
const CatalogueEntry* find_entry(std::string_view name);

}  // namespace sixpoint::gap

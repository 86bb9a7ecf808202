// What may be delivered of an archive that is damaged: the one rule.
//
//   what_may_be_delivered(Damage::wrong_crc, /*salvage=*/false);  // Delivery::nothing
//   what_may_be_delivered(Damage::wrong_crc, /*salvage=*/true);   // Delivery::what_is_left
//
// `salvage`: the user asked for what is left. What is left is never called right: each damage is
// listed beside it (recording.h, salvage_losses.h).
//
// | damage        | what was found                                     | without | with salvage |
// |---------------|----------------------------------------------------|---------|--------------|
// | none          | every byte, and its CRC holds                      | all     | all          |
// | wrong_crc     | as many bytes as said, another CRC                 | nothing | what_is_left |
// | no_crc        | nothing says which CRC it should have              | nothing | what_is_left |
// | wrong_length  | fewer bytes than said, or more (cut off)           | nothing | what_is_left |
// | broken_stream | its packed bytes end, or make no sense, at a place | nothing | what_is_left |
// | lost_entry    | listed, and not where the list says                | nothing | what_is_left |
// | no_directory  | the list of entries is missing or damaged          | nothing | what_is_left |
// | no_info       | info.txt is missing, or cannot be read             | nothing | what_is_left |
// | no_samples    | neither log.bin nor activity.bin                   | nothing | nothing      |
// | refused       | why_refused() (entry_rule.h), two of one name      | nothing | nothing      |
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace sixpoint::gt3x {

enum class Damage : std::uint8_t {
  none,
  wrong_crc,
  no_crc,
  wrong_length,
  broken_stream,
  lost_entry,
  no_directory,
  no_info,
  no_samples,
  refused
};
std::string_view to_string(Damage damage);  // "wrong_crc"

enum class Delivery : std::uint8_t { all, what_is_left, nothing };
Delivery what_may_be_delivered(Damage damage, bool salvage);

// What to do about a damage that is refused; names --salvage where that would deliver something.
std::string hint_about(Damage damage);

}  // namespace sixpoint::gt3x

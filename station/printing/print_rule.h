// Which runs print a label by themselves: those whose unit holds what was measured.
//
//   if (const std::string why_not = why_no_label(finished, /*in_store=*/true); !why_not.empty()) {
//     std::cout << "no label: " << why_not;
//   }
//
// | verdict                 | the unit answered       | in the store | printed                         |
// |-------------------------|-------------------------|--------------|---------------------------------|
// | pass, conditional_pass  | what was written        | yes          | yes                             |
// | pass, conditional_pass  | what was written        | not yet      | no: its number may not be found |
// | pass, conditional_pass  | something else, nothing | any          | no                              |
// | pass, conditional_pass  | nothing was written     | any          | no                              |
// | fail, conditional_fail  | any                     | any          | no                              |
// | stopped, inconclusive   | any                     | any          | no                              |
//
// A label says that the unit holds what was measured; who reads it trusts that. The same holds for
// "Print label again". A pure function.
#pragma once

#include <string>

#include "db/records.h"

namespace sixpoint::station {

// Empty where a label is printed. `run` as the store gives it back.
std::string why_no_label(const db::RunRecord& run, bool in_store);

}  // namespace sixpoint::station

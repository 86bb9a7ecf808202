// Which program this is. The store has it beside every measurement and every repair.
//
//   software_name();       // "sixpoint 1.0.0"
//   software_and_build();  // "sixpoint 1.0.0 (1d698a7c04db)"
#pragma once

#include <string>

namespace sixpoint::station {

std::string software_name();  // "sixpoint 1.0.0"
// The commit that was built ("1d698a7c04db", with "-dirty" where files differed from it); empty
// where it was not built from a git checkout.
std::string software_build();
// Both: "sixpoint 1.0.0 (1d698a7c04db)".
std::string software_and_build();

}  // namespace sixpoint::station

// Which program this is: what the store keeps beside everything that it measured or mended.
#pragma once

#include <string>

namespace sixpoint::station {

std::string software_name();  // "sixpoint 0.1.0"
// The commit that was built ("1d698a7c04db", with "-dirty" where files differed from it); empty
// where it was not built from a git checkout.
std::string software_build();

}  // namespace sixpoint::station

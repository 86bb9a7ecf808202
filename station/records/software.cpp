#include "station/software.h"

#include "sixpoint_build.h"

namespace sixpoint::station {

std::string software_name() { return "sixpoint " SIXPOINT_VERSION; }
std::string software_build() { return SIXPOINT_BUILD; }

}  // namespace sixpoint::station

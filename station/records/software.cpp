#include "station/records/software.h"

#include "sixpoint_build.h"

namespace sixpoint::station {

std::string software_name() { return "sixpoint " SIXPOINT_VERSION; }
std::string software_build() { return SIXPOINT_BUILD; }
std::string software_and_build() {
  return software_build().empty() ? software_name()
                                  : software_name() + " (" + software_build() + ")";
}

}  // namespace sixpoint::station

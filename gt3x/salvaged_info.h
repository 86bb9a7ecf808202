// info.txt of a recording that lost it, or a part of it (private to this room).
//
//   SIXPOINT_ASSIGN(const SalvagedInfo salvaged, salvaged_info(Info(), recording));
//   salvaged.info.sample_rate_hz();  // as the log says
//
// Lines that are there stay. Of those that are missing, the log says some:
//
// | line               | from                                                                    |
// |--------------------|-------------------------------------------------------------------------|
// | Firmware           | PARAMETERS                                                              |
// | Acceleration Scale | PARAMETERS                                                              |
// | Sample Rate        | PARAMETERS, else the number of samples that most seconds have           |
// | Start Date         | the time of the first samples                                           |
//
// Nothing else is guessed: no serial number from the name of the file, no scale from a model.
#pragma once

#include <string>

#include "gt3x/recording.h"

namespace sixpoint::gt3x {

struct SalvagedInfo {
  Info info;
  std::string said;  // which lines the log gave, and which no one knows
};

// `left`: what could be read of info.txt. Errors are those of the log's source.
Result<SalvagedInfo> salvaged_info(Info left, Recording& recording);

}  // namespace sixpoint::gt3x

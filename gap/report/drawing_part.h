// What gap/drawing gives to this room (base/parts/part.h). Private to the two.
#pragma once

#include <string>

#include "base/env.h"
#include "base/result.h"

namespace sixpoint::gap {

struct DrawingPart {
  Result<Bytes> (*png)(const std::string& svg);  // sheet_png()
  Result<Bytes> (*pdf)(const std::string& svg);  // sheet_pdf()
};

}  // namespace sixpoint::gap

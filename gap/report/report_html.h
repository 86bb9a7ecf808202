// The diagnosis as one HTML page without other files: its drawings are SVG.
//
//   page = gap::report_html(diagnosis);
//
// One sentence on top for a technician; below it for an engineer: effects with their evidence, the
// gap before, after each effect and its floor, residuals by segment, noise spectrum, tones, the
// temperature loop, the response to a step.
#pragma once

#include <string>

#include "gap/judge/diagnosis.h"

namespace sixpoint::gap {

std::string report_html(const Diagnosis& diagnosis);

}  // namespace sixpoint::gap

// The diagnosis as one page that needs nothing else: drawings are SVG inside it.
//
// One sentence on top for a technician; below it what an engineer wants to see: effects with their
// evidence, the way from the gap before to the floor, residuals by segment, noise spectrum, tones,
// the temperature loop, the response to a step.
#pragma once

#include <string>

#include "gap/diagnosis.h"

namespace sixpoint::gap {

std::string report_html(const Diagnosis& diagnosis);

}  // namespace sixpoint::gap

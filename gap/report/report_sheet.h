// The diagnosis as one sheet of paper (A4, SVG): to be printed, or turned into PNG or PDF.
//
//   SIXPOINT_ASSIGN(const Bytes pdf, gap::sheet_pdf(gap::report_sheet(diagnosis)));
#pragma once

#include <string>

#include "base/env.h"
#include "base/result.h"
#include "gap/judge/diagnosis.h"

namespace sixpoint::gap {

std::string report_sheet(const Diagnosis& diagnosis);

// A sheet drawn by librsvg and cairo, which are loaded at the first call. internal where they
// refuse it, cannot_create where they do not load.
Result<Bytes> sheet_png(const std::string& svg);
Result<Bytes> sheet_pdf(const std::string& svg);

// What gap/drawing gives to this room (base/parts/part.h).
struct DrawingPart {
  Result<Bytes> (*png)(const std::string& svg);
  Result<Bytes> (*pdf)(const std::string& svg);
};

}  // namespace sixpoint::gap

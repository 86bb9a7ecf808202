// PNG and PDF of a sheet: drawn by gap/drawing.
#include "base/parts/part.h"
#include "gap/report/report_sheet.h"

extern "C" [[gnu::weak]] const sixpoint::gap::DrawingPart sixpoint_part_drawing;

namespace sixpoint::gap {

Result<Bytes> sheet_png(const std::string& svg) {
  SIXPOINT_ASSIGN(const DrawingPart* drawing, part("drawing", &sixpoint_part_drawing));
  return drawing->png(svg);
}

Result<Bytes> sheet_pdf(const std::string& svg) {
  SIXPOINT_ASSIGN(const DrawingPart* drawing, part("drawing", &sixpoint_part_drawing));
  return drawing->pdf(svg);
}

}  // namespace sixpoint::gap

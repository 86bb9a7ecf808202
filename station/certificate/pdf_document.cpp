#include "station/certificate/pdf_document.h"

#include "base/parts/part.h"

extern "C" [[gnu::weak]] const sixpoint::station::PdfPart sixpoint_part_pdf;

namespace sixpoint::station {

Result<std::unique_ptr<PdfDocument>> new_pdf_document(const std::string& title, UtcTime made) {
  SIXPOINT_ASSIGN(const PdfPart* pdf, part("pdf", &sixpoint_part_pdf));
  return pdf->begin(title, made);
}

}  // namespace sixpoint::station

// A PDF of A4 pages: text, lines and boxes, placed in millimetres from the top left corner.
//
//   SIXPOINT_ASSIGN(const auto pdf, new_pdf_document("Title", when));
//   pdf->add_page();
//   pdf->text(20, 30, "Measured by Łukasz", {PdfFont::bold, 10});
//   SIXPOINT_ASSIGN(const Bytes bytes, pdf->bytes());
//
// Text is UTF-8, in the fonts DejaVu Sans and DejaVu Sans Mono (Debian package fonts-dejavu-core),
// which are embedded. Pango takes a character that they lack from another installed font. Where no
// font has it, a box with its code is drawn. Control characters and bytes that are not UTF-8 are
// written as \xNN. The same calls give the same bytes on the same machine: no clock, no random
// identifier. One thread at a time.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "base/result.h"
#include "base/time.h"

namespace sixpoint::station {

enum class PdfFont { regular, bold, mono };
enum class Align { left, right };

struct TextStyle {
  PdfFont font = PdfFont::regular;
  double size_pt = 8;
  double grey = 0;  // 0 black, 1 white
};

class PdfDocument {
 public:
  static constexpr double kWidth_mm = 210;
  static constexpr double kHeight_mm = 297;

  virtual ~PdfDocument() = default;

  virtual void add_page() = 0;  // all that follows is drawn there
  virtual std::size_t pages() const = 0;

  // The text in lines of at most `width_mm`, at least one. A word that is wider is cut.
  virtual std::vector<std::string> lines(std::string_view text, double width_mm,
                                         const TextStyle& style) = 0;
  // `y_mm` is the baseline. Align::right: the text ends at `x_mm`.
  virtual void text(double x_mm, double y_mm, std::string_view text, const TextStyle& style,
                    Align align) = 0;
  void text(double x_mm, double y_mm, std::string_view words, const TextStyle& style) {
    text(x_mm, y_mm, words, style, Align::left);
  }
  virtual void line(double x1_mm, double y1_mm, double x2_mm, double y2_mm, double width_mm,
                    double grey) = 0;
  virtual void box(double x_mm, double y_mm, double width_mm, double height_mm,
                   double grey) = 0;  // filled

  // Ends the document. internal when cairo failed anywhere before.
  virtual Result<Bytes> bytes() = 0;
};

// An empty document, drawn by station/pdf, which is loaded at the first call: cannot_create where
// it does not load. `made`: the document's own date.
Result<std::unique_ptr<PdfDocument>> new_pdf_document(const std::string& title, UtcTime made);

// What station/pdf gives to this room (base/parts/part.h).
struct PdfPart {
  std::unique_ptr<PdfDocument> (*begin)(const std::string& title, UtcTime made);
};

}  // namespace sixpoint::station

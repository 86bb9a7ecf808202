// A PDF of A4 pages: text, lines and boxes, placed in millimetres from the top left corner.
//
//   PdfDocument pdf("Title", when);
//   pdf.add_page();
//   pdf.text(20, 30, "Measured by Łukasz", {PdfFont::bold, 10});
//   SIXPOINT_ASSIGN(const Bytes bytes, pdf.bytes());
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

  // `made`: the document's own date.
  PdfDocument(const std::string& title, UtcTime made);
  PdfDocument(const PdfDocument&) = delete;
  PdfDocument& operator=(const PdfDocument&) = delete;
  ~PdfDocument();

  void add_page();  // all that follows is drawn there
  std::size_t pages() const;

  // The text in lines of at most `width_mm`, at least one. A word that is wider is cut.
  std::vector<std::string> lines(std::string_view text, double width_mm, const TextStyle& style);
  // `y_mm` is the baseline. Align::right: the text ends at `x_mm`.
  void text(double x_mm, double y_mm, std::string_view text, const TextStyle& style,
            Align align = Align::left);
  void line(double x1_mm, double y1_mm, double x2_mm, double y2_mm, double width_mm, double grey);
  void box(double x_mm, double y_mm, double width_mm, double height_mm, double grey);  // filled

  // Ends the document. internal when cairo failed anywhere before.
  Result<Bytes> bytes();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station

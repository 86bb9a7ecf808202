// A PDF of A4 pages: text, lines and boxes in millimetres from the top left corner.
//
// The same calls give the same bytes: no clock, no random identifier, standard fonts only
// (Helvetica, Courier), which need not be embedded. Text is UTF-8; what is not in Windows-1252 is
// written as \u{...}, because the standard fonts have no glyph for it. One thread at a time.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "base/env.h"
#include "base/result.h"
#include "base/time.h"

namespace sixpoint::station {

enum class PdfFont { regular, bold, mono };

class PdfDocument {
 public:
  static constexpr double kWidth_mm = 210;
  static constexpr double kHeight_mm = 297;

  // `made`: what the document says about its own date.
  PdfDocument(const std::string& title, UtcTime made);
  PdfDocument(const PdfDocument&) = delete;
  PdfDocument& operator=(const PdfDocument&) = delete;
  ~PdfDocument();

  void add_page();               // and go on there
  void go_to(std::size_t page);  // 0 .. pages() - 1
  std::size_t pages() const;

  double width_mm(std::string_view text, PdfFont font, double size_pt) const;
  // `y_mm` is the baseline. `grey`: 0 black, 1 white.
  void text(double x_mm, double y_mm, std::string_view text, PdfFont font, double size_pt,
            double grey = 0);
  void line(double x1_mm, double y1_mm, double x2_mm, double y2_mm, double width_mm = 0.15,
            double grey = 0);
  void box(double x_mm, double y_mm, double width_mm, double height_mm, double grey);  // filled

  Result<Bytes> bytes();  // internal when the library failed anywhere before

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station

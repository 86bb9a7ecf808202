// Pages that fill from top to bottom: headings, paragraphs, names with values, tables. A new page
// begins where something does not fit; every page has a footer with its number.
//
//   SIXPOINT_ASSIGN(auto pdf, new_pdf_document("Title", when));
//   PageFlow flow(std::move(pdf), "Certificate 12", "Not accredited", 2);
//   flow.section("Results", 20);
//   flow.paragraph("All is well.");
//
// Lengths in mm, y downwards; text sizes in points. One thread at a time.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "station/certificate/pdf_document.h"

namespace sixpoint::station {

inline constexpr double kLeft_mm = 20;
inline constexpr double kRight_mm = 190;
inline constexpr double kWidth_mm = kRight_mm - kLeft_mm;
inline constexpr double kTop_mm = 18;
inline constexpr double kLine_mm = 4.6;
inline constexpr double kGrey = 0.4;
inline constexpr TextStyle kBody{PdfFont::regular, 8};
inline constexpr TextStyle kLabel{PdfFont::regular, 8, kGrey};
inline constexpr TextStyle kNote{PdfFont::regular, 6.7, kGrey};

struct Column {
  std::string head;
  double width_mm = 0;
  Align align = Align::right;
};
using Row = std::vector<std::string>;

struct Entry {
  std::string key;
  std::string value;
  TextStyle style = kBody;
};

class PageFlow {
 public:
  // `pages`: for "Page 1 of 2". Where it is not known, draw twice: first to count the pages.
  PageFlow(std::unique_ptr<PdfDocument> pdf, std::string footer, std::string second_footer,
           std::size_t pages);

  std::size_t pages() const { return pdf_->pages(); }
  Result<Bytes> bytes() { return pdf_->bytes(); }

  void text(double x_mm, std::string_view text, const TextStyle& style, Align align = Align::left);
  void rule(double y_mm, double thickness_mm, double grey);
  // The first line of the text.
  std::string cut(const std::string& long_text, double width_mm, const TextStyle& style);
  // Begins a page where less than this is left on it; true when it did.
  bool need(double height_mm);
  void section(std::string_view title, double least_mm);  // with at least this much below it
  void paragraph(std::string_view words, const TextStyle& style = kBody);
  // Two columns of names and values; a row is as high as the longer of its two values.
  void grid(const std::vector<std::array<Entry, 2>>& rows);
  void table(const std::vector<Column>& columns, const std::vector<Row>& rows);

 protected:
  std::unique_ptr<PdfDocument> pdf_;
  double y_mm_ = kTop_mm;  // the next baseline

 private:
  void add_page();
  void cells(const std::vector<Column>& columns, const Row& row, const TextStyle& style);
  void table_head(const std::vector<Column>& columns);

  std::string footer_;
  std::string second_footer_;
  std::size_t pages_;
};

}  // namespace sixpoint::station

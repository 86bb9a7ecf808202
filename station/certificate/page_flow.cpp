#include "station/certificate/page_flow.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace sixpoint::station {

namespace {

constexpr double kBottom_mm = 272;    // the footer stands below
constexpr double kRow_mm = 4.2;       // of a table
constexpr double kHeadLine_mm = 3.4;  // of a table's head
constexpr TextStyle kHead{PdfFont::bold, 6.7};
constexpr TextStyle kCell{PdfFont::regular, 7.5};

}  // namespace

PageFlow::PageFlow(std::unique_ptr<PdfDocument> pdf, std::string footer, std::string second_footer,
                   std::size_t pages)
    : pdf_(std::move(pdf)),
      footer_(std::move(footer)),
      second_footer_(std::move(second_footer)),
      pages_(pages) {
  add_page();
}

void PageFlow::text(double x_mm, std::string_view text, const TextStyle& style, Align align) {
  pdf_->text(x_mm, y_mm_, text, style, align);
}
void PageFlow::rule(double y_mm, double thickness_mm, double grey) {
  pdf_->line(kLeft_mm, y_mm, kRight_mm, y_mm, thickness_mm, grey);
}
std::string PageFlow::cut(const std::string& long_text, double width_mm, const TextStyle& style) {
  return pdf_->lines(long_text, width_mm, style).front();
}

void PageFlow::add_page() {
  pdf_->add_page();
  rule(279, 0.2, 0.6);
  y_mm_ = 283.5;
  text(kLeft_mm, cut(footer_, 140, kNote), kNote);
  text(kRight_mm, fmt::format("Page {} of {}", pdf_->pages(), pages_), kNote, Align::right);
  y_mm_ += 4;
  text(kLeft_mm, second_footer_, kNote);
  y_mm_ = kTop_mm;
}

bool PageFlow::need(double height_mm) {
  const bool full = y_mm_ + height_mm > kBottom_mm;
  if (full) {
    add_page();
  }
  return full;
}

void PageFlow::section(std::string_view title, double least_mm) {
  y_mm_ += 3.4;
  need(least_mm + 8);
  y_mm_ += 3.4;
  text(kLeft_mm, title, {PdfFont::bold, 9.5});
  rule(y_mm_ + 1.6, 0.25, 0.6);
  y_mm_ += 6;
}

void PageFlow::paragraph(std::string_view words, const TextStyle& style) {
  const double step_mm = style.size_pt * 0.49;
  for (const std::string& line : pdf_->lines(words, kWidth_mm, style)) {
    need(step_mm);
    text(kLeft_mm, line, style);
    y_mm_ += step_mm;
  }
}

void PageFlow::grid(const std::vector<std::array<Entry, 2>>& rows) {
  constexpr double kKey_mm = 33;
  constexpr double kGap_mm = 5;
  constexpr double kHalf_mm = (kWidth_mm - kGap_mm) / 2;
  for (const auto& row : rows) {
    std::array<Row, 2> values;
    for (std::size_t side = 0; side < 2; ++side) {
      values[side] = pdf_->lines(row[side].value, kHalf_mm - kKey_mm, row[side].style);
    }
    const std::size_t lines = std::max(values[0].size(), values[1].size());
    need(kLine_mm * static_cast<double>(lines));
    for (std::size_t side = 0; side < 2; ++side) {
      const double x_mm = kLeft_mm + static_cast<double>(side) * (kHalf_mm + kGap_mm);
      text(x_mm, row[side].key, kLabel);
      for (std::size_t i = 0; i < values[side].size(); ++i) {
        pdf_->text(x_mm + kKey_mm, y_mm_ + kLine_mm * static_cast<double>(i), values[side][i],
                   row[side].style);
      }
    }
    y_mm_ += kLine_mm * static_cast<double>(lines) + 0.3;
  }
}

void PageFlow::cells(const std::vector<Column>& columns, const Row& row, const TextStyle& style) {
  constexpr double kPad_mm = 0.75;
  double x_mm = kLeft_mm;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const bool left = columns[i].align == Align::left;
    text(left ? x_mm + kPad_mm : x_mm + columns[i].width_mm - kPad_mm, row[i], style,
         columns[i].align);
    x_mm += columns[i].width_mm;
  }
}

void PageFlow::table_head(const std::vector<Column>& columns) {
  std::vector<Row> heads;
  std::size_t lines = 1;
  for (const Column& column : columns) {
    heads.push_back(pdf_->lines(column.head, column.width_mm - 1.5, kHead));
    lines = std::max(lines, heads.back().size());
  }
  for (std::size_t line = 0; line < lines; ++line) {  // aligned at the bottom
    Row row;
    for (const Row& head : heads) {
      row.push_back(line + head.size() < lines ? "" : head[line + head.size() - lines]);
    }
    cells(columns, row, kHead);
    y_mm_ += kHeadLine_mm;
  }
  y_mm_ += 1.4 - kHeadLine_mm;
  rule(y_mm_, 0.25, 0.3);
  y_mm_ += 4;
}

void PageFlow::table(const std::vector<Column>& columns, const std::vector<Row>& rows) {
  table_head(columns);
  for (const Row& row : rows) {
    if (need(kRow_mm)) {
      table_head(columns);
    }
    cells(columns, row, kCell);
    rule(y_mm_ + 1.15, 0.1, 0.8);
    y_mm_ += kRow_mm;
  }
  y_mm_ += 0.6;
}

}  // namespace sixpoint::station

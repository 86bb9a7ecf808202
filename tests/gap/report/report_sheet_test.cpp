#include "gap/report/report_sheet.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gap/report/made_diagnosis.h"

namespace sixpoint::gap {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using tests::diagnosed_as;

TEST(ReportSheet, PictureAndPaper) {
  const std::string svg = report_sheet(diagnosed_as("<A&B>"));
  EXPECT_NE(svg.find("no gap"), std::string::npos);
  EXPECT_NE(svg.find("&lt;A&amp;B&gt;"), std::string::npos);
  const auto png = sheet_png(svg);
  ASSERT_OK(png);
  EXPECT_EQ(std::string(png->begin() + 1, png->begin() + 4), "PNG");
  const auto pdf = sheet_pdf(svg);
  ASSERT_OK(pdf);
  EXPECT_EQ(std::string(pdf->begin(), pdf->begin() + 5), "%PDF-");
  EXPECT_FAILS(sheet_png("no drawing"), ErrorCode::internal);
}

// A4 is 210 x 297 mm: 793.7 x 1122.5 dots of 1/96 inch.
TEST(ReportSheet, IsOneA4Page) {
  EXPECT_THAT(report_sheet({}),
              HasSubstr("width=\"794\" height=\"1123\" viewBox=\"0 0 794 1123\""));
}

// The words of the <text> elements that are written at this size.
std::vector<std::string> words_of(const std::string& svg, const std::string& size) {
  std::vector<std::string> words;
  const std::string mark = "font-size=\"" + size + "\"";
  for (std::size_t at = svg.find(mark); at != std::string::npos; at = svg.find(mark, at + 1)) {
    const std::size_t first = svg.find('>', at) + 1;
    words.push_back(svg.substr(first, svg.find('<', first) - first));
  }
  return words;
}

// The sentence of the technician is set in 14 dots: six lines of 84 letters have room.
TEST(ReportSheet, LongSentenceIsWrappedAndCutAfterSixLines) {
  Diagnosis d;
  d.inconclusive = true;
  d.losses = {std::string(40, 'a') + " " + std::string(60, 'b') + " cc"};
  const auto lines = words_of(report_sheet(d), "14");
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0], "nothing can be said: " + std::string(40, 'a'));
  EXPECT_EQ(lines[1], std::string(60, 'b') + " cc");
  std::string text;
  for (int i = 0; i < 200; ++i) {
    text += "word ";
  }
  d.losses = {text};
  const auto cut = words_of(report_sheet(d), "14");
  ASSERT_EQ(cut.size(), 6U);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_LE(cut[i].size(), 84U);
    EXPECT_GT(cut[i].size(), 84U - 5);
  }
  EXPECT_THAT(cut[5], EndsWith(" ..."));
}

// Cells are coloured from 246 246 246 to 181 68 46 by the sigma's share of 2.5 decades: 10 sigma
// have 0.4 of the way, by hand. A cell that is not among the worst shows the rms of its residuals.
TEST(ReportSheet, CellsOfResidualsHaveTheirColour) {
  Diagnosis d;
  const auto residual = [](int axis, const char* segment, double sigma) {
    Plots::Residual r{};
    r.axis = axis;
    r.segment = segment;
    r.before_sigma = sigma;
    return r;
  };
  d.plots.residuals = {residual(0, "faces", 3), residual(0, "faces", 4), residual(1, "faces", 1)};
  d.where = {{1, "faces", "pose", 2, 10}};
  const std::string svg = report_sheet(d);
  EXPECT_THAT(svg, HasSubstr("rgb(220,174,166)"));
  EXPECT_THAT(svg, HasSubstr("rgb(246,246,246)"));  // of Z: nothing measured
  const auto sigmas = words_of(svg, "9");
  ASSERT_EQ(sigmas.size(), 3U);
  EXPECT_EQ(sigmas[0], "3.5");  // sqrt((9 + 16) / 2)
  EXPECT_EQ(sigmas[1], "10");
  EXPECT_EQ(sigmas[2], "0");
}

}  // namespace
}  // namespace sixpoint::gap

#include "gap/report/report_sheet.h"

#include <gtest/gtest.h>

#include "gap/report/made_diagnosis.h"

namespace sixpoint::gap {
namespace {

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

}  // namespace
}  // namespace sixpoint::gap

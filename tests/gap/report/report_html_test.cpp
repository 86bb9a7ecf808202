#include "gap/report/report_html.h"

#include <gtest/gtest.h>

#include "gap/report/made_diagnosis.h"

namespace sixpoint::gap {
namespace {

using tests::diagnosed_as;

TEST(ReportHtml, OnePageWithTheSentenceAndNothingFromOutside) {
  const std::string page = report_html(diagnosed_as("<script>alert(1)</script>"));
  EXPECT_NE(page.find("no gap"), std::string::npos);
  EXPECT_NE(page.find("<svg"), std::string::npos);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos) << "the page must need nothing else";
}

}  // namespace
}  // namespace sixpoint::gap

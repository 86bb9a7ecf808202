#include <fstream>

#include <gmock/gmock.h>

#include "expect_result.h"
#include "station/certificate/pdf_document.h"
#include "station/certificate/poppler.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

constexpr UtcTime kPrinted{std::chrono::sys_days{std::chrono::year{2026} / 3 / 4}};

std::unique_ptr<PdfDocument> document(const std::string& title) {
  auto pdf = new_pdf_document(title, kPrinted);
  EXPECT_OK(pdf);
  return *std::move(pdf);
}

Bytes two_pages(const std::string& title) {
  const auto pdf = document(title);
  pdf->add_page();
  pdf->text(20, 30, "left", {});
  pdf->text(190, 30, "right", {PdfFont::bold, 12, 0.4}, Align::right);
  pdf->box(20, 40, 10, 5, 0);
  pdf->add_page();
  pdf->line(20, 40, 190, 40, 0.2, 0);
  EXPECT_EQ(pdf->pages(), 2U);
  const auto bytes = pdf->bytes();
  EXPECT_OK(bytes);
  return *bytes;
}

TEST(PdfDocument, TheSameCallsGiveTheSameBytes) {
  EXPECT_EQ(two_pages("a"), two_pages("a"));
  EXPECT_NE(two_pages("a"), two_pages("b"));
}

// Oracle: poppler. 20 mm and 190 mm are 56.7 and 538.6 points.
TEST(PdfDocument, PopplerReadsTheTextWhereItWasPlaced) {
  NEEDS_TOOLS();
  tests::TemporaryFolder folder;
  const Bytes bytes = two_pages("J\u00f6rg \u0141ukasz");
  std::ofstream(folder / "a.pdf", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  const std::string info = output_of("TZ=UTC pdfinfo -isodates " + (folder / "a.pdf"));
  EXPECT_THAT(info, HasSubstr("J\u00f6rg \u0141ukasz"));
  EXPECT_THAT(info, HasSubstr("2026-03-04T00:00:00Z"));
  EXPECT_THAT(info, testing::ContainsRegex("Pages: +2\n"));
  EXPECT_THAT(info, HasSubstr("(A4)"));
  const std::string boxes = output_of("pdftotext -bbox " + (folder / "a.pdf") + " -");
  double left = 0;
  double right = 0;
  ASSERT_EQ(std::sscanf(boxes.c_str() + boxes.find("<word"), "<word xMin=\"%lf\"", &left), 1);
  EXPECT_NEAR(left, 56.7, 0.5);
  const std::size_t last = boxes.rfind("xMax=");
  ASSERT_EQ(std::sscanf(boxes.c_str() + last, "xMax=\"%lf\"", &right), 1);
  EXPECT_NEAR(right, 538.6, 0.5);
}

TEST(PdfDocument, LinesHoldAllWordsAndCutAWordThatIsTooWide) {
  const auto pdf = document("a");
  pdf->add_page();
  EXPECT_EQ(pdf->lines("", 50, {}), std::vector<std::string>{""});
  EXPECT_EQ(pdf->lines("one line", 50, {}), std::vector<std::string>{"one line"});
  const auto cut = pdf->lines(std::string(100, 'W'), 20, {});
  EXPECT_GT(cut.size(), 3U);
  std::string joined;
  for (const std::string& line : cut) {
    joined += line;
  }
  EXPECT_EQ(joined, std::string(100, 'W'));
}

TEST(PdfDocument, ControlCharactersAndOtherBytesAreEscaped) {
  const auto pdf = document("a");
  pdf->add_page();
  EXPECT_EQ(pdf->lines("a\nb\xff"
                       "c",
                       100, {}),
            std::vector<std::string>{"a\\x0ab\\xffc"});
}

}  // namespace
}  // namespace sixpoint::station

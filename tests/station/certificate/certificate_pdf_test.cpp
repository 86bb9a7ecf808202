// The certificate as a PDF.
#include <filesystem>
#include <fstream>
#include <regex>

#include <gmock/gmock.h>

#include "expect_result.h"
#include "station/certificate/certificate.h"
#include "station/certificate/certificate_record.h"
#include "station/certificate/poppler.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

class CertificatePdf : public testing::Test {
 protected:
  std::string text_of(const Certificate& certificate) {
    const auto bytes = certificate_pdf(certificate);
    EXPECT_OK(bytes);
    std::ofstream(folder_ / "c.pdf", std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes->data()),
               static_cast<std::streamsize>(bytes->size()));
    return output_of("pdftotext -layout " + (folder_ / "c.pdf") + " -");
  }
  tests::TemporaryFolder folder_;
};

// Oracle: poppler reads back what cairo wrote.
TEST_F(CertificatePdf, SaysWhatACalibrationCertificateSays) {
  NEEDS_TOOLS();
  const db::RunRecord run = record_of(7, writing());
  const auto certificate = certificate_of(run);
  ASSERT_OK(certificate);
  const std::string text = text_of(*certificate);
  for (const std::string& said : {run.serial,
                                  run.id,
                                  std::string("Ada Lovelace"),
                                  std::string("Bench 3"),
                                  std::string("J-0042"),
                                  std::string("2027-03-31"),
                                  std::string("sixpoint 9.9.9"),
                                  std::string("Date of calibration"),
                                  std::string("Date of issue"),
                                  std::string("As found"),
                                  std::string("As left"),
                                  std::string("coverage factor k = 2"),
                                  std::string("Local gravity"),
                                  std::string("ILAC-G8"),
                                  std::string("This is not an accredited calibration"),
                                  std::string("Page 1 of 2"),
                                  std::string("Page 2 of 2"),
                                  std::string("PASS"),
                                  std::string("WRITTEN INTO THE UNIT"),
                                  default_limits().sha256}) {
    EXPECT_THAT(text, HasSubstr(said));
  }
  // The results as numbers, to the place that the uncertainty gives.
  std::smatch row;
  ASSERT_TRUE(std::regex_search(
      text, row,
      std::regex("\n *X +([0-9.]+) +\u00b1 ([0-9.]+) +((?:\u2013)?[0-9.]+) +\u00b1 ([0-9.]+)")))
      << text;
  EXPECT_NEAR(std::stod(row[1]), 1 / certificate->sensitivity_g_per_lsb[0], 0.006);
  // Two digits of the uncertainty; in counts, of 1 g / sensitivity.
  const double zero_expanded_lsb =
      certificate->zero_expanded_mg[0] / 1000 / certificate->sensitivity_g_per_lsb[0];
  EXPECT_NEAR(std::stod(row[4]), zero_expanded_lsb, 0.06 * zero_expanded_lsb);
  EXPECT_THAT(text, HasSubstr(" choice "));
}

// Oracle: zbar reads the QR code off the page as a scanner would.
TEST_F(CertificatePdf, TheQrCodeHoldsSerialAndRun) {
  NEEDS_TOOLS();
  const db::RunRecord run = record_of(7, writing());
  text_of(*certificate_of(run));
  output_of("pdftoppm -r 150 -f 1 -l 1 -png " + (folder_ / "c.pdf") + " " + (folder_ / "p"));
  std::string picture;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    picture = entry.path().extension() == ".png" ? entry.path().string() : picture;
  }
  EXPECT_EQ(output_of("zbarimg --quiet --raw " + picture + " 2>/dev/null"),
            "sixpoint:" + run.serial + ":" + run.id + "\n");
}

// Every word's box as poppler sees it: within the page's margins, and none upon another.
TEST_F(CertificatePdf, LongNamesNeitherLeaveThePageNorOverlap) {
  NEEDS_TOOLS();
  db::RunRecord run = record_of(7, writing());
  Certificate certificate = *certificate_of(run);
  certificate.serial = std::string(70, 'W') + "-" + std::string(129, '8');
  certificate.operator_name =
      "Dr. Adelheid Wolfeschlegelsteinhausenbergerdorff und " + std::string(140, 'M');
  certificate.station = std::string(200, 'm');
  certificate.software = std::string(100, 'x') + " " + std::string(90, 'y');
  certificate.jig = std::string(200, '@');
  for (int i = 0; i < 12; ++i) {
    certificate.reasons.push_back("A long reason " + std::string(300, 'r') + " which goes on");
  }
  text_of(certificate);
  const std::string boxes = output_of("pdftotext -bbox " + (folder_ / "c.pdf") + " -");
  struct Word {
    double left, top, right, bottom;
    std::string text;
  };
  std::vector<Word> words;
  std::size_t seen = 0;
  const std::regex line(
      "<word xMin=\"([^\"]*)\" yMin=\"([^\"]*)\" xMax=\"([^\"]*)\" "
      "yMax=\"([^\"]*)\">(.*)</word>|(<page )");
  for (std::sregex_iterator at(boxes.begin(), boxes.end(), line), end; at != end; ++at) {
    if ((*at)[6].matched) {
      words.clear();
      continue;
    }
    const Word word{std::stod((*at)[1]), std::stod((*at)[2]), std::stod((*at)[3]),
                    std::stod((*at)[4]), (*at)[5]};
    ++seen;
    EXPECT_GE(word.left, 20 * 72 / 25.4 - 1) << word.text;
    EXPECT_LE(word.right, 190 * 72 / 25.4 + 1) << word.text;
    EXPECT_LE(word.bottom, 292 * 72 / 25.4) << word.text;
    for (const Word& other : words) {
      // The boxes hold the font's whole height, which lines may share a third of.
      const double shared_x = std::min(word.right, other.right) - std::max(word.left, other.left);
      const double shared_y = std::min(word.bottom, other.bottom) - std::max(word.top, other.top);
      EXPECT_FALSE(shared_x > 0.5 && shared_y > 0.35 * (word.bottom - word.top))
          << word.text << " upon " << other.text;
    }
    words.push_back(word);
  }
  EXPECT_GT(seen, 300U);
}

// Oracle: poppler reads the operator's name back as it was typed.
TEST_F(CertificatePdf, PrintsNamesOfOtherLanguages) {
  NEEDS_TOOLS();
  Certificate certificate = *certificate_of(record_of(7, writing()));
  certificate.operator_name = "J\u00f6rg \u0141ukasz \u2013 \u20ac";
  certificate.station = "caf\xff";
  const std::string text = text_of(certificate);
  EXPECT_THAT(text, HasSubstr("J\u00f6rg \u0141ukasz \u2013 \u20ac"));
  EXPECT_THAT(text, HasSubstr("caf\\xff")) << "bytes that are no UTF-8";
}

}  // namespace
}  // namespace sixpoint::station

// A sheet as PNG and PDF. The oracle is the other end of each format: pixels decoded here with zlib
// by the PNG specification, the page's size in the PDF's own words.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "expect_result.h"
#include "gap/report/report_sheet.h"

namespace sixpoint::gap {
namespace {

using ::testing::HasSubstr;

using Colour = std::array<int, 3>;

struct Picture {
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<std::uint8_t> rgb;
  Colour at(std::size_t x, std::size_t y) const {
    const std::uint8_t* p = &rgb.at(3 * (y * width + x));
    return {p[0], p[1], p[2]};
  }
};

std::size_t number_at(const Bytes& bytes, std::size_t at) {
  std::size_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    number = 256 * number + static_cast<std::uint8_t>(bytes.at(at + i));
  }
  return number;
}

// The PNG specification's predictor of filter type 4.
int paeth(int left, int up, int corner) {
  const int guess = left + up - corner;
  const int a = std::abs(guess - left);
  const int b = std::abs(guess - up);
  const int c = std::abs(guess - corner);
  return a <= b && a <= c ? left : b <= c ? up : corner;
}

// Eight bits per colour, no alpha, not interlaced.
Picture decoded(const Bytes& png) {
  Picture picture;
  std::vector<std::uint8_t> packed;
  for (std::size_t at = 8; at + 12 <= png.size(); at += 12 + number_at(png, at)) {
    const std::string name(png.begin() + static_cast<std::ptrdiff_t>(at + 4),
                           png.begin() + static_cast<std::ptrdiff_t>(at + 8));
    if (name == "IHDR") {
      picture.width = number_at(png, at + 8);
      picture.height = number_at(png, at + 12);
      EXPECT_EQ(number_at(png, at + 16) >> 16U, 0x0802U) << "8 bits, red green blue";
    } else if (name == "IDAT") {
      for (std::size_t i = 0; i < number_at(png, at); ++i) {
        packed.push_back(static_cast<std::uint8_t>(png.at(at + 8 + i)));
      }
    }
  }
  const std::size_t stride = 3 * picture.width;
  std::vector<std::uint8_t> rows((stride + 1) * picture.height);
  uLongf size = rows.size();
  EXPECT_EQ(uncompress(rows.data(), &size, packed.data(), packed.size()), Z_OK);
  EXPECT_EQ(size, rows.size());
  picture.rgb.resize(stride * picture.height);
  for (std::size_t y = 0; y < picture.height; ++y) {
    const std::uint8_t filter = rows[y * (stride + 1)];
    for (std::size_t i = 0; i < stride; ++i) {
      const std::size_t to = y * stride + i;
      const int left = i >= 3 ? picture.rgb[to - 3] : 0;
      const int up = y > 0 ? picture.rgb[to - stride] : 0;
      const int corner = i >= 3 && y > 0 ? picture.rgb[to - stride - 3] : 0;
      const std::array<int, 5> predicted = {0, left, up, (left + up) / 2, paeth(left, up, corner)};
      picture.rgb[to] =
          static_cast<std::uint8_t>(rows[y * (stride + 1) + 1 + i] + predicted.at(filter));
    }
  }
  return picture;
}

constexpr const char* kSheet =
    "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"794\" height=\"1123\" "
    "viewBox=\"0 0 794 1123\"><rect width=\"794\" height=\"1123\" fill=\"#fff\"/>"
    "<rect x=\"100\" y=\"200\" width=\"50\" height=\"40\" fill=\"#b5442e\"/></svg>";

// Two pixels for a dot of 1/96 inch.
TEST(SheetDrawing, PictureHasTwoPixelsForADotAndTheColoursOfTheSheet) {
  const auto png = sheet_png(kSheet);
  ASSERT_OK(png);
  const Picture picture = decoded(*png);
  ASSERT_EQ(picture.width, 2U * 794);
  ASSERT_EQ(picture.height, 2U * 1123);
  const Colour red = {0xb5, 0x44, 0x2e};
  const Colour white = {255, 255, 255};
  EXPECT_EQ(picture.at(200, 400), red);
  EXPECT_EQ(picture.at(299, 479), red);
  EXPECT_EQ(picture.at(199, 400), white);
  EXPECT_EQ(picture.at(200, 399), white);
  EXPECT_EQ(picture.at(300, 479), white);
  EXPECT_EQ(picture.at(299, 480), white);
  EXPECT_EQ(picture.at(1587, 2245), white);
}

// A point is 1/72 inch: 794 x 72 / 96 = 595.5, 1123 x 72 / 96 = 842.25. The time of writing is in
// the file, so that only the page is looked at.
TEST(SheetDrawing, PaperIsOnePageOfA4InPoints) {
  const auto pdf = sheet_pdf(kSheet);
  ASSERT_OK(pdf);
  const std::string text(pdf->begin(), pdf->end());
  EXPECT_THAT(text, HasSubstr("/MediaBox [ 0 0 595.5 842.25 ]"));
  EXPECT_THAT(text, HasSubstr("/Count 1"));
}

TEST(SheetDrawing, WhatIsNoDrawingIsRefused) {
  for (const char* text : {"", "<svg", "<html></html>"}) {
    EXPECT_FAILS(sheet_png(text), ErrorCode::internal);
    EXPECT_FAILS(sheet_pdf(text), ErrorCode::internal);
  }
}

}  // namespace
}  // namespace sixpoint::gap

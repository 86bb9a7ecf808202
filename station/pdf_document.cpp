// The one place that sees libharu.
#include "station/pdf_document.h"

#include <array>
#include <vector>

#include <fmt/format.h>
#include <hpdf.h>

namespace sixpoint::station {

namespace {

// Code points of Windows-1252's bytes 0x80 to 0x9F; 0 where it has none.
constexpr std::array<char32_t, 32> kHighControls = {
    0x20AC, 0,      0x201A, 0x0192, 0x201E, 0x2026, 0x2020, 0x2021, 0x02C6, 0x2030, 0x0160,
    0x2039, 0x0152, 0,      0x017D, 0,      0,      0x2018, 0x2019, 0x201C, 0x201D, 0x2022,
    0x2013, 0x2014, 0x02DC, 0x2122, 0x0161, 0x203A, 0x0153, 0,      0x017E, 0x0178};

void append_code_point(std::string& out, char32_t code) {
  if ((code >= 0x20 && code < 0x7F) || (code >= 0xA0 && code <= 0xFF)) {
    out += static_cast<char>(code);
    return;
  }
  for (std::size_t i = 0; i < kHighControls.size(); ++i) {
    if (code != 0 && kHighControls[i] == code) {
      out += static_cast<char>(0x80 + i);
      return;
    }
  }
  out += fmt::format("\\u{{{:04x}}}", static_cast<std::uint32_t>(code));
}

std::string to_windows_1252(std::string_view utf8) {
  std::string out;
  for (std::size_t i = 0; i < utf8.size();) {
    const auto lead = static_cast<unsigned char>(utf8[i]);
    const std::size_t length = lead < 0x80   ? 1
                               : lead < 0xC0 ? 0
                               : lead < 0xE0 ? 2
                               : lead < 0xF0 ? 3
                               : lead < 0xF8 ? 4
                                             : 0;
    char32_t code = length <= 1 ? lead : lead & (0x7FU >> length);
    bool whole = length > 0 && i + length <= utf8.size();
    for (std::size_t k = 1; whole && k < length; ++k) {
      const auto byte = static_cast<unsigned char>(utf8[i + k]);
      whole = (byte & 0xC0U) == 0x80;
      code = (code << 6U) | (byte & 0x3FU);
    }
    if (!whole) {
      out += fmt::format("\\x{:02x}", lead);
      ++i;
      continue;
    }
    append_code_point(out, code);
    i += length;
  }
  return out;
}

// libharu's errors stay in the document and are asked for at the end.
void ignore_error(HPDF_STATUS /*error*/, HPDF_STATUS /*detail*/, void* /*data*/) {}

HPDF_REAL points(double millimetres) { return static_cast<HPDF_REAL>(millimetres * 72 / 25.4); }

}  // namespace

struct PdfDocument::Impl {
  HPDF_Doc document = nullptr;
  std::array<HPDF_Font, 3> fonts{};
  std::vector<HPDF_Page> pages;
  HPDF_Page page = nullptr;

  HPDF_Font font(PdfFont wanted) const { return fonts[static_cast<std::size_t>(wanted)]; }
  void grey_fill(double grey) const { HPDF_Page_SetGrayFill(page, static_cast<HPDF_REAL>(grey)); }
  static HPDF_REAL from_top(double y_mm) { return points(kHeight_mm - y_mm); }
};

PdfDocument::PdfDocument(const std::string& title, UtcTime made) : impl_(new Impl) {
  impl_->document = HPDF_New(ignore_error, nullptr);
  if (impl_->document == nullptr) {
    return;
  }
  HPDF_SetCompressionMode(impl_->document, HPDF_COMP_TEXT);
  constexpr std::array<const char*, 3> kNames = {"Helvetica", "Helvetica-Bold", "Courier"};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    impl_->fonts[i] = HPDF_GetFont(impl_->document, kNames[i], "WinAnsiEncoding");
  }
  HPDF_SetInfoAttr(impl_->document, HPDF_INFO_TITLE, to_windows_1252(title).c_str());
  HPDF_SetInfoAttr(impl_->document, HPDF_INFO_CREATOR, "sixpoint");
  const auto day = std::chrono::floor<std::chrono::days>(made);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss time(std::chrono::floor<std::chrono::seconds>(made - day));
  HPDF_Date stamp{};
  stamp.year = static_cast<int>(date.year());
  stamp.month = static_cast<int>(static_cast<unsigned>(date.month()));
  stamp.day = static_cast<int>(static_cast<unsigned>(date.day()));
  stamp.hour = static_cast<int>(time.hours().count());
  stamp.minutes = static_cast<int>(time.minutes().count());
  stamp.seconds = static_cast<int>(time.seconds().count());
  stamp.ind = 'Z';
  HPDF_SetInfoDateAttr(impl_->document, HPDF_INFO_CREATION_DATE, stamp);
}

PdfDocument::~PdfDocument() {
  if (impl_->document != nullptr) {
    HPDF_Free(impl_->document);
  }
}

void PdfDocument::add_page() {
  if (impl_->document == nullptr) {
    return;
  }
  impl_->page = HPDF_AddPage(impl_->document);
  HPDF_Page_SetWidth(impl_->page, points(kWidth_mm));
  HPDF_Page_SetHeight(impl_->page, points(kHeight_mm));
  impl_->pages.push_back(impl_->page);
}

void PdfDocument::go_to(std::size_t page) { impl_->page = impl_->pages.at(page); }

std::size_t PdfDocument::pages() const { return impl_->pages.size(); }

double PdfDocument::width_mm(std::string_view text, PdfFont font, double size_pt) const {
  if (impl_->document == nullptr) {
    return 0;
  }
  const std::string encoded = to_windows_1252(text);
  const HPDF_TextWidth width =
      HPDF_Font_TextWidth(impl_->font(font), reinterpret_cast<const HPDF_BYTE*>(encoded.data()),
                          static_cast<HPDF_UINT>(encoded.size()));
  return static_cast<double>(width.width) / 1000 * size_pt * 25.4 / 72;
}

void PdfDocument::text(double x_mm, double y_mm, std::string_view text, PdfFont font,
                       double size_pt, double grey) {
  if (impl_->page == nullptr || text.empty()) {
    return;
  }
  HPDF_Page_BeginText(impl_->page);
  impl_->grey_fill(grey);
  HPDF_Page_SetFontAndSize(impl_->page, impl_->font(font), static_cast<HPDF_REAL>(size_pt));
  HPDF_Page_TextOut(impl_->page, points(x_mm), Impl::from_top(y_mm), to_windows_1252(text).c_str());
  HPDF_Page_EndText(impl_->page);
}

void PdfDocument::line(double x1_mm, double y1_mm, double x2_mm, double y2_mm, double width_mm,
                       double grey) {
  if (impl_->page == nullptr) {
    return;
  }
  HPDF_Page_SetGrayStroke(impl_->page, static_cast<HPDF_REAL>(grey));
  HPDF_Page_SetLineWidth(impl_->page, points(width_mm));
  HPDF_Page_MoveTo(impl_->page, points(x1_mm), Impl::from_top(y1_mm));
  HPDF_Page_LineTo(impl_->page, points(x2_mm), Impl::from_top(y2_mm));
  HPDF_Page_Stroke(impl_->page);
}

void PdfDocument::box(double x_mm, double y_mm, double width_mm, double height_mm, double grey) {
  if (impl_->page == nullptr) {
    return;
  }
  impl_->grey_fill(grey);
  HPDF_Page_Rectangle(impl_->page, points(x_mm), Impl::from_top(y_mm + height_mm), points(width_mm),
                      points(height_mm));
  HPDF_Page_Fill(impl_->page);
}

Result<Bytes> PdfDocument::bytes() {
  if (impl_->document == nullptr || HPDF_SaveToStream(impl_->document) != HPDF_OK ||
      HPDF_GetError(impl_->document) != HPDF_OK) {
    return fail(ErrorCode::internal, "the PDF could not be made", "certificate",
                "please report this");
  }
  Bytes bytes(HPDF_GetStreamSize(impl_->document));
  auto size = static_cast<HPDF_UINT32>(bytes.size());
  if (HPDF_ReadFromStream(impl_->document, bytes.data(), &size) != HPDF_OK ||
      size != bytes.size()) {
    return fail(ErrorCode::internal, "the PDF could not be made", "certificate",
                "please report this");
  }
  return bytes;
}

}  // namespace sixpoint::station

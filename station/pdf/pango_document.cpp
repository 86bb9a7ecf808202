#include <cairo-pdf.h>
#include <fmt/format.h>
#include <pango/pangocairo.h>

#include "station/certificate/pdf_document.h"

namespace sixpoint::station {
namespace {

constexpr double kPoints_per_mm = 72 / 25.4;

struct Free {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
  void operator()(PangoLayout* layout) const { g_object_unref(layout); }
  void operator()(PangoFontDescription* font) const { pango_font_description_free(font); }
};

cairo_status_t append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<Bytes*>(bytes)->insert(static_cast<Bytes*>(bytes)->end(), data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

// Pango and cairo take valid UTF-8 only.
std::string as_utf8(std::string_view text) {
  std::string out;
  const char* bad = nullptr;
  while (g_utf8_validate(text.data(), static_cast<gssize>(text.size()), &bad) == 0) {
    const auto good = static_cast<std::size_t>(bad - text.data());
    out += text.substr(0, good);
    out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[good]));
    text.remove_prefix(good + 1);
  }
  out += text;
  return printable(out, out.size());
}

class PangoDocument final : public PdfDocument {
 public:
  PangoDocument(const std::string& title, UtcTime made)
      : surface_(cairo_pdf_surface_create_for_stream(append, &bytes_, kWidth_mm * kPoints_per_mm,
                                                     kHeight_mm * kPoints_per_mm)),
        cairo_(cairo_create(surface_.get())) {
    cairo_surface_t* const surface = surface_.get();
    cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_TITLE, as_utf8(title).c_str());
    cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_CREATOR, "sixpoint");
    const std::string date = to_iso8601(std::chrono::floor<std::chrono::seconds>(made));
    cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_CREATE_DATE, date.c_str());
    cairo_scale(cairo_.get(), kPoints_per_mm, kPoints_per_mm);
    layout_.reset(pango_cairo_create_layout(cairo_.get()));
    pango_context_set_round_glyph_positions(pango_layout_get_context(layout_.get()), FALSE);
    pango_layout_set_wrap(layout_.get(), PANGO_WRAP_WORD_CHAR);
  }

  void add_page() override {
    if (pages_++ > 0) {
      cairo_show_page(cairo_.get());
    }
  }

  std::size_t pages() const override { return pages_; }

  std::vector<std::string> lines(std::string_view text, double width_mm,
                                 const TextStyle& style) override {
    PangoLayout* const layout = set(text, width_mm, style);
    std::vector<std::string> lines;
    for (int i = 0; i < pango_layout_get_line_count(layout); ++i) {
      const PangoLayoutLine* line = pango_layout_get_line_readonly(layout, i);
      std::string& text_of_line =
          lines.emplace_back(pango_layout_get_text(layout) + line->start_index,
                             static_cast<std::size_t>(line->length));
      text_of_line.erase(text_of_line.find_last_not_of(' ') + 1);
    }
    return lines;
  }

  void text(double x_mm, double y_mm, std::string_view text, const TextStyle& style,
            Align align) override {
    PangoLayoutLine* const line = pango_layout_get_line_readonly(set(text, -1, style), 0);
    PangoRectangle extent;
    pango_layout_line_get_extents(line, nullptr, &extent);
    set_grey(style.grey);
    cairo_move_to(cairo_.get(),
                  align == Align::left ? x_mm : x_mm - pango_units_to_double(extent.width), y_mm);
    pango_cairo_show_layout_line(cairo_.get(), line);
  }

  void line(double x1_mm, double y1_mm, double x2_mm, double y2_mm, double width_mm,
            double grey) override {
    set_grey(grey);
    cairo_set_line_width(cairo_.get(), width_mm);
    cairo_move_to(cairo_.get(), x1_mm, y1_mm);
    cairo_line_to(cairo_.get(), x2_mm, y2_mm);
    cairo_stroke(cairo_.get());
  }

  void box(double x_mm, double y_mm, double width_mm, double height_mm, double grey) override {
    set_grey(grey);
    cairo_rectangle(cairo_.get(), x_mm, y_mm, width_mm, height_mm);
    cairo_fill(cairo_.get());
  }

  Result<Bytes> bytes() override {
    const cairo_status_t drawn = cairo_status(cairo_.get());
    cairo_surface_finish(surface_.get());
    if (drawn != CAIRO_STATUS_SUCCESS ||
        cairo_surface_status(surface_.get()) != CAIRO_STATUS_SUCCESS) {
      return fail(ErrorCode::internal, "cairo could not write the PDF", "certificate",
                  "please report this");
    }
    return std::move(bytes_);
  }

 private:
  // The layout, set to this text on lines of at most `width_mm`; negative: on one line.
  PangoLayout* set(std::string_view text, double width_mm, const TextStyle& style) {
    const std::unique_ptr<PangoFontDescription, Free> font(pango_font_description_new());
    pango_font_description_set_family(
        font.get(), style.font == PdfFont::mono ? "DejaVu Sans Mono" : "DejaVu Sans");
    pango_font_description_set_weight(
        font.get(), style.font == PdfFont::bold ? PANGO_WEIGHT_BOLD : PANGO_WEIGHT_NORMAL);
    pango_font_description_set_absolute_size(font.get(),
                                             style.size_pt / kPoints_per_mm * PANGO_SCALE);
    pango_layout_set_font_description(layout_.get(), font.get());
    pango_layout_set_width(layout_.get(),
                           width_mm < 0 ? -1 : static_cast<int>(width_mm * PANGO_SCALE));
    const std::string utf8 = as_utf8(text);
    pango_layout_set_text(layout_.get(), utf8.data(), static_cast<int>(utf8.size()));
    return layout_.get();
  }
  void set_grey(double grey) { cairo_set_source_rgb(cairo_.get(), grey, grey, grey); }

  Bytes bytes_;
  std::unique_ptr<cairo_surface_t, Free> surface_;
  std::unique_ptr<cairo_t, Free> cairo_;
  std::unique_ptr<PangoLayout, Free> layout_;
  std::size_t pages_ = 0;
};

std::unique_ptr<PdfDocument> begin(const std::string& title, UtcTime made) {
  return std::make_unique<PangoDocument>(title, made);
}

}  // namespace
}  // namespace sixpoint::station

extern "C" const sixpoint::station::PdfPart sixpoint_part_pdf = {&sixpoint::station::begin};

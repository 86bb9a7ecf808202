#include <functional>
#include <memory>

#include <cairo-pdf.h>
#include <cairo.h>
#include <librsvg/rsvg.h>

#include "gap/report/report_sheet.h"

namespace sixpoint::gap {
namespace {

constexpr double kSheetWidth = 794;  // A4 at 96 dots per inch
constexpr double kHeight = 1123;
constexpr double kPointsPerDot = 0.75;
constexpr int kPngScale = 2;

struct Free {
  void operator()(RsvgHandle* handle) const { g_object_unref(handle); }
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
};
using Surface = std::unique_ptr<cairo_surface_t, Free>;

cairo_status_t append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<Bytes*>(bytes)->insert(static_cast<Bytes*>(bytes)->end(), data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

// Draws `svg` over the whole surface, whose size is the sheet's times `scale`.
Status draw(const std::string& svg, cairo_surface_t* surface, double scale) {
  const auto refused = [](const char* what) {
    return fail(ErrorCode::internal, what, "report sheet", "use --html, which needs no drawing");
  };
  GError* error = nullptr;
  const std::unique_ptr<RsvgHandle, Free> handle(
      rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(svg.data()), svg.size(), &error));
  if (!handle) {
    g_clear_error(&error);
    return refused("librsvg does not take the drawing");
  }
  const std::unique_ptr<cairo_t, Free> cairo(cairo_create(surface));
  cairo_scale(cairo.get(), scale, scale);
  const RsvgRectangle page = {0, 0, kSheetWidth, kHeight};
  const bool drawn = rsvg_handle_render_document(handle.get(), cairo.get(), &page, &error) != 0;
  g_clear_error(&error);
  if (!drawn || cairo_status(cairo.get()) != CAIRO_STATUS_SUCCESS) {
    return refused("cairo could not draw");
  }
  return {};
}

Result<Bytes> png(const std::string& svg) {
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                                   static_cast<int>(kSheetWidth) * kPngScale,
                                                   static_cast<int>(kHeight) * kPngScale));
  SIXPOINT_CHECK(draw(svg, surface.get(), kPngScale));
  Bytes bytes;
  if (cairo_surface_write_to_png_stream(surface.get(), append, &bytes) != CAIRO_STATUS_SUCCESS) {
    return fail(ErrorCode::internal, "cairo could not write PNG", "report sheet");
  }
  return bytes;
}

Result<Bytes> pdf(const std::string& svg) {
  Bytes bytes;
  const Surface surface(cairo_pdf_surface_create_for_stream(
      append, &bytes, kSheetWidth * kPointsPerDot, kHeight * kPointsPerDot));
  SIXPOINT_CHECK(draw(svg, surface.get(), kPointsPerDot));
  cairo_surface_finish(surface.get());
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS) {
    return fail(ErrorCode::internal, "cairo could not write PDF", "report sheet");
  }
  return bytes;
}

}  // namespace
}  // namespace sixpoint::gap

extern "C" const sixpoint::gap::DrawingPart sixpoint_part_drawing = {&sixpoint::gap::png,
                                                                     &sixpoint::gap::pdf};

#include "base/text/svg.h"

#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "base/text/html.h"

namespace sixpoint {

void Svg::line(double x1, double y1, double x2, double y2, std::string_view attributes) {
  out_ += fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>", x1, y1,
                      x2, y2, attributes);
}

void Svg::rect(double x, double y, double width, double height, std::string_view attributes) {
  out_ += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" {}/>", x,
                      y, width, height, attributes);
}

void Svg::circle(double x, double y, double radius, std::string_view attributes) {
  out_ +=
      fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" {}/>", x, y, radius, attributes);
}

void Svg::path(const char* name, const std::vector<std::pair<double, double>>& points,
               std::string_view attributes) {
  out_ += fmt::format("<{} {} points=\"", name, attributes);
  for (const auto& [x, y] : points) {
    fmt::format_to(std::back_inserter(out_), "{:.1f},{:.1f} ", x, y);
  }
  out_ += "\"/>";
}

void Svg::polyline(const std::vector<std::pair<double, double>>& points,
                   std::string_view attributes) {
  path("polyline", points, attributes);
}

void Svg::polygon(const std::vector<std::pair<double, double>>& points,
                  std::string_view attributes) {
  path("polygon", points, attributes);
}

void Svg::text(double x, double y, std::string_view words, std::string_view attributes) {
  out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>", x, y, attributes,
                      html_escaped(words));
}

void Svg::text_upward(double x, double y, std::string_view words) {
  text(x, y, words,
       fmt::format("transform=\"rotate(-90 {0:.1f} {1:.1f})\" text-anchor=\"middle\"", x, y));
}

std::vector<double> round_ticks(double low, double high) {
  const double rough = (high - low) / 5;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  const double step = power * (rough / power < 1.5   ? 1
                               : rough / power < 3.5 ? 2
                               : rough / power < 7.5 ? 5
                                                     : 10);
  std::vector<double> at;
  for (double x = std::ceil(low / step) * step; x <= high && at.size() < 12; x += step) {
    at.push_back(std::abs(x) < 1e-9 * step ? 0 : x);
  }
  return at;
}

std::vector<double> log_ticks(double low, double high) {
  std::vector<double> at;
  for (int decade = static_cast<int>(std::floor(low)); decade <= high; ++decade) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double x = decade + std::log10(digit);
      if (x >= low && x <= high && (digit == 1 || high - low < 2.5)) {
        at.push_back(x);
      }
    }
  }
  return at;
}

}  // namespace sixpoint

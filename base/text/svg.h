// Charts as SVG, for all reports: marks, a scale that maps values to places, round ticks.
//
//   const SvgScale x{0, 10, 40, 440};   // 0 to 10 s from left to right
//   const SvgScale y{-1, 1, 200, 20};   // up is positive
//   Svg svg;
//   svg.polyline({{x(0), y(0)}, {x(10), y(1)}}, "fill=\"none\" stroke=\"#333\"");
//   svg.text(x(5), 230, "seconds", "text-anchor=\"middle\"");
//   page += "<svg viewBox=\"0 0 460 240\">" + svg.marks() + "</svg>";
//
// Places are in the units of the viewBox, y downward. `attributes` are written as they are; words
// are escaped.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sixpoint {

// The straight line that maps `low` to `from` and `high` to `to`; low and high must differ.
struct SvgScale {
  double low = 0;
  double high = 1;
  double from = 0;
  double to = 1;
  double operator()(double value) const {
    return from + (value - low) / (high - low) * (to - from);
  }
};

class Svg {
 public:
  void line(double x1, double y1, double x2, double y2, std::string_view attributes);
  void rect(double x, double y, double width, double height, std::string_view attributes);
  void circle(double x, double y, double radius, std::string_view attributes);
  void polyline(const std::vector<std::pair<double, double>>& points, std::string_view attributes);
  void polygon(const std::vector<std::pair<double, double>>& points, std::string_view attributes);
  void text(double x, double y, std::string_view words, std::string_view attributes = {});
  // Written upward, its middle at (x, y): the name of a vertical axis.
  void text_upward(double x, double y, std::string_view words);
  void add(std::string_view element) { out_ += element; }  // as it is

  const std::string& marks() const { return out_; }

 private:
  void path(const char* name, const std::vector<std::pair<double, double>>& points,
            std::string_view attributes);
  std::string out_;
};

// Round numbers from `low` to `high`, four to eight of them.
std::vector<double> round_ticks(double low, double high);
// The same for a logarithmic axis, decimal logarithms in and out: 1, 2 and 5 in each decade, or
// whole decades where there are many.
std::vector<double> log_ticks(double low, double high);

}  // namespace sixpoint

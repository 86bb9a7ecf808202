// Drawings of a diagnosis: axes, ticks and marks as SVG, the same for the page and the sheet.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "gap/diagnosis.h"

namespace sixpoint::gap {

std::string escaped(std::string_view text);  // for XML and HTML

class Chart {
 public:
  static constexpr double kWidth = 460;
  static constexpr double kHeight = 240;

  Chart(std::string title, std::string x_label, std::string y_label);

  void points(const std::vector<double>& x, const std::vector<double>& y, const char* colour,
              std::string name);
  void line(const std::vector<double>& x, const std::vector<double>& y, const char* colour,
            std::string name);
  void log_x() { log_x_ = true; }
  void log_y() { log_y_ = true; }

  const std::string& title() const { return title_; }
  bool empty() const;
  // The drawing without its title, kWidth x kHeight; a sentence where there is nothing to draw.
  std::string drawing() const;
  std::string figure() const;  // an HTML figure

 private:
  struct Series {
    std::vector<double> x, y;
    const char* colour;
    bool line;
    std::string name;
  };
  double scaled_x(double x) const;
  double scaled_y(double y) const;
  void add(Series series);

  std::string title_, x_label_, y_label_;
  std::vector<Series> series_;
  bool log_x_ = false;
  bool log_y_ = false;
  double low_x_ = std::numeric_limits<double>::max();
  double high_x_ = std::numeric_limits<double>::lowest();
  double low_y_ = std::numeric_limits<double>::max();
  double high_y_ = std::numeric_limits<double>::lowest();
};

// Noise spectrum, Allan deviation, tone response, zero over temperature, what is left over time,
// the response to a step.
std::vector<Chart> charts_of(const Diagnosis& diagnosis);

}  // namespace sixpoint::gap

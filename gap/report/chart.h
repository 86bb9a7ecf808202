// Drawings of a diagnosis, the same for the page and the sheet.
//
//   gap::Chart chart("After a move", "s", "share of the step");
//   chart.line({0, 0.1, 0.2}, {0.03, -0.02, 0.01}, "#2f5fa8", "measured");
//   page += chart.figure();
#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gap/judge/diagnosis.h"

namespace sixpoint::gap {

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

// How strongly a residual of so many sigma is coloured, 0 to 1.
double sigma_shade(double sigma);

// The gap in mg from "before" over each accepted effect. Squares add: each effect takes its share
// of what was closed by its evidence.
std::vector<std::pair<std::string, double>> gap_bars(const Diagnosis& diagnosis);

}  // namespace sixpoint::gap

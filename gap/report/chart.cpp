#include "gap/report/chart.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "base/text/svg.h"

namespace sixpoint::gap {
namespace {

constexpr double kLeft = 64;
constexpr double kPlotRight = Chart::kWidth - 8;
constexpr double kBottom = Chart::kHeight - 34;
constexpr double kTop = 16;
constexpr std::array<const char*, 3> kColours = {"#b5442e", "#2e7d4f", "#2f5fa8"};
constexpr std::array<const char*, 3> kXyz = {"X", "Y", "Z"};
constexpr const char* kGrey = "#888";

// Values from `low` to `high`, with some room on either side.
SvgScale scale_of(double low, double high, double from, double to) {
  const double room = high > low ? 0.06 * (high - low) : std::max(1e-6, 0.1 * std::abs(high));
  return {low - room, high + room, from, to};
}

}  // namespace

Chart::Chart(std::string title, std::string x_label, std::string y_label)
    : title_(std::move(title)), x_label_(std::move(x_label)), y_label_(std::move(y_label)) {}

void Chart::points(const std::vector<double>& x, const std::vector<double>& y, const char* colour,
                   std::string name) {
  add({x, y, colour, false, std::move(name)});
}

void Chart::line(const std::vector<double>& x, const std::vector<double>& y, const char* colour,
                 std::string name) {
  add({x, y, colour, true, std::move(name)});
}

bool Chart::empty() const {
  return series_.empty() || !(high_x_ >= low_x_) || !(high_y_ >= low_y_);
}

double Chart::scaled_x(double x) const { return log_x_ ? std::log10(std::max(1e-9, x)) : x; }
double Chart::scaled_y(double y) const { return log_y_ ? std::log10(std::max(1e-9, y)) : y; }

void Chart::add(Series series) {
  if (series.x.empty()) {
    return;
  }
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    if (std::isfinite(series.y[i])) {
      low_x_ = std::min(low_x_, series.x[i]);
      high_x_ = std::max(high_x_, series.x[i]);
      low_y_ = std::min(low_y_, series.y[i]);
      high_y_ = std::max(high_y_, series.y[i]);
    }
  }
  series_.push_back(std::move(series));
}

std::string Chart::figure() const {
  return fmt::format(
      "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 {} {}\" role=\"img\" "
      "aria-label=\"{}\">{}</svg></figure>",
      title_, kWidth, kHeight, title_, drawing());
}

std::string Chart::drawing() const {
  Svg svg;
  if (empty()) {
    svg.text(kLeft, kHeight / 2, "this protocol does not show it", "fill=\"#777\"");
    return svg.marks();
  }
  const SvgScale x_scale = scale_of(scaled_x(low_x_), scaled_x(high_x_), kLeft, kPlotRight);
  const SvgScale y_scale = scale_of(scaled_y(low_y_), scaled_y(high_y_), kBottom, kTop);
  for (const double y :
       log_y_ ? log_ticks(y_scale.low, y_scale.high) : round_ticks(y_scale.low, y_scale.high)) {
    svg.line(kLeft, y_scale(y), kPlotRight, y_scale(y), "stroke=\"#ddd\"");
    svg.text(kLeft - 4, y_scale(y) + 4, fmt::format("{:.6g}", log_y_ ? std::pow(10, y) : y),
             "text-anchor=\"end\"");
  }
  for (const double x :
       log_x_ ? log_ticks(x_scale.low, x_scale.high) : round_ticks(x_scale.low, x_scale.high)) {
    svg.text(x_scale(x), kBottom + 14, fmt::format("{:.6g}", log_x_ ? std::pow(10, x) : x),
             "text-anchor=\"middle\"");
  }
  svg.text((kWidth + kLeft) / 2, kHeight - 4, x_label_, "text-anchor=\"middle\"");
  svg.text_upward(12, kHeight / 2, y_label_);
  double legend = kLeft + 6;
  for (const Series& s : series_) {
    std::vector<std::pair<double, double>> places;
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (std::isfinite(s.y[i])) {
        places.emplace_back(x_scale(scaled_x(s.x[i])), y_scale(scaled_y(s.y[i])));
      }
    }
    if (s.line) {
      svg.polyline(places,
                   fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"", s.colour));
    }
    for (const auto& [x, y] : places) {
      if (!s.line) {
        svg.circle(x, y, 2, fmt::format("fill=\"{}\"", s.colour));
      }
    }
    if (!s.name.empty()) {
      svg.text(legend, kTop - 4, s.name, fmt::format("fill=\"{}\"", s.colour));
      legend += 8.0 + 6.5 * static_cast<double>(s.name.size());
    }
  }
  return svg.marks();
}

namespace {

std::vector<double> roots(const std::vector<double>& squares) {
  std::vector<double> values;
  values.reserve(squares.size());
  for (const double v : squares) {
    values.push_back(std::sqrt(v));
  }
  return values;
}

Chart noise_chart(const Plots& p) {
  Chart chart("Noise spectrum", "Hz", "mg per sample, white equivalent");
  for (std::size_t a = 0; a < 3; ++a) {
    chart.line(p.frequency_hz, roots(p.noise_mg2[a]), kColours[a], kXyz[a]);
    chart.line(p.frequency_hz, roots(p.noise_model_mg2[a]), kGrey, a == 0 ? "model" : "");
  }
  return chart;
}

Chart allan_chart(const Plots& p) {
  Chart chart("Allan deviation of the longest still record", "s", "mg");
  chart.log_x();
  chart.log_y();
  for (std::size_t a = 0; a < 3; ++a) {
    chart.points(p.allan_s, p.allan_mg[a], kColours[a], kXyz[a]);
    chart.line(p.allan_s, p.allan_nominal_mg[a], "#ccc", a == 0 ? "nominal" : "");
    chart.line(p.allan_s, p.allan_model_mg[a], kGrey, a == 0 ? "with the effects" : "");
  }
  return chart;
}

Chart tone_chart(const Plots& p) {
  Chart chart("Tone response", "Hz", "amplitude over nominal");
  chart.log_x();
  for (std::size_t a = 0; a < 3; ++a) {
    std::vector<double> frequency_hz, ratio, model;
    for (const Plots::Tone& t : p.tones) {
      if (t.axis == static_cast<int>(a)) {
        frequency_hz.push_back(t.frequency_hz);
        ratio.push_back(t.ratio);
        model.push_back(t.model);
      }
    }
    chart.points(frequency_hz, ratio, kColours[a], kXyz[a]);
    chart.points(frequency_hz, model, kGrey, a == 0 ? "model" : "");
  }
  return chart;
}

// One number of each residual over another.
Chart residual_chart(const Plots& p, Chart chart, double Plots::Residual::*x,
                     double Plots::Residual::*y) {
  for (std::size_t a = 0; a < 3; ++a) {
    std::vector<double> xs, ys;
    for (const Plots::Residual& r : p.residuals) {
      if (r.axis == static_cast<int>(a)) {
        xs.push_back(r.*x);
        ys.push_back(r.*y);
      }
    }
    chart.points(xs, ys, kColours[a], kXyz[a]);
  }
  return chart;
}

Chart step_chart(const Plots& p) {
  Chart chart("After a move", "s", "share of the step");
  chart.line(p.step_s, p.step_share, kColours[2], "measured");
  chart.line(p.step_s, p.step_model, kGrey, "model");
  return chart;
}

}  // namespace

std::vector<Chart> charts_of(const Diagnosis& diagnosis) {
  const Plots& p = diagnosis.plots;
  using Residual = Plots::Residual;
  return {
      noise_chart(p),
      allan_chart(p),
      tone_chart(p),
      residual_chart(p, {"Zero over temperature, means left by the nominal simulator", "C", "mg"},
                     &Residual::temperature_c, &Residual::before_mg),
      residual_chart(p, {"Means left with the accepted effects on", "minutes", "mg"},
                     &Residual::minutes, &Residual::after_mg),
      step_chart(p)};
}

double sigma_shade(double sigma) {
  constexpr double kFull_decades = 2.5;  // convention: full colour at 300 sigma
  return std::clamp(std::log10(std::max(1.0, sigma)) / kFull_decades, 0.0, 1.0);
}

std::vector<std::pair<std::string, double>> gap_bars(const Diagnosis& d) {
  std::vector<std::pair<std::string, double>> bars = {{"before", d.gap.before_mg}};
  double total = 0;
  for (const EffectFinding& e : d.effects) {
    total += e.nats;
  }
  double square = d.gap.before_mg * d.gap.before_mg;
  const double closed = square - d.gap.after_mg * d.gap.after_mg;
  for (const EffectFinding& e : d.effects) {
    square -= total > 0 ? closed * e.nats / total : 0;
    bars.emplace_back("with " + e.name, std::sqrt(std::max(0.0, square)));
  }
  return bars;
}

}  // namespace sixpoint::gap

#include "gap/chart.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

namespace sixpoint::gap {
namespace {

constexpr double kLeft = 64;
constexpr double kBottom = 34;
constexpr double kTop = 16;
constexpr std::array<const char*, 3> kColours = {"#b5442e", "#2e7d4f", "#2f5fa8"};
constexpr const char* kGrey = "#888";

std::pair<double, double> widened(double low, double high) {
  const double room = high > low ? 0.06 * (high - low) : std::max(1e-6, 0.1 * std::abs(high));
  return {low - room, high + room};
}

// Ticks at round numbers, four to eight of them.
std::vector<double> ticks(double low, double high) {
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

// On a logarithmic axis: 1, 2, 5 in each decade, or whole decades where there are many.
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

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

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
  if (empty()) {
    return fmt::format(
        "<text x=\"{}\" y=\"{}\" fill=\"#777\">this protocol does not show it</text>", kLeft,
        kHeight / 2);
  }
  const auto [y0, y1] = widened(scaled_y(low_y_), scaled_y(high_y_));
  const auto [x0, x1] = widened(scaled_x(low_x_), scaled_x(high_x_));
  const auto px = [&, a = x0, b = x1](double x) {
    return kLeft + (x - a) / (b - a) * (kWidth - kLeft - 8);
  };
  const auto py = [&, a = y0, b = y1](double y) {
    return kHeight - kBottom - (y - a) / (b - a) * (kHeight - kBottom - kTop);
  };
  std::string out;
  for (const double y : log_y_ ? log_ticks(y0, y1) : ticks(y0, y1)) {
    out += fmt::format(
        "<line stroke=\"#ddd\" x1=\"{}\" x2=\"{}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/><text x=\"{}\" "
        "y=\"{:.1f}\" text-anchor=\"end\">{:.6g}</text>",
        kLeft, kWidth - 8, py(y), py(y), kLeft - 4, py(y) + 4, log_y_ ? std::pow(10, y) : y);
  }
  for (const double x : log_x_ ? log_ticks(x0, x1) : ticks(x0, x1)) {
    out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:.6g}</text>", px(x),
                       kHeight - kBottom + 14, log_x_ ? std::pow(10, x) : x);
  }
  out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                     (kWidth + kLeft) / 2, kHeight - 4, x_label_);
  out += fmt::format(
      "<text x=\"12\" y=\"{}\" transform=\"rotate(-90 12 {})\" text-anchor=\"middle\">{}</text>",
      kHeight / 2, kHeight / 2, y_label_);
  double legend = kLeft + 6;
  for (const Series& s : series_) {
    if (s.line) {
      out += fmt::format("<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\" points=\"",
                         s.colour);
      for (std::size_t i = 0; i < s.x.size(); ++i) {
        if (std::isfinite(s.y[i])) {
          fmt::format_to(std::back_inserter(out), "{:.1f},{:.1f} ", px(scaled_x(s.x[i])),
                         py(scaled_y(s.y[i])));
        }
      }
      out += "\"/>";
    } else {
      for (std::size_t i = 0; i < s.x.size(); ++i) {
        if (std::isfinite(s.y[i])) {
          fmt::format_to(std::back_inserter(out),
                         "<circle r=\"2\" fill=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\"/>", s.colour,
                         px(scaled_x(s.x[i])), py(scaled_y(s.y[i])));
        }
      }
    }
    if (!s.name.empty()) {
      out += fmt::format("<text x=\"{}\" y=\"{}\" fill=\"{}\">{}</text>", legend, kTop - 4,
                         s.colour, escaped(s.name));
      legend += 8.0 + 6.5 * static_cast<double>(s.name.size());
    }
  }
  return out;
}

std::vector<Chart> charts_of(const Diagnosis& d) {
  std::vector<Chart> charts;
  const Plots& p = d.plots;
  Chart noise("Noise spectrum", "Hz", "mg per sample, white equivalent");
  for (std::size_t a = 0; a < 3; ++a) {
    std::vector<double> real, model;
    for (const double v : p.noise_mg2[a]) {
      real.push_back(std::sqrt(v));
    }
    for (const double v : p.noise_model_mg2[a]) {
      model.push_back(std::sqrt(v));
    }
    noise.line(p.frequency_hz, real, kColours[a], std::string(1, "XYZ"[a]));
    noise.line(p.frequency_hz, model, kGrey, a == 0 ? "model" : "");
  }
  charts.push_back(std::move(noise));
  Chart allan("Allan deviation of the longest still record", "s", "mg");
  allan.log_x();
  allan.log_y();
  for (std::size_t a = 0; a < 3; ++a) {
    allan.points(p.allan_s, p.allan_mg[a], kColours[a], std::string(1, "XYZ"[a]));
    allan.line(p.allan_s, p.allan_nominal_mg[a], "#ccc", a == 0 ? "nominal" : "");
    allan.line(p.allan_s, p.allan_model_mg[a], kGrey, a == 0 ? "with the effects" : "");
  }
  charts.push_back(std::move(allan));
  Chart tones("Tone response", "Hz", "amplitude over nominal");
  tones.log_x();
  for (int a = 0; a < 3; ++a) {
    std::vector<double> x, y, m;
    for (const Plots::Tone& t : p.tones) {
      if (t.axis == a) {
        x.push_back(t.frequency_hz);
        y.push_back(t.ratio);
        m.push_back(t.model);
      }
    }
    tones.points(x, y, kColours[static_cast<std::size_t>(a)], std::string(1, "XYZ"[a]));
    tones.points(x, m, kGrey, a == 0 ? "model" : "");
  }
  charts.push_back(std::move(tones));
  Chart loop("Zero over temperature, means left by the nominal simulator", "C", "mg");
  Chart after("Means left with the accepted effects on", "minutes", "mg");
  for (int a = 0; a < 3; ++a) {
    std::vector<double> t, y, m, z;
    for (const Plots::Residual& r : p.residuals) {
      if (r.axis == a) {
        t.push_back(r.temperature_c);
        y.push_back(r.before_mg);
        m.push_back(r.minutes);
        z.push_back(r.after_mg);
      }
    }
    loop.points(t, y, kColours[static_cast<std::size_t>(a)], std::string(1, "XYZ"[a]));
    after.points(m, z, kColours[static_cast<std::size_t>(a)], std::string(1, "XYZ"[a]));
  }
  charts.push_back(std::move(loop));
  charts.push_back(std::move(after));
  Chart step("After a move", "s", "share of the step");
  step.line(p.step_s, p.step_share, kColours[2], "seen");
  step.line(p.step_s, p.step_model, kGrey, "model");
  charts.push_back(std::move(step));
  return charts;
}

}  // namespace sixpoint::gap

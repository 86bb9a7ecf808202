#include "gap/report_sheet.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "gap/chart.h"

namespace sixpoint::gap {
namespace {

constexpr double kPageWidth = 794;  // A4 at 96 dots per inch
constexpr double kPageHeight = 1123;
constexpr double kMargin = 40;
constexpr std::size_t kSentenceColumns = 84;

std::vector<std::string> wrapped(const std::string& text, std::size_t columns, std::size_t most) {
  std::vector<std::string> lines;
  std::string line;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (!line.empty() && line.size() + 1 + word.size() > columns) {
      lines.push_back(std::move(line));
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
    at = end + 1;
  }
  lines.push_back(line);
  if (lines.size() > most) {
    lines.resize(most);
    lines.back() += " ...";
  }
  return lines;
}

class Sheet {
 public:
  void text(double x, double y, double size, const std::string& words, const char* extra = "") {
    out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" {}>{}</text>", x, y, size,
                        extra, escaped(words));
  }
  void box(double x, double y, double width, double height, const std::string& colour) {
    out_ += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>", x, y,
        width, height, colour);
  }
  void chart(double x, double y, double width, const Chart& chart) {
    text(x, y + 11, 11, chart.title(), "font-weight=\"bold\"");
    out_ += fmt::format(
        "<svg x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" viewBox=\"0 0 {} {}\" "
        "font-size=\"11\">{}</svg>",
        x, y + 14, width, width * Chart::kHeight / Chart::kWidth, Chart::kWidth, Chart::kHeight,
        chart.drawing());
  }
  std::string finish() const {
    return fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><svg xmlns=\"http://www.w3.org/2000/svg\" "
        "width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" font-family=\"DejaVu Sans, "
        "sans-serif\" fill=\"#222\"><rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>{2}</svg>",
        kPageWidth, kPageHeight, out_);
  }

 private:
  std::string out_;
};

// From before to the floor: squares add, each accepted effect takes its share by its evidence.
std::vector<std::pair<std::string, double>> waterfall(const Diagnosis& d) {
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
  bars.emplace_back("floor", d.gap.floor_mg);
  return bars;
}

}  // namespace

std::string report_sheet(const Diagnosis& d) {
  Sheet sheet;
  const double width = kPageWidth - 2 * kMargin;
  double y = kMargin + 8;
  sheet.text(kMargin, y, 12,
             fmt::format("Gap between simulator and recording: unit {}, firmware {}, protocol {}",
                         d.serial, d.firmware, d.protocol));
  const auto sentence = wrapped(d.brief(), kSentenceColumns, 6);
  y += 12;
  const double high = 14 + 19 * static_cast<double>(sentence.size());
  sheet.box(kMargin, y, width, high, "#f2f0ea");
  sheet.box(kMargin, y, 5, high, "#b5442e");
  y += 4;
  for (const std::string& line : sentence) {
    y += 19;
    sheet.text(kMargin + 16, y - 1, 14, line);
  }
  y += 30;

  // Left: the effects. Right: the waterfall.
  const double half = width / 2 - 8;
  const double right = kMargin + width / 2 + 8;
  double left_y = y;
  sheet.text(kMargin, left_y, 11, "Accepted effects", "font-weight=\"bold\"");
  for (std::size_t i = 0; i < std::min<std::size_t>(5, d.effects.size()); ++i) {
    const EffectFinding& e = d.effects[i];
    left_y += 16;
    sheet.text(kMargin, left_y, 11,
               fmt::format("{}: p {:.3f}, held out {:+.0f} nats", e.name, e.probability,
                           e.held_out_gain_nats));
    for (const NamedValue& p : e.parameters) {
      if (p.value.size() <= 3) {
        left_y += 13;
        sheet.text(kMargin + 10, left_y, 10,
                   fmt::format("{} {:.3g}", p.name, fmt::join(p.value, "  ")), "fill=\"#555\"");
      }
    }
  }
  if (d.effects.empty()) {
    left_y += 16;
    sheet.text(kMargin, left_y, 11, "none");
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(3, d.unknown.where.size()); ++i) {
    left_y += 15;
    sheet.text(kMargin, left_y, 10, wrapped("not explained: " + d.unknown.where[i], 62, 1).front(),
               "fill=\"#b5442e\"");
  }
  double right_y = y;
  sheet.text(right, right_y, 11, "Gap on conditions that were not fitted, mg (bars: root)",
             "font-weight=\"bold\"");
  const auto bars = waterfall(d);
  double most = 1e-9;
  for (const auto& [name, mg] : bars) {
    most = std::max(most, mg);
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(8, bars.size()); ++i) {
    right_y += 17;
    sheet.text(right, right_y, 10, bars[i].first);
    sheet.text(right + 186, right_y, 10, fmt::format("{:.2f}", bars[i].second),
               "text-anchor=\"end\"");
    sheet.box(right + 194, right_y - 9, (half - 200) * std::sqrt(bars[i].second / most), 10,
              i + 1 == bars.size() ? "#888" : "#b5442e");
  }
  y = std::max(left_y, right_y) + 26;

  // Residual map: axes by segments.
  sheet.text(kMargin, y, 11, "Where the nominal simulator is off: sigma per number, by segment",
             "font-weight=\"bold\"");
  std::vector<std::string> segments;
  std::map<std::pair<int, std::string>, Location> cells;
  for (const Plots::Residual& r : d.plots.residuals) {
    if (std::find(segments.begin(), segments.end(), r.segment) == segments.end()) {
      segments.push_back(r.segment);
    }
  }
  for (const Location& w : d.where) {
    cells.emplace(std::pair{w.axis, w.segment}, w);
  }
  const double cell = (width - 24) / static_cast<double>(std::max<std::size_t>(1, segments.size()));
  for (std::size_t k = 0; k < segments.size(); ++k) {
    sheet.text(kMargin + 24 + cell * (static_cast<double>(k) + 0.5), y + 15, 8.5, segments[k],
               "text-anchor=\"middle\"");
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double top = y + 20 + 17 * axis;
    sheet.text(kMargin + 4, top + 12, 10, std::string(1, "XYZ"[axis]));
    for (std::size_t k = 0; k < segments.size(); ++k) {
      const auto found = cells.find({axis, segments[k]});
      double sigma = found == cells.end() ? 0 : found->second.sigma;
      if (found == cells.end()) {  // `where` holds the worst only
        double square = 0;
        double n = 0;
        for (const Plots::Residual& r : d.plots.residuals) {
          if (r.axis == axis && r.segment == segments[k]) {
            square += r.before_sigma * r.before_sigma;
            n += 1;
          }
        }
        sigma = std::sqrt(square / std::max(1.0, n));
      }
      const double share = std::clamp(std::log10(std::max(1.0, sigma)) / 2.5, 0.0, 1.0);
      const auto channel = [&](double full) {
        return static_cast<int>(246 - share * (246 - full));
      };
      sheet.box(kMargin + 24 + cell * static_cast<double>(k), top, cell - 2, 15,
                fmt::format("rgb({},{},{})", channel(181), channel(68), channel(46)));
      sheet.text(kMargin + 24 + cell * (static_cast<double>(k) + 0.5), top + 11, 9,
                 fmt::format("{:.2g}", sigma),
                 share > 0.6 ? "text-anchor=\"middle\" fill=\"#fff\"" : "text-anchor=\"middle\"");
    }
  }
  y += 20 + 17 * 3 + 12;

  const auto charts = charts_of(d);
  const double room = (kPageHeight - kMargin - y) / 3;
  const double chart_width = std::min(half, (room - 20) * Chart::kWidth / Chart::kHeight);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const std::size_t row = i / 2;
    sheet.chart(i % 2 == 0 ? kMargin : right, y + room * static_cast<double>(row), chart_width,
                charts[i]);
  }
  return sheet.finish();
}

}  // namespace sixpoint::gap

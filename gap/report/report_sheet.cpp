#include "gap/report/report_sheet.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text/svg.h"
#include "gap/report/chart.h"

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

constexpr double kInnerWidth = kPageWidth - 2 * kMargin;
constexpr double kHalf = kInnerWidth / 2 - 8;
constexpr double kRight = kMargin + kInnerWidth / 2 + 8;  // the right column's left edge
constexpr const char* kRed = "#b5442e";
constexpr const char* kBold = "font-weight=\"bold\"";

// Draws one part below the other; each part begins at the `y` that it is given and returns where it
// ends.
class Sheet {
 public:
  explicit Sheet(const Diagnosis& diagnosis) : d_(diagnosis) {}

  std::string draw() {
    double y = heading(kMargin + 8) + 30;
    y = std::max(effects(y), gap(y)) + 26;
    y = residuals(y) + 12;
    charts(y);
    return fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><svg xmlns=\"http://www.w3.org/2000/svg\" "
        "width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" font-family=\"DejaVu Sans, "
        "sans-serif\" fill=\"#222\"><rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>{2}</svg>",
        kPageWidth, kPageHeight, svg_.marks());
  }

 private:
  void text(double x, double y, double size, const std::string& words, const char* extra = "") {
    svg_.text(x, y, words, fmt::format("font-size=\"{}\" {}", size, extra));
  }
  void box(double x, double y, double width, double height, const std::string& colour) {
    svg_.rect(x, y, width, height, fmt::format("fill=\"{}\"", colour));
  }

  double heading(double y) {
    text(kMargin, y, 12,
         fmt::format("Gap between simulator and recording: unit {}, firmware {}, protocol {}",
                     d_.serial, d_.firmware, d_.protocol));
    const auto sentence = wrapped(d_.brief(), kSentenceColumns, 6);
    y += 12;
    const double height = 14 + 19 * static_cast<double>(sentence.size());
    box(kMargin, y, kInnerWidth, height, "#f2f0ea");
    box(kMargin, y, 5, height, kRed);
    y += 4;
    for (const std::string& line : sentence) {
      y += 19;
      text(kMargin + 16, y - 1, 14, line);
    }
    return y;
  }

  double effects(double y) {
    text(kMargin, y, 11, "Accepted effects", kBold);
    for (std::size_t i = 0; i < std::min<std::size_t>(5, d_.effects.size()); ++i) {
      const EffectFinding& e = d_.effects[i];
      y += 16;
      text(kMargin, y, 11,
           fmt::format("{}: p {:.3f}, held out {:+.0f} nats", e.name, e.probability,
                       e.held_out_gain_nats));
      for (const NamedValue& p : e.all_parameters()) {
        if (p.value.size() <= 3) {
          y += 13;
          text(kMargin + 10, y, 10, fmt::format("{} {:.3g}", p.name, fmt::join(p.value, "  ")),
               "fill=\"#555\"");
        }
      }
    }
    if (d_.effects.empty()) {
      y += 16;
      text(kMargin, y, 11, "none");
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(3, d_.unknown.why.size()); ++i) {
      y += 15;
      text(kMargin, y, 10, wrapped("not explained: " + d_.unknown.why[i], 62, 1).front(),
           "fill=\"#b5442e\"");
    }
    return y;
  }

  double gap(double y) {
    text(kRight, y, 11, "Gap on conditions that were not fitted, mg (bars: root)", kBold);
    auto bars = gap_bars(d_);
    bars.emplace_back("floor", d_.gap.floor_mg);
    double most = 1e-9;
    for (const auto& [name, mg] : bars) {
      most = std::max(most, mg);
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(8, bars.size()); ++i) {
      y += 17;
      text(kRight, y, 10, bars[i].first);
      text(kRight + 186, y, 10, fmt::format("{:.2f}", bars[i].second), "text-anchor=\"end\"");
      box(kRight + 194, y - 9, (kHalf - 200) * std::sqrt(bars[i].second / most), 10,
          i + 1 == bars.size() ? "#888" : kRed);
    }
    return y;
  }

  // Sigma of one axis in one segment: of the worst ones as found, else the rms of its residuals.
  double sigma_of(int axis, const std::string& segment) const {
    const auto found = std::find_if(d_.where.begin(), d_.where.end(), [&](const Location& w) {
      return w.axis == axis && w.segment == segment;
    });
    if (found != d_.where.end()) {
      return found->sigma;
    }
    double square = 0;
    double n = 0;
    for (const Plots::Residual& r : d_.plots.residuals) {
      if (r.axis == axis && r.segment == segment) {
        square += r.before_sigma * r.before_sigma;
        n += 1;
      }
    }
    return std::sqrt(square / std::max(1.0, n));
  }

  // Axes by segments.
  double residuals(double y) {
    text(kMargin, y, 11, "Where the nominal simulator is off: sigma per number, by segment", kBold);
    std::vector<std::string> segments;
    for (const Plots::Residual& r : d_.plots.residuals) {
      if (std::find(segments.begin(), segments.end(), r.segment) == segments.end()) {
        segments.push_back(r.segment);
      }
    }
    const double cell =
        (kInnerWidth - 24) / static_cast<double>(std::max<std::size_t>(1, segments.size()));
    for (std::size_t k = 0; k < segments.size(); ++k) {
      const double left = kMargin + 24 + cell * static_cast<double>(k);
      text(left + cell / 2, y + 15, 8.5, segments[k], "text-anchor=\"middle\"");
      for (int axis = 0; axis < 3; ++axis) {
        const double top = y + 20 + 17 * axis;
        const double sigma = sigma_of(axis, segments[k]);
        const double shade = sigma_shade(sigma);
        const auto channel = [&](double full) {
          return static_cast<int>(246 - shade * (246 - full));
        };
        box(left, top, cell - 2, 15,
            fmt::format("rgb({},{},{})", channel(181), channel(68), channel(46)));
        text(left + cell / 2, top + 11, 9, fmt::format("{:.2g}", sigma),
             shade > 0.6 ? "text-anchor=\"middle\" fill=\"#fff\"" : "text-anchor=\"middle\"");
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      text(kMargin + 4, y + 32 + 17 * axis, 10, std::string(1, "XYZ"[axis]));
    }
    return y + 20 + 17 * 3;
  }

  // In two columns and three rows, as large as the rest of the page allows.
  void charts(double y) {
    const double row_height = (kPageHeight - kMargin - y) / 3;
    const double width = std::min(kHalf, (row_height - 20) * Chart::kWidth / Chart::kHeight);
    std::size_t i = 0;
    for (const Chart& chart : charts_of(d_)) {
      const double x = i % 2 == 0 ? kMargin : kRight;
      const std::size_t row = i / 2;
      const double top = y + row_height * static_cast<double>(row);
      text(x, top + 11, 11, chart.title(), kBold);
      svg_.add(fmt::format(
          "<svg x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" viewBox=\"0 0 {} {}\" "
          "font-size=\"11\">{}</svg>",
          x, top + 14, width, width * Chart::kHeight / Chart::kWidth, Chart::kWidth, Chart::kHeight,
          chart.drawing()));
      ++i;
    }
  }

  const Diagnosis& d_;
  Svg svg_;
};

}  // namespace

std::string report_sheet(const Diagnosis& d) { return Sheet(d).draw(); }

}  // namespace sixpoint::gap

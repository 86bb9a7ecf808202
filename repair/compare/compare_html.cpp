// The page of compare_html(): plain HTML with drawings in SVG, no script, nothing to load.
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "base/text/html.h"
#include "base/text/svg.h"
#include "repair/compare/compare.h"

namespace sixpoint::repair {
namespace {

constexpr double kWidth = 900;
constexpr double kHeight = 240;
constexpr double kLeft = 56;
constexpr double kBottom = 30;
constexpr std::array<const char*, 2> kColours = {"#1b6ca8", "#d1495b"};

std::string escaped(std::string_view text) { return printable(html_escaped(text), 400); }

// A drawing with its axes; x and y are in the data's units.
class Plot {
 public:
  Plot(double x_low, double x_high, double y_low, double y_high, std::string_view x_name,
       std::string_view y_name)
      : across{x_low, x_high, kLeft, kWidth - 10}, up_{y_low, y_high, kHeight - 10, 10} {
    svg.rect(kLeft, 10, kWidth - kLeft - 10, kHeight - 20, "fill=\"#fff\" stroke=\"#888\"");
    for (int i = 0; i <= 4; ++i) {
      const double x = x_low + (x_high - x_low) * i / 4;
      const double y = y_low + (y_high - y_low) * i / 4;
      svg.text(across(x), kHeight + 6, fmt::format("{:.4g}", x), "text-anchor=\"middle\"");
      svg.text(kLeft - 5, up(y) + 4, fmt::format("{:.3g}", y), "text-anchor=\"end\"");
    }
    svg.text(kWidth / 2, kHeight + 24, x_name, "text-anchor=\"middle\"");
    svg.text_upward(12, kHeight / 2, y_name);
  }

  double up(double y) const { return up_(std::clamp(y, up_.low, up_.high)); }
  std::string finish() const {
    return fmt::format("<svg viewBox=\"0 0 {} {}\" width=\"{}\" role=\"img\">{}</svg>\n", kWidth,
                       kHeight + kBottom, kWidth, svg.marks());
  }

  SvgScale across;
  Svg svg;

 private:
  SvgScale up_;
};

// Largest and smallest magnitude of each of the columns of [from_s, to_s), as one closed band.
void draw_band(Plot& plot, const Trace& trace, double from_s, double to_s, double lag_s,
               double zero_s, const char* colour) {
  constexpr int kColumns = 600;
  std::vector<std::pair<double, double>> upper;
  std::vector<std::pair<double, double>> lower;
  for (int column = 0; column < kColumns; ++column) {
    const double begin_s = from_s + (to_s - from_s) * column / kColumns;
    const double end_s = from_s + (to_s - from_s) * (column + 1) / kColumns;
    const double first = std::max(0.0, (begin_s + lag_s - trace.start_s()) * trace.rate_hz());
    const double last = (end_s + lag_s - trace.start_s()) * trace.rate_hz();
    float smallest = 1e9F;
    float largest = -1;
    for (auto i = static_cast<std::size_t>(first);
         i < trace.size() && static_cast<double>(i) < last; ++i) {
      if (const float value = trace.magnitude_g(i); !std::isnan(value)) {
        smallest = std::min(smallest, value);
        largest = std::max(largest, value);
      }
    }
    if (largest >= 0) {
      const double x = plot.across((begin_s + end_s) / 2 - zero_s);
      upper.emplace_back(x, plot.up(static_cast<double>(largest)));
      lower.emplace_back(x, plot.up(static_cast<double>(smallest)) + 0.7);
    }
  }
  upper.insert(upper.end(), lower.rbegin(), lower.rend());
  plot.svg.polygon(upper, fmt::format("fill=\"{0}\" fill-opacity=\"0.5\" stroke=\"{0}\" "
                                      "stroke-width=\"0.5\"",
                                      colour));
}

void draw_samples(Plot& plot, const Trace& trace, double from_s, double to_s, double lag_s,
                  double zero_s, const char* colour) {
  std::vector<std::pair<double, double>> places;
  const double first = std::ceil((from_s + lag_s - trace.start_s()) * trace.rate_hz());
  for (auto i = static_cast<std::size_t>(std::max(0.0, first)); i < trace.size(); ++i) {
    const double time_s = trace.start_s() + static_cast<double>(i) / trace.rate_hz() - lag_s;
    if (time_s > to_s) {
      break;
    }
    if (const float value = trace.magnitude_g(i); !std::isnan(value)) {
      places.emplace_back(plot.across(time_s - zero_s), plot.up(static_cast<double>(value)));
    }
  }
  plot.svg.polyline(places,
                    fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"", colour));
}

std::string histogram(const PairComparison& pair) {
  if (pair.histogram.counts.empty()) {
    return {};
  }
  const auto most = static_cast<double>(std::ranges::max(pair.histogram.counts));
  Plot plot(pair.histogram.edges_mg.front(), pair.histogram.edges_mg.back(), 0, std::max(1.0, most),
            "error of the envelopes (second minus first) in mg", "count");
  for (std::size_t i = 0; i < pair.histogram.counts.size(); ++i) {
    const double left = plot.across(pair.histogram.edges_mg[i]);
    const double right = plot.across(pair.histogram.edges_mg[i + 1]);
    const double top = plot.up(static_cast<double>(pair.histogram.counts[i]));
    plot.svg.rect(left, top, std::max(0.5, right - left - 1), plot.up(0) - top, "fill=\"#555\"");
  }
  plot.svg.line(plot.across(0), 10, plot.across(0), kHeight - 10, "stroke=\"#b00\"");
  return plot.finish();
}

// Where the first recording moves most within ten seconds.
double liveliest_s(const Trace& trace, double from_s, double to_s) {
  double best_s = from_s;
  double best = -1;
  for (double t = from_s; t + 10 <= to_s; t += 5) {
    double sum = 0;
    double square = 0;
    double count = 0;
    const double first = std::max(0.0, (t - trace.start_s()) * trace.rate_hz());
    for (auto i = static_cast<std::size_t>(first);
         i < trace.size() && static_cast<double>(i) < first + 10 * trace.rate_hz(); ++i) {
      if (const double value = trace.magnitude_g(i); !std::isnan(value)) {
        sum += value;
        square += value * value;
        count += 1;
      }
    }
    if (count > 5 * trace.rate_hz()) {
      const double variance = square / count - sum * sum / count / count;
      if (variance > best) {
        best = variance;
        best_s = t;
      }
    }
  }
  return best_s;
}

double largest_of(const Trace& trace) {
  float largest = 1.2F;
  for (std::size_t i = 0; i < trace.size(); ++i) {
    if (const float value = trace.magnitude_g(i); value > largest) {
      largest = value;
    }
  }
  return static_cast<double>(largest);
}

std::string draw(const PairComparison& pair, const Trace& a, const Trace& b) {
  const double from_s = std::max(a.start_s(), b.start_s() - pair.lag_s);
  const double to_s = std::max(from_s + 1, std::min(a.end_s(), b.end_s() - pair.lag_s));
  const double highest = std::ceil(10 * std::max(largest_of(a), largest_of(b))) / 10;

  Plot whole(0, to_s - from_s, 0, highest, "seconds", "magnitude in g");
  draw_band(whole, a, from_s, to_s, 0, from_s, kColours[0]);
  draw_band(whole, b, from_s, to_s, pair.lag_s, from_s, kColours[1]);

  const double zoom_s = liveliest_s(a, from_s, to_s);
  const double zoom_lag_s = pair.lag_s + pair.drift_ppm * 1e-6 * (zoom_s - pair.lag_at_s);
  Plot zoom(zoom_s - from_s, zoom_s - from_s + 10, 0, highest, "seconds", "magnitude in g");
  draw_samples(zoom, a, zoom_s, zoom_s + 10, 0, from_s, kColours[0]);
  draw_samples(zoom, b, zoom_s, zoom_s + 10, zoom_lag_s, from_s, kColours[1]);

  std::string remarks;
  for (const std::string& remark : pair.remarks) {
    remarks += "<p>" + escaped(remark) + "</p>";
  }
  return fmt::format(
      "<h2><span style=\"color:{}\">{}</span> and <span style=\"color:{}\">{}</span></h2>\n"
      "<p>Lag {:.4f} s (&plusmn; {:.4f}), drift {:.1f} ppm, {:.0f} s in common. RMS {:.1f} mg. "
      "Envelopes: mean {:+.1f} mg, standard deviation {:.1f} mg, 95 % within {:.1f} mg.</p>{}\n"
      "<h3>Vector magnitude</h3>{}<h3>Ten lively seconds</h3>{}<h3>Histogram of errors</h3>{}",
      kColours[0], escaped(pair.a), kColours[1], escaped(pair.b), pair.shown_lag_s(),
      pair.lag_uncertainty_s, pair.drift_ppm, pair.overlap_s, pair.rms_mg, pair.envelope.mean_mg,
      pair.envelope.sd_mg, pair.envelope.p95_mg, remarks, whole.finish(), zoom.finish(),
      histogram(pair));
}

}  // namespace

std::string compare_html(const std::vector<Trace>& traces,
                         const std::vector<PairComparison>& pairs) {
  std::string page = html_head("Recordings compared", "svg{background:#f6f6f6}");
  for (const PairComparison& pair : pairs) {
    const auto a = std::ranges::find(traces, pair.a, &Trace::name);
    const auto b = std::ranges::find(traces, pair.b, &Trace::name);
    if (a != traces.end() && b != traces.end()) {
      page += draw(pair, *a, *b);
    }
  }
  return page.append(kHtmlEnd);
}

}  // namespace sixpoint::repair

// Statistics as a page and as charts. No script, no other file: it can be mailed.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/text/counted.h"
#include "base/text/html.h"
#include "base/text/svg.h"
#include "station/records/station_records.h"

namespace sixpoint::station {

namespace {

std::string shown(const Proportion& part) {
  return part.of == 0 ? std::string("\u2013")
                      : fmt::format("{:.1f} % <small>({} of {}; {:.1f} to {:.1f} %)</small>",
                                    100 * part.value(), part.count, part.of, 100 * part.low,
                                    100 * part.high);
}

std::string shown(double value, const char* unit) {
  return std::isfinite(value) ? fmt::format("{:.3g} {}", value, unit) : std::string("\u2013");
}

std::string group_row(const GroupStatistics& group) {
  return fmt::format(
      "<tr><th scope=row>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
      group.name.empty() ? "<i>not stated</i>" : html_escaped(group.name), group.runs, group.units,
      shown(group.yield), shown(group.first_pass_yield), shown(group.seconds_per_unit_median, "s"));
}

std::string failure_bars(const GroupStatistics& all) {
  if (all.failure_codes.empty()) {
    return "<p>No run failed.</p>\n";
  }
  constexpr double kBar_px = 320;
  const auto most = static_cast<double>(all.failure_codes.front().second);
  std::string html = "<table class=bars>\n";
  for (const auto& [code, count] : all.failure_codes) {
    const FailureCode* known = find_failure_code(code);
    html += fmt::format(
        "<tr><th scope=row>{}</th><td><svg width={:.0f} height=14 role=img aria-label='{}'>"
        "<rect width={:.1f} height=14 fill='#2b5c8a'/></svg> {}</td><td>{}</td></tr>\n",
        html_escaped(code), kBar_px, counted(count, "run"),
        kBar_px * static_cast<double>(count) / most, count,
        known != nullptr ? html_escaped(known->next_action) : "");
  }
  return html + "</table>\n";
}

constexpr std::string_view kStyle =
    "h2{border-bottom:1px solid #bbb;margin-top:2em}th{font-weight:600}"
    ".bars td:first-of-type{white-space:nowrap}small{color:#555}"
    ".locked{background:#fbe9e7;border-left:6px solid #b71c1c;padding:.6em 1em}"
    ".open{background:#eef5ee;border-left:6px solid #2e7d32;padding:.6em 1em}";

constexpr double kLeft = 64;
constexpr double kRight = 790;
constexpr double kTop = 26;
constexpr double kBottom = 196;
constexpr double kRangeTop = 226;
constexpr double kRangeBottom = 286;

// Values on top, their moving ranges below, over the number of the point.
class ControlDrawing {
 public:
  explicit ControlDrawing(const CheckUnitChart& one) : one_(one), chart_(one.chart) {
    double low = chart_.baseline > 0 ? chart_.lower : HUGE_VAL;
    double high = chart_.baseline > 0 ? chart_.upper : -HUGE_VAL;
    for (const double value : chart_.values) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
    double most_range = chart_.upper_range;
    for (const double range : chart_.moving_ranges) {
      most_range = std::max(most_range, range);
    }
    const double margin = high > low ? 0.08 * (high - low) : 1;
    y_ = {low - margin, high + margin, kBottom, kTop};
    range_y_ = {0, most_range > 0 ? 1.1 * most_range : 1, kRangeBottom, kRangeTop};
  }

  std::string draw() {
    const std::string title = title_of(chart_.name);
    svg_.text(kLeft, 14, one_.serial + " \u2013 " + title, "style='font-weight:bold'");
    if (chart_.baseline > 0) {
      draw_limits();
    }
    std::vector<std::pair<double, double>> values;
    for (std::size_t i = 0; i < chart_.values.size(); ++i) {
      values.emplace_back(x(i), y_(chart_.values[i]));
    }
    std::vector<std::pair<double, double>> ranges;
    for (std::size_t i = 0; i < chart_.moving_ranges.size(); ++i) {
      ranges.emplace_back(x(i + 1), range_y_(chart_.moving_ranges[i]));
    }
    svg_.polyline(values, "fill='none' stroke='#2b5c8a' stroke-width='1.4'");
    svg_.polyline(ranges, "fill='none' stroke='#2b5c8a' stroke-width='1.2'");
    svg_.line(kLeft, kRangeBottom, kRight, kRangeBottom, "stroke='#777'");
    svg_.text(4, kRangeTop + 20, "moving");
    svg_.text(4, kRangeTop + 33, "range");
    for (std::size_t i = 0; i < chart_.values.size(); ++i) {
      draw_point(i);
    }
    if (!one_.times.empty()) {
      svg_.text(kLeft, 302, to_iso8601(one_.times.front()).substr(0, 10));
      svg_.text(kRight, 302, to_iso8601(one_.times.back()).substr(0, 10), "text-anchor='end'");
    }
    return fmt::format(
        "<svg viewBox=\"0 0 860 308\" width=\"100%\" role=\"img\" aria-label=\"{} of check unit "
        "{}\">{}</svg>\n",
        html_escaped(title), html_escaped(one_.serial), svg_.marks());
  }

 private:
  double x(std::size_t point) const {
    return chart_.values.size() < 2 ? (kLeft + kRight) / 2
                                    : kLeft + (kRight - kLeft) * static_cast<double>(point) /
                                                  static_cast<double>(chart_.values.size() - 1);
  }

  void draw_limits() {
    constexpr const char* kDashed = "stroke='#777' stroke-dasharray='6 4'";
    const double edge =
        (x(chart_.baseline - 1) + x(std::min(chart_.baseline, chart_.values.size() - 1))) / 2;
    svg_.rect(kLeft, kTop, edge - kLeft, kBottom - kTop, "fill='#f1f1f1'");
    svg_.text(kLeft + 4, kBottom + 12, "baseline");
    const int places =
        std::clamp(2 - static_cast<int>(std::floor(std::log10(y_.high - y_.low))), 0, 6);
    const auto level = [&](double at, double value, const char* label, const char* style) {
      svg_.line(kLeft, at, kRight, at, style);
      svg_.text(kRight + 6, at + 4, fmt::format("{} {:.{}f}", label, value, places));
    };
    level(y_(chart_.upper), chart_.upper, "+3\u03c3", kDashed);
    level(y_(chart_.centre), chart_.centre, "mean", "stroke='#777'");
    level(y_(chart_.lower), chart_.lower, "\u22123\u03c3", kDashed);
    level(range_y_(chart_.upper_range), chart_.upper_range, "D4", kDashed);
  }

  // The rules that a point breaks stand beside it: colour is never alone.
  void draw_point(std::size_t i) {
    std::string rules;
    for (const ChartSignal& signal : chart_.signals) {
      if (signal.point == i) {
        rules += fmt::format("{}{}", rules.empty() ? "" : ",", signal.rule);
      }
    }
    const double at_y = y_(chart_.values[i]);
    if (rules.empty()) {
      svg_.circle(x(i), at_y, 3, "fill='#2b5c8a'");
    } else {
      svg_.rect(x(i) - 5, at_y - 5, 10, 10, "fill='#b71c1c'");
      svg_.text(x(i), at_y - 8, rules, "text-anchor='middle'");
    }
  }

  const CheckUnitChart& one_;
  const ControlChart& chart_;
  SvgScale y_;
  SvgScale range_y_;
  Svg svg_;
};

}  // namespace

std::string chart_svg(const CheckUnitChart& one) { return ControlDrawing(one).draw(); }

std::string statistics_html(const StatisticsReport& report,
                            const std::vector<StationState>& states) {
  std::string html = html_head("Statistics of the station", kStyle);
  html += fmt::format("<p>{}</p>\n", html_escaped(report.brief()));
  html += "<h2>Yield</h2>\n<table><thead><tr><th>" + html_escaped(report.by) +
          "</th><th>runs</th><th>units</th><th>yield</th><th>first pass</th>"
          "<th>time per unit (median)</th></tr></thead>\n<tbody>";
  for (const GroupStatistics& group : report.groups) {
    html += group_row(group);
  }
  html += group_row(report.all) + "</tbody></table>\n";
  html += "<p><small>In parentheses: counts, and the 95 % interval (Wilson).</small></p>\n";
  html += "<h2>Failure codes</h2>\n" + failure_bars(report.all);
  html +=
      "<h2>Capability</h2>\n<table><thead><tr><th>quantity</th><th>units</th><th>mean</th>"
      "<th>sd</th><th>Cp</th><th>Cpk <small>(95 %)</small></th></tr></thead><tbody>\n";
  for (const auto& [name, one] : report.capabilities) {
    html += fmt::format(
        "<tr><th scope=row>{}</th><td>{}</td><td>{:.4g}</td><td>{:.3g}</td><td>{}</td><td>{:.2f} "
        "<small>({:.2f} to {:.2f})</small></td></tr>\n",
        html_escaped(title_of(name)), one.n, one.mean, one.sd,
        one.cp ? fmt::format("{:.2f}", *one.cp) : "\u2013", one.cpk, one.cpk_low, one.cpk_high);
  }
  html += "</tbody></table>\n";
  for (const std::string& name : report.limits_differ) {
    html += fmt::format("<p>{}: no Cpk, for units were judged by different limits.</p>\n",
                        html_escaped(title_of(name)));
  }
  for (const StationState& state : states) {
    html +=
        fmt::format("<h2>Check units: {}</h2>\n<p class={}>{}</p>\n",
                    state.station.empty() ? "station without a name" : html_escaped(state.station),
                    state.locked ? "locked" : "open", html_escaped(state.brief()));
    for (const CheckUnitChart& chart : state.charts) {
      html += chart_svg(chart);
    }
    html +=
        "<p><small>Squares: points that break a rule of Nelson's, with its number. Limits: mean "
        "\u00b1 3 \u00d7 mean moving range / 1.128 of the baseline.</small></p>\n";
  }
  return html.append(kHtmlEnd);
}

}  // namespace sixpoint::station

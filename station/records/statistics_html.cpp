// Statistics as a page and as charts. No script, no other file: it can be mailed.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "station/station_records.h"

namespace sixpoint::station {

namespace {

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
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

std::string shown(const Proportion& part) {
  return part.of == 0 ? std::string("\u2013")
                      : fmt::format("{:.1f} % <small>({} of {}; {:.1f} to {:.1f} %)</small>",
                                    100 * part.value(), part.count, part.of, 100 * part.low,
                                    100 * part.high);
}

std::string shown(double value, const char* unit) {
  return std::isfinite(value) ? fmt::format("{:.3g} {}", value, unit) : std::string("\u2013");
}

std::string title_of(std::string_view chart_name) {
  const std::size_t space = chart_name.find(' ');
  const QuantityInfo* info = find_quantity(chart_name.substr(0, space));
  if (info == nullptr) {
    return std::string(chart_name);
  }
  std::string title = fmt::format("{}, {}", info->title, info->unit);
  if (space != std::string_view::npos) {
    title += fmt::format(", {}", chart_name.substr(space + 1));
  }
  return title;
}

std::string group_row(const GroupStatistics& group) {
  return fmt::format(
      "<tr><th scope=row>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
      group.name.empty() ? "<i>not stated</i>" : escaped(group.name), group.runs, group.units,
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
        "<tr><th scope=row>{}</th><td><svg width={:.0f} height=14 role=img aria-label='{} runs'>"
        "<rect width={:.1f} height=14 fill='#2b5c8a'/></svg> {}</td><td>{}</td></tr>\n",
        escaped(code), kBar_px, count, kBar_px * static_cast<double>(count) / most, count,
        known != nullptr ? escaped(known->next_action) : "");
  }
  return html + "</table>\n";
}

constexpr std::string_view kStyle =
    "body{font:15px/1.45 sans-serif;color:#1a1a1a;margin:2em auto;max-width:60em;padding:0 1em}"
    "h1{font-size:1.6em;margin-bottom:0}h2{font-size:1.15em;border-bottom:1px solid "
    "#bbb;margin-top:2em}"
    "table{border-collapse:collapse;width:100%}th,td{text-align:left;padding:.25em .6em;"
    "border-bottom:1px solid #ddd;vertical-align:top}td{font-variant-numeric:tabular-nums}"
    "th{font-weight:600}.bars td:first-of-type{white-space:nowrap}"
    "small{color:#555}.locked{background:#fbe9e7;border-left:6px solid #b71c1c;padding:.6em 1em}"
    ".open{background:#eef5ee;border-left:6px solid #2e7d32;padding:.6em 1em}"
    "svg text{font:11px sans-serif;fill:#333}";

}  // namespace

std::string chart_svg(const CheckUnitChart& one) {
  const ControlChart& chart = one.chart;
  constexpr double kWidth = 860;
  constexpr double kLeft = 64;
  constexpr double kRight = 790;
  constexpr double kTop = 26;
  constexpr double kBottom = 196;
  constexpr double kRangeTop = 226;
  constexpr double kRangeBottom = 286;
  double low = chart.baseline > 0 ? chart.lower : HUGE_VAL;
  double high = chart.baseline > 0 ? chart.upper : -HUGE_VAL;
  for (const double value : chart.values) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double most_range = chart.upper_range;
  for (const double range : chart.moving_ranges) {
    most_range = std::max(most_range, range);
  }
  const double margin = high > low ? 0.08 * (high - low) : 1;
  low -= margin;
  high += margin;
  most_range = most_range > 0 ? 1.1 * most_range : 1;
  const auto x = [&](std::size_t point) {
    return chart.values.size() < 2 ? (kLeft + kRight) / 2
                                   : kLeft + (kRight - kLeft) * static_cast<double>(point) /
                                                 static_cast<double>(chart.values.size() - 1);
  };
  const auto y = [&](double value) {
    return kBottom - (kBottom - kTop) * (value - low) / (high - low);
  };
  const auto range_y = [&](double value) {
    return kRangeBottom - (kRangeBottom - kRangeTop) * value / most_range;
  };
  const int places = std::clamp(2 - static_cast<int>(std::floor(std::log10(high - low))), 0, 6);

  std::string svg = fmt::format(
      "<svg viewBox='0 0 {:.0f} 308' width='100%' role=img aria-label='{} of check unit {}'>\n"
      "<text x={:.0f} y=14 style='font-weight:bold'>{} \u2013 {}</text>\n",
      kWidth, escaped(title_of(chart.name)), escaped(one.serial), kLeft, escaped(one.serial),
      escaped(title_of(chart.name)));
  const auto level = [&](double at, double value, const char* label, const char* style) {
    svg += fmt::format(
        "<line x1={:.1f} x2={:.1f} y1={:.1f} y2={:.1f} stroke='#777' {}/>"
        "<text x={:.1f} y={:.1f}>{} {:.{}f}</text>\n",
        kLeft, kRight, at, at, style, kRight + 6, at + 4, label, value, places);
  };
  if (chart.baseline > 0) {
    const double edge =
        (x(chart.baseline - 1) + x(std::min(chart.baseline, chart.values.size() - 1))) / 2;
    svg += fmt::format(
        "<rect x={:.1f} y={:.1f} width={:.1f} height={:.1f} fill='#f1f1f1'/>"
        "<text x={:.1f} y={:.1f}>baseline</text>\n",
        kLeft, kTop, edge - kLeft, kBottom - kTop, kLeft + 4, kBottom + 12);
    level(y(chart.upper), chart.upper, "+3\u03c3", "stroke-dasharray='6 4'");
    level(y(chart.centre), chart.centre, "mean", "");
    level(y(chart.lower), chart.lower, "\u22123\u03c3", "stroke-dasharray='6 4'");
    level(range_y(chart.upper_range), chart.upper_range, "D4", "stroke-dasharray='6 4'");
  }
  std::string line;
  for (std::size_t i = 0; i < chart.values.size(); ++i) {
    line += fmt::format("{:.1f},{:.1f} ", x(i), y(chart.values[i]));
  }
  std::string ranges;
  for (std::size_t i = 0; i < chart.moving_ranges.size(); ++i) {
    ranges += fmt::format("{:.1f},{:.1f} ", x(i + 1), range_y(chart.moving_ranges[i]));
  }
  svg += fmt::format(
      "<polyline points='{}' fill='none' stroke='#2b5c8a' stroke-width='1.4'/>\n"
      "<polyline points='{}' fill='none' stroke='#2b5c8a' stroke-width='1.2'/>\n"
      "<line x1={:.1f} x2={:.1f} y1={:.1f} y2={:.1f} stroke='#777'/>"
      "<text x=4 y={:.1f}>moving</text><text x=4 y={:.1f}>range</text>\n",
      line, ranges, kLeft, kRight, kRangeBottom, kRangeBottom, kRangeTop + 20, kRangeTop + 33);
  for (std::size_t i = 0; i < chart.values.size(); ++i) {
    // Which rules a point breaks stands beside it: colour is never alone.
    std::string rules;
    for (const ChartSignal& signal : chart.signals) {
      if (signal.point == i) {
        rules += fmt::format("{}{}", rules.empty() ? "" : ",", signal.rule);
      }
    }
    const double at_x = x(i);
    const double at_y = y(chart.values[i]);
    if (rules.empty()) {
      svg += fmt::format("<circle cx={:.1f} cy={:.1f} r=3 fill='#2b5c8a'/>\n", at_x, at_y);
    } else {
      svg += fmt::format(
          "<rect x={:.1f} y={:.1f} width=10 height=10 fill='#b71c1c'/>"
          "<text x={:.1f} y={:.1f} text-anchor=middle>{}</text>\n",
          at_x - 5, at_y - 5, at_x, at_y - 8, rules);
    }
  }
  if (!one.times.empty()) {
    svg += fmt::format(
        "<text x={:.1f} y=302>{}</text><text x={:.1f} y=302 text-anchor=end>{}</text>\n", kLeft,
        to_iso8601(one.times.front()).substr(0, 10), kRight,
        to_iso8601(one.times.back()).substr(0, 10));
  }
  return svg + "</svg>\n";
}

std::string statistics_html(const StatisticsReport& report,
                            const std::vector<StationState>& states) {
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=en><head><meta charset=utf-8><title>Statistics of the "
      "station</title><style>{}</style></head><body>\n<h1>Statistics of the "
      "station</h1>\n<p>{}</p>\n",
      kStyle, escaped(report.brief()));
  html +=
      "<h2>Yield</h2>\n<table><thead><tr><th>{}</th><th>runs</th><th>units</th>"
      "<th>yield</th><th>first pass</th><th>time per unit (median)</th></tr></thead>\n<tbody>";
  html.replace(html.find("<th>{}</th>"), 11,
               fmt::format("<th>{}</th>", report.by.empty() ? "" : escaped(report.by)));
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
        escaped(title_of(name)), one.n, one.mean, one.sd,
        one.cp ? fmt::format("{:.2f}", *one.cp) : "\u2013", one.cpk, one.cpk_low, one.cpk_high);
  }
  html += "</tbody></table>\n";
  for (const StationState& state : states) {
    html += fmt::format("<h2>Check units: {}</h2>\n<p class={}>{}</p>\n",
                        state.station.empty() ? "station without a name" : escaped(state.station),
                        state.locked ? "locked" : "open", escaped(state.brief()));
    for (const CheckUnitChart& chart : state.charts) {
      html += chart_svg(chart);
    }
    html +=
        "<p><small>Squares: points that break a rule of Nelson's, with its number. Limits: mean "
        "\u00b1 3 \u00d7 mean moving range / 1.128 of the baseline.</small></p>\n";
  }
  return html + "</body></html>\n";
}

}  // namespace sixpoint::station

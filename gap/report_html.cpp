#include "gap/report_html.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace sixpoint::gap {
namespace {

constexpr double kWidth = 460;
constexpr double kHeight = 240;
constexpr double kLeft = 52;
constexpr double kBottom = 34;
constexpr double kTop = 10;
constexpr std::array<const char*, 3> kColours = {"#b5442e", "#2e7d4f", "#2f5fa8"};

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

// Axes, ticks and marks of one drawing.
class Chart {
 public:
  Chart(std::string title, std::string x_label, std::string y_label)
      : title_(std::move(title)), x_label_(std::move(x_label)), y_label_(std::move(y_label)) {}

  void points(const std::vector<double>& x, const std::vector<double>& y, const char* colour,
              std::string name) {
    add({x, y, colour, false, std::move(name)});
  }
  void line(const std::vector<double>& x, const std::vector<double>& y, const char* colour,
            std::string name) {
    add({x, y, colour, true, std::move(name)});
  }
  void log_x() { log_x_ = true; }

  std::string svg() const {
    if (series_.empty() || !(high_x_ >= low_x_) || !(high_y_ >= low_y_)) {
      return fmt::format("<figure><figcaption>{}</figcaption><p>not in this protocol</p></figure>",
                         title_);
    }
    std::string out = fmt::format(
        "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 {} {}\" role=\"img\" "
        "aria-label=\"{}\">",
        title_, kWidth, kHeight, title_);
    const auto [y0, y1] = widened(low_y_, high_y_);
    const auto [x0, x1] = widened(scaled(low_x_), scaled(high_x_));
    const auto px = [&, a = x0, b = x1](double x) {
      return kLeft + (scaled(x) - a) / (b - a) * (kWidth - kLeft - 8);
    };
    const auto py = [&, a = y0, b = y1](double y) {
      return kHeight - kBottom - (y - a) / (b - a) * (kHeight - kBottom - kTop);
    };
    for (int i = 0; i <= 4; ++i) {
      const double y = y0 + (y1 - y0) * i / 4;
      out += fmt::format(
          "<line class=\"grid\" x1=\"{}\" x2=\"{}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/><text x=\"{}\" "
          "y=\"{:.1f}\" text-anchor=\"end\">{:.3g}</text>",
          kLeft, kWidth - 8, py(y), py(y), kLeft - 4, py(y) + 4, y);
      const double sx = x0 + (x1 - x0) * i / 4;
      const double x = log_x_ ? std::pow(10, sx) : sx;
      out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:.3g}</text>", px(x),
                         kHeight - kBottom + 14, x);
    }
    out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>", kWidth / 2,
                       kHeight - 4, x_label_);
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
            fmt::format_to(std::back_inserter(out), "{:.1f},{:.1f} ", px(s.x[i]), py(s.y[i]));
          }
        }
        out += "\"/>";
      } else {
        for (std::size_t i = 0; i < s.x.size(); ++i) {
          if (std::isfinite(s.y[i])) {
            fmt::format_to(std::back_inserter(out),
                           "<circle r=\"2\" fill=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\"/>", s.colour,
                           px(s.x[i]), py(s.y[i]));
          }
        }
      }
      if (!s.name.empty()) {
        out += fmt::format("<text x=\"{}\" y=\"{}\" fill=\"{}\">{}</text>", legend, kTop + 10,
                           s.colour, escaped(s.name));
        legend += 8.0 + 6.5 * static_cast<double>(s.name.size());
      }
    }
    return out + "</svg></figure>";
  }

 private:
  struct Series {
    std::vector<double> x, y;
    const char* colour;
    bool line;
    std::string name;
  };
  double scaled(double x) const { return log_x_ ? std::log10(std::max(1e-9, x)) : x; }
  static std::pair<double, double> widened(double low, double high) {
    const double room = high > low ? 0.06 * (high - low) : std::max(1e-6, 0.1 * std::abs(high));
    return {low - room, high + room};
  }
  void add(Series series) {
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

  std::string title_, x_label_, y_label_;
  std::vector<Series> series_;
  bool log_x_ = false;
  double low_x_ = std::numeric_limits<double>::max();
  double high_x_ = std::numeric_limits<double>::lowest();
  double low_y_ = std::numeric_limits<double>::max();
  double high_y_ = std::numeric_limits<double>::lowest();
};

std::string residual_map(const Diagnosis& d) {
  std::string out =
      "<table><caption>Residuals of the nominal simulator, worst "
      "first</caption><tr><th>axis</th><th>segment</th><th>factor</th><th>mg</th><th>sigma</th></"
      "tr>";
  for (const Location& w : d.where) {
    const double share = std::clamp(std::log10(std::max(1.0, w.sigma)) / 2.5, 0.0, 1.0);
    out += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2f}</td><td "
        "style=\"background:rgba(181,68,46,{:.2f})\">{:.1f}</td></tr>",
        "XYZ"[w.axis], escaped(w.segment), escaped(w.factor), w.residual_mg, share, w.sigma);
  }
  return out + "</table>";
}

std::string waterfall(const Diagnosis& d) {
  std::string out = "<table><caption>From the gap to the floor</caption>";
  const double most = std::max({d.gap.before_mg, d.gap.after_mg, d.gap.floor_mg, 1e-9});
  const auto bar = [&](const std::string& name, double mg) {
    out += fmt::format(
        "<tr><td>{}</td><td>{:.2f} mg</td><td><div class=\"bar\" "
        "style=\"width:{:.1f}%\"></div></td></tr>",
        escaped(name), mg, 100 * std::sqrt(mg / most));
  };
  bar("before", d.gap.before_mg);
  // Squares add: each accepted effect takes its share of what was closed, by its evidence.
  double total = 0;
  for (const EffectFinding& e : d.effects) {
    total += e.nats;
  }
  double square = d.gap.before_mg * d.gap.before_mg;
  const double closed = square - d.gap.after_mg * d.gap.after_mg;
  for (const EffectFinding& e : d.effects) {
    square -= total > 0 ? closed * e.nats / total : 0;
    bar("with " + e.name, std::sqrt(std::max(0.0, square)));
  }
  bar("floor of noise and seating", d.gap.floor_mg);
  return out + "</table>";
}

std::string effects_table(const std::vector<EffectFinding>& list, const char* caption,
                          std::size_t limit) {
  std::string out = fmt::format(
      "<table><caption>{}</caption><tr><th>effect</th><th>probability</th><th>evidence, "
      "nats</th><th>held out, nats</th><th>parameters</th><th>looks like</th></tr>",
      caption);
  for (std::size_t i = 0; i < std::min(limit, list.size()); ++i) {
    const EffectFinding& e = list[i];
    std::string parameters;
    for (const NamedValue& p : e.parameters) {
      parameters += fmt::format("{} = {:.4g}", p.name, fmt::join(p.value, ", "));
      parameters += p.sd.empty() ? "; " : fmt::format(" &plusmn; {:.2g}; ", fmt::join(p.sd, ", "));
    }
    out += fmt::format(
        "<tr><td>{}{}</td><td>{:.3f}</td><td>{:.1f}</td><td>{:.1f}</td><td>{}</td><td>{}</td></tr>",
        e.name, e.outside_datasheet ? " (outside the datasheet)" : "", e.probability, e.nats,
        e.held_out_gain_nats, parameters, fmt::join(e.confounded_with, ", "));
  }
  return out + "</table>";
}

}  // namespace

std::string report_html(const Diagnosis& d) {
  std::string out =
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Gap diagnosis</title><style>"
      "body{font:15px/1.45 system-ui,sans-serif;max-width:1000px;margin:1.5em auto;padding:0 "
      "1em;color:#222}"
      "h1{font-size:1.2em}.say{font-size:1.25em;padding:.7em "
      "1em;background:#f2f0ea;border-left:5px solid #b5442e}"
      "table{border-collapse:collapse;margin:1em "
      "0;width:100%}caption{text-align:left;font-weight:600}"
      "td,th{border-bottom:1px solid #ddd;padding:.15em .5em;text-align:left}"
      "figure{display:inline-block;width:460px;margin:.5em .5em 0 0}figcaption{font-weight:600}"
      "svg text{font:11px "
      "system-ui,sans-serif}.grid{stroke:#ddd}.bar{background:#b5442e;height:1em}"
      "@media print{figure{break-inside:avoid}}</style>";
  out +=
      fmt::format("<h1>Unit {}, firmware {}, protocol {}</h1><p class=\"say\">{}</p>",
                  escaped(d.serial), escaped(d.firmware), escaped(d.protocol), escaped(d.brief()));
  for (const std::string& where : d.unknown.where) {
    out += fmt::format("<p>Not explained: {}</p>", escaped(where));
  }
  for (const std::string& loss : d.losses) {
    out += fmt::format("<p>Note: {}</p>", escaped(loss));
  }
  out += effects_table(d.effects, "Accepted effects", 20);
  out += waterfall(d);
  out += residual_map(d);

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
    noise.line(p.frequency_hz, model, "#999", a == 0 ? "model" : "");
  }
  out += noise.svg();
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
    tones.points(x, m, "#999", a == 0 ? "model" : "");
  }
  out += tones.svg();
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
  out += loop.svg() + after.svg();
  Chart step("After a move", "s", "share of the step");
  step.line(p.step_s, p.step_share, kColours[2], "seen");
  step.line(p.step_s, p.step_model, "#999", "model");
  out += step.svg();

  out += effects_table(d.candidates, "Candidates", 12);
  out +=
      "<table><caption>Not observable with this protocol</caption><tr><th>effect</th><th>segment "
      "that would show it</th></tr>";
  for (const auto& [name, segment] : d.not_observable) {
    out += fmt::format("<tr><td>{}</td><td>{}</td></tr>", name, segment);
  }
  out += "</table>";
  for (const NextSegment& n : d.next_segments) {
    out += fmt::format("<p>Next: {} ({:.0f} minutes, {:.2f} nats expected) separates {}</p>",
                       n.name, n.minutes, n.expected_nats,
                       escaped(fmt::format("{}", fmt::join(n.separates, ", "))));
  }
  return out + "</html>\n";
}

}  // namespace sixpoint::gap

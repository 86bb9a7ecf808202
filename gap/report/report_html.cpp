#include "gap/report/report_html.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text/html.h"
#include "gap/report/chart.h"

namespace sixpoint::gap {
namespace {

std::string residual_map(const Diagnosis& d) {
  std::string out =
      "<table><caption>Residuals of the nominal simulator, worst "
      "first</caption><tr><th>axis</th><th>segment</th><th>factor</th><th>mg</th><th>sigma</th></"
      "tr>";
  for (const Location& w : d.where) {
    out += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2f}</td><td "
        "style=\"background:rgba(181,68,46,{:.2f})\">{:.1f}</td></tr>",
        "XYZ"[w.axis], html_escaped(w.segment), html_escaped(w.factor), w.residual_mg,
        sigma_shade(w.sigma), w.sigma);
  }
  return out + "</table>";
}

std::string waterfall(const Diagnosis& d) {
  std::string out = "<table><caption>From the gap to the floor</caption>";
  const double most = std::max({d.gap.before_mg, d.gap.after_mg, d.gap.floor_mg, 1e-9});
  auto bars = gap_bars(d);
  bars.emplace_back("floor of noise and seating", d.gap.floor_mg);
  for (const auto& [name, mg] : bars) {
    out += fmt::format(
        "<tr><td>{}</td><td>{:.2f} mg</td><td><div class=\"bar\" "
        "style=\"width:{:.1f}%\"></div></td></tr>",
        html_escaped(name), mg, 100 * std::sqrt(mg / most));
  }
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
    for (const NamedValue& p : e.all_parameters()) {
      parameters += fmt::format("{} = {:.4g}", p.name, fmt::join(p.value, ", "));
      parameters += p.sd.empty()
                        ? "; "
                        : fmt::format(" &plusmn; {}; ", fmt::join(uncertainty_texts(p), ", "));
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
  std::string out = html_head(
      fmt::format("Gap diagnosis: unit {}, firmware {}, protocol {}", d.serial, d.firmware,
                  d.protocol),
      "body{max-width:1000px}figure{display:inline-block;width:460px;margin:.5em .5em 0 0}"
      ".bar{background:#b5442e;height:1em}");
  out += fmt::format("<p class=\"say\">{}</p>", html_escaped(d.brief()));
  for (const std::string& why : d.unknown.why) {
    out += fmt::format("<p>Not explained: {}</p>", html_escaped(why));
  }
  for (const std::string& loss : d.losses) {
    out += fmt::format("<p>Note: {}</p>", html_escaped(loss));
  }
  out += effects_table(d.effects, "Accepted effects", 20);
  out += waterfall(d);
  out += residual_map(d);

  for (const Chart& chart : charts_of(d)) {
    out += chart.figure();
  }

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
                       html_escaped(fmt::format("{}", fmt::join(n.separates, ", "))));
  }
  return out.append(kHtmlEnd);
}

}  // namespace sixpoint::gap

// The page of a GapProgress.
#include <algorithm>

#include <fmt/format.h>

#include "base/text/html.h"
#include "base/text/svg.h"
#include "base/time.h"
#include "gap/adopt/progress.h"

namespace sixpoint::gap {

namespace {

constexpr double kWidth = 860, kHeight = 300, kLeft = 60, kRight = 840, kTop = 20, kBottom = 250;

// "2026-11-30 22:00:35 UTC": a library knows no time zone. A text that is no time stays as it is.
std::string shown_time(const std::string& made_at) {
  const auto time = parse_iso8601(made_at);
  if (!time) {
    return made_at;
  }
  const std::string whole = to_iso8601(*time);
  return fmt::format("{} {} UTC", whole.substr(0, 10), whole.substr(11, 8));
}

double most_of(const GapProgress& progress) {
  double most = 1e-9;
  for (const BundleProgress& bundle : progress.bundles) {
    most = std::max({most, bundle.before_mg, bundle.floor_mg});
    for (const double mg : bundle.after_mg) {
      most = std::max(most, mg);
    }
  }
  return 1.05 * most;
}

void draw_axis(Svg& svg, const SvgScale& y, double most) {
  for (const double tick : round_ticks(0, most)) {
    svg.line(kLeft, y(tick), kRight, y(tick), "stroke=\"#ddd\"");
    svg.text(kLeft - 6, y(tick) + 4, fmt::format("{:g}", tick), "text-anchor=\"end\"");
  }
  svg.text_upward(14, (kTop + kBottom) / 2, "gap, mg");
}

// The root mean square of all recordings: before, after each adoption, and the floor as a line.
std::string steps_chart(const GapProgress& progress) {
  const double most = 1.1 * std::max({progress.all.before_mg, progress.all.floor_mg, 1e-9});
  const SvgScale y{0, most, kBottom, kTop};
  Svg svg;
  draw_axis(svg, y, most);
  std::vector<double> mg = {progress.all.before_mg};
  mg.insert(mg.end(), progress.all.after_mg.begin(), progress.all.after_mg.end());
  const double slot = (kRight - kLeft) / static_cast<double>(mg.size());
  for (std::size_t i = 0; i < mg.size(); ++i) {
    const double x = kLeft + slot * static_cast<double>(i);
    const double top = y(std::min(mg[i], most));
    svg.rect(x + slot * 0.2, top, slot * 0.6, kBottom - top,
             i == 0 ? "fill=\"#8a8577\"" : "fill=\"#b5442e\"");
    svg.text(x + slot / 2, top - 5, fmt::format("{:.2f}", mg[i]), "text-anchor=\"middle\"");
    const std::string name =
        i == 0 ? "before" : fmt::format("adoption {}", progress.history[i - 1].adoption);
    svg.text(x + slot / 2, kBottom + 16, name, "text-anchor=\"middle\"");
    if (i > 0) {
      svg.text(x + slot / 2, kBottom + 32, progress.history[i - 1].made_at.substr(0, 10),
               "text-anchor=\"middle\"");
    }
  }
  svg.line(kLeft, y(progress.all.floor_mg), kRight, y(progress.all.floor_mg),
           "stroke=\"#222\" stroke-dasharray=\"5 4\"");
  svg.text(kRight, y(progress.all.floor_mg) - 4, "floor of noise and seating",
           "text-anchor=\"end\"");
  return svg.marks();
}

// Each recording: before, now and floor, in the order in which they were given.
std::string bundles_chart(const GapProgress& progress) {
  const double most = most_of(progress);
  const SvgScale y{0, most, kBottom, kTop};
  const double slot =
      (kRight - kLeft) / static_cast<double>(std::max<std::size_t>(1, progress.bundles.size()));
  Svg svg;
  draw_axis(svg, y, most);
  for (std::size_t i = 0; i < progress.bundles.size(); ++i) {
    const BundleProgress& bundle = progress.bundles[i];
    const double x = kLeft + slot * (static_cast<double>(i) + 0.5);
    const double now = bundle.after_mg.empty() ? bundle.before_mg : bundle.after_mg.back();
    svg.line(x, y(bundle.before_mg), x, y(now), "stroke=\"#8a8577\"");
    svg.circle(x, y(bundle.before_mg), 4, "fill=\"#8a8577\"");
    svg.circle(x, y(now), 4,
               bundle.learnt_from ? "fill=\"none\" stroke=\"#b5442e\"" : "fill=\"#b5442e\"");
    svg.line(x - 5, y(bundle.floor_mg), x + 5, y(bundle.floor_mg), "stroke=\"#222\"");
  }
  svg.text(kLeft, kBottom + 16,
           "recordings in order; grey: before, red: now (ring: the scenario learnt from it), line: "
           "floor");
  return svg.marks();
}

std::string figure(const char* caption, const std::string& marks) {
  return fmt::format(
      "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 {} {}\">{}</svg></figure>", caption,
      kWidth, kHeight, marks);
}

std::string sums_table(const GapProgress& progress) {
  std::string out =
      "<table><caption>Gap, root mean square in mg</caption><tr><th>recordings</th><th>number</th>"
      "<th>before</th>";
  for (const PopulationState& state : progress.history) {
    out += fmt::format("<th>after adoption {} ({})</th>", state.adoption,
                       html_escaped(shown_time(state.made_at)));
  }
  out += "<th>floor</th><th>closed</th></tr>";
  const auto row = [&](const char* name, const ProgressSum& sum) {
    if (sum.bundles == 0) {
      return;
    }
    out +=
        fmt::format("<tr><td>{}</td><td>{}</td><td>{:.3f}</td>", name, sum.bundles, sum.before_mg);
    for (const double mg : sum.after_mg) {
      out += fmt::format("<td>{:.3f}</td>", mg);
    }
    out += fmt::format("<td>{:.3f}</td><td>{}</td></tr>", sum.floor_mg, sum.closed.text());
  };
  row("all", progress.all);
  row("from which the scenario did not learn", progress.new_ones);
  return out + "</table>";
}

std::string effects_table(const GapProgress& progress) {
  std::string out =
      "<table><caption>What each effect of the last adoption closes: simulated again with all "
      "effects but this one</caption><tr><th>effect</th><th>gap without it, mg</th><th>closes of "
      "the gap</th></tr>";
  for (const EffectProgress& effect : progress.effects) {
    out += effect.scatter
               ? fmt::format("<tr><td>{}</td><td></td><td>scatter: it can't be predicted</td></tr>",
                             html_escaped(effect.name))
               : fmt::format("<tr><td>{}</td><td>{:.3f}</td><td>{}</td></tr>",
                             html_escaped(effect.name), effect.without_mg, effect.closed.text());
  }
  return out + "</table>";
}

std::string bundles_table(const GapProgress& progress) {
  std::string out =
      "<table><caption>Recordings</caption><tr><th>recording</th><th>unit</th><th>learnt "
      "from</th><th>before, mg</th><th>now, mg</th><th>floor, mg</th><th></th></tr>";
  for (const BundleProgress& bundle : progress.bundles) {
    out += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.3f}</td><td>{:.3f}</td><td>{:.3f}</td><td>{}"
        "</td></tr>",
        html_escaped(bundle.name), html_escaped(bundle.serial), bundle.learnt_from ? "yes" : "no",
        bundle.before_mg, bundle.after_mg.empty() ? bundle.before_mg : bundle.after_mg.back(),
        bundle.floor_mg, bundle.unknown ? "something unknown" : "");
  }
  return out + "</table>";
}

}  // namespace

std::string progress_html(const GapProgress& progress) {
  std::string out = html_head("Simulator against recordings");
  out += fmt::format("<p class=\"say\">{}</p>", html_escaped(progress.brief()));
  if (!progress.bundles.empty()) {
    out += figure("All recordings, after each adoption", steps_chart(progress));
    out += figure("Each recording", bundles_chart(progress));
    out += sums_table(progress) + effects_table(progress) + bundles_table(progress);
  }
  for (const std::string& loss : progress.losses) {
    out += fmt::format("<p>Left out: {}</p>", html_escaped(loss));
  }
  return out.append(kHtmlEnd);
}

}  // namespace sixpoint::gap

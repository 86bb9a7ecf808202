// The page of impact_html(): plain HTML with a drawing in SVG, no script, nothing to load.
#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/text/html.h"
#include "base/text/svg.h"
#include "repair/impact/impact.h"

namespace sixpoint::repair {
namespace {

constexpr double kWidth = 900;
constexpr double kHeight = 260;
constexpr double kLeft = 60;
constexpr std::size_t kCurvePoints = 600;
constexpr std::array<const char*, 2> kColours = {"#d1495b", "#1b6ca8"};

struct Means {
  std::vector<double> sum = std::vector<double>(kCurvePoints);
  std::vector<double> number = std::vector<double>(kCurvePoints);
};

// Mean ENMO of each column of the time.
Means means_of(const EpochSeries& series, double from, double to) {
  Means means;
  for (const Epoch& epoch : series.epochs) {
    const double share = (epoch.unix_time - from) / (to - from);
    const auto column = std::min(kCurvePoints - 1, static_cast<std::size_t>(share * kCurvePoints));
    means.sum[column] += epoch.enmo_mg;
    means.number[column] += 1;
  }
  return means;
}

std::string drawing(const std::vector<const EpochSeries*>& all) {
  double from = 1e18;
  double to = 0;
  for (const EpochSeries* series : all) {
    from = std::min<double>(from, series->epochs.front().unix_time);
    to = std::max<double>(to,
                          static_cast<double>(series->epochs.back().unix_time) + series->epoch_s);
  }
  std::vector<Means> means;
  double highest = 1;
  for (const EpochSeries* series : all) {
    means.push_back(means_of(*series, from, to));
    for (std::size_t i = 0; i < kCurvePoints; ++i) {
      if (means.back().number[i] > 0) {
        highest = std::max(highest, means.back().sum[i] / means.back().number[i]);
      }
    }
  }
  const SvgScale across{0, (to - from) / 3600, kLeft, kWidth - 10};
  const SvgScale up{0, highest, kHeight - 40, 10};
  Svg svg;
  for (const double tick : round_ticks(0, highest)) {
    svg.line(kLeft, up(tick), kWidth - 10, up(tick), "stroke=\"#ddd\"");
    svg.text(kLeft - 5, up(tick) + 4, fmt::format("{:g}", tick), "text-anchor=\"end\"");
  }
  for (const double tick : round_ticks(0, across.high)) {
    svg.text(across(tick), kHeight - 24, fmt::format("{:g}", tick), "text-anchor=\"middle\"");
  }
  svg.text(kWidth / 2, kHeight - 6, "hours since the first sample", "text-anchor=\"middle\"");
  svg.text_upward(12, kHeight / 2, "ENMO in mg");
  for (std::size_t which = 0; which < all.size(); ++which) {
    std::vector<std::pair<double, double>> line;
    for (std::size_t i = 0; i < kCurvePoints; ++i) {
      if (means[which].number[i] > 0) {
        const double hour = across.high * (static_cast<double>(i) + 0.5) / kCurvePoints;
        line.emplace_back(across(hour), up(means[which].sum[i] / means[which].number[i]));
      }
    }
    svg.polyline(line,
                 fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"", kColours[which]));
  }
  return fmt::format("<svg viewBox=\"0 0 {} {}\" width=\"{}\" role=\"img\">{}</svg>\n", kWidth,
                     kHeight, kWidth, svg.marks());
}

}  // namespace

std::string impact_html(const Impact& impact) {
  std::vector<const EpochSeries*> all;
  std::string names;
  for (const auto* series : {&impact.before, &impact.after}) {
    if (*series && !(*series)->epochs.empty()) {
      names += fmt::format("<p style=\"color:{}\">{}: {}</p>\n", kColours[all.size()],
                           series == &impact.before ? "before" : "after",
                           html_escaped(printable((*series)->path, 400)));
      all.push_back(&**series);
    }
  }
  std::string page = html_head("Impact of a repair", "svg{background:#fafafa}");
  page += fmt::format("{}<pre>{}</pre>\n<h2>ENMO over the time</h2>\n{}", names,
                      html_escaped(impact.brief()), all.empty() ? std::string() : drawing(all));
  return page.append(kHtmlEnd);
}

}  // namespace sixpoint::repair

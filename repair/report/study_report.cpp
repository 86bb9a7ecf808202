#include "repair/report/study_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text/html.h"
#include "base/text/svg.h"
#include "gt3x/recording.h"
#include "repair/impact/epochs.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {
namespace {

constexpr double kWidth = 420;
constexpr double kHeight = 90;
constexpr double kLeft = 36;
constexpr std::size_t kColumns = 160;
constexpr double kWidestBar_mg = 300;
constexpr const char* kBefore = "#d1495b";
constexpr const char* kAfter = "#1b6ca8";

std::string escaped(const std::string& text) { return html_escaped(printable(text, 600)); }

std::string row_of(const std::vector<std::string>& cells) {
  return fmt::format("<tr><td>{}</td></tr>\n", fmt::join(cells, "</td><td>"));
}

std::string table_of(const std::string& head, const std::string& rows) {
  return fmt::format("<table><thead><tr><th>{}</th></tr></thead><tbody>\n{}</tbody></table>\n",
                     head, rows);
}

std::string left_out(std::size_t all, std::size_t shown) {
  return all > shown ? fmt::format(
                           "<p>... and {} more: see manifest.csv and units.csv in the "
                           "output folder.</p>\n",
                           all - shown)
                     : "";
}

std::string mg(const std::optional<double>& value) {
  return value ? fmt::format("{:.1f}", *value) : "-";
}

// Still error before and after, as two bars.
std::string bars(const RepairReport& report) {
  Svg svg;
  const SvgScale across{0, kWidestBar_mg, 0, 120};
  const auto bar = [&](const std::optional<double>& value, double top, const char* colour) {
    if (value) {
      svg.rect(0, top, std::max(1.0, across(std::min(*value, kWidestBar_mg))), 6,
               fmt::format("fill=\"{}\"", colour));
    }
  };
  bar(report.still_error_before_mg, 0, kBefore);
  bar(report.still_error_after_mg, 8, kAfter);
  return fmt::format("<svg viewBox=\"0 0 120 14\" width=\"120\" height=\"14\">{}</svg>",
                     svg.marks());
}

// Mean ENMO of each column of the time from `from` to `to`; NaN where there is none.
std::vector<double> columns_of(const EpochSeries& series, double from, double to) {
  std::vector<double> sum(kColumns);
  std::vector<double> number(kColumns);
  for (const Epoch& epoch : series.epochs) {
    const double share = std::clamp((epoch.unix_time - from) / std::max(1.0, to - from), 0.0, 1.0);
    const auto column = std::min(kColumns - 1, static_cast<std::size_t>(share * kColumns));
    sum[column] += epoch.enmo_mg;
    number[column] += 1;
  }
  for (std::size_t i = 0; i < kColumns; ++i) {
    sum[i] = number[i] > 0 ? sum[i] / number[i] : std::numeric_limits<double>::quiet_NaN();
  }
  return sum;
}

std::optional<EpochSeries> series_of(FileSystem& files, const std::string& path) {
  auto recording = gt3x::Recording::open(files, path);
  if (!recording) {
    return std::nullopt;
  }
  auto series = epochs_of(*recording, {});
  return series && !series->epochs.empty() ? std::optional(*std::move(series)) : std::nullopt;
}

double highest_of(const std::vector<double>& values) {
  double highest = 1;
  for (const double value : values) {
    highest = std::isnan(value) ? highest : std::max(highest, value);
  }
  return highest;
}

void draw(Svg& svg, const std::vector<double>& values, const SvgScale& across, const SvgScale& up,
          const char* colour) {
  std::vector<std::pair<double, double>> line;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isnan(values[i])) {
      line.emplace_back(across(static_cast<double>(i) + 0.5), up(values[i]));
    }
  }
  svg.polyline(line, fmt::format("fill=\"none\" stroke=\"{}\"", colour));
}

bool is_affected(const RepairReport& report) {
  return report.verdict == to_string(Verdict::affected);
}

}  // namespace

void StudyReport::add(const RepairReport& report) {
  table_.add(report);
  reports_.push_back(report);
}

std::vector<const RepairReport*> StudyReport::worst_first() const {
  std::vector<const RepairReport*> worst;
  for (const RepairReport& report : reports_) {
    if (is_affected(report)) {
      worst.push_back(&report);
    }
  }
  std::ranges::stable_sort(worst, [](const RepairReport* a, const RepairReport* b) {
    return a->still_error_before_mg.value_or(-1) > b->still_error_before_mg.value_or(-1);
  });
  return worst;
}

void StudyReport::add_thumbnails(FileSystem& files) {
  for (const RepairReport* report : worst_first()) {
    if (curves_.size() == limits_.thumbnails) {
      return;
    }
    if (report->output.empty()) {
      continue;
    }
    const auto before = series_of(files, report->input);
    const auto after = before ? series_of(files, report->output) : std::nullopt;
    if (!after) {
      continue;
    }
    const double from = before->epochs.front().unix_time;
    const double to = static_cast<double>(before->epochs.back().unix_time) + before->epoch_s;
    curves_[report->input] = {columns_of(*before, from, to), columns_of(*after, from, to),
                              (to - from) / 3600};
  }
}

std::string StudyReport::totals() const {
  std::map<RepairStatus, std::size_t> counts;
  std::size_t affected = 0;
  std::size_t linked = 0;
  std::uint64_t samples = 0;
  std::uint64_t clipped_before = 0;
  std::uint64_t clipped_after = 0;
  for (const RepairReport& report : reports_) {
    ++counts[report.status];
    affected += is_affected(report) ? 1 : 0;
    linked += report.linked.empty() ? 0 : 1;
    samples += report.samples;
    clipped_before += report.clipped_before;
    clipped_after += report.clipped_after;
  }
  std::string rows = row_of({"files", std::to_string(reports_.size())}) +
                     row_of({"affected by 16CPAN03", std::to_string(affected)});
  for (const auto& [status, count] : counts) {
    std::string name(to_string(status));
    std::ranges::replace(name, '_', ' ');
    rows += row_of({name, std::to_string(count)});
  }
  if (linked > 0) {
    rows += row_of({"linked as they are", std::to_string(linked)});
  }
  rows += row_of({"samples", std::to_string(samples)});
  rows += row_of({"clipped samples, before", std::to_string(clipped_before)});
  rows += row_of({"clipped samples, after", std::to_string(clipped_after)});
  return "<h2>Totals</h2>\n" + table_of("</th><th>", rows);
}

std::string StudyReport::units() const {
  const auto all = table_.rows();
  const std::size_t shown = std::min(all.size(), limits_.units);
  std::string rows;
  for (std::size_t i = 0; i < shown; ++i) {
    const UnitNeeds& unit = all[i];
    rows += row_of({escaped(unit.serial.empty() ? "(not said)" : unit.serial),
                    std::to_string(unit.files), std::to_string(unit.affected),
                    std::to_string(unit.repaired), std::to_string(unit.waiting),
                    fmt::format("{}", fmt::join(unit.sides_covered, " ")),
                    unit.help.empty() ? "-" : escaped(unit.help)});
  }
  return "<h2>Units</h2>\n" +
         table_of(
             "unit</th><th>files</th><th>affected</th><th>repaired</th><th>waiting</th><th>sides "
             "covered</th><th>what would help",
             rows) +
         left_out(all.size(), shown);
}

std::string StudyReport::not_done() const {
  std::string rows;
  std::size_t all = 0;
  for (const RepairReport& report : reports_) {
    const bool done = report.status == RepairStatus::repaired ||
                      report.status == RepairStatus::not_affected ||
                      report.status == RepairStatus::already_repaired;
    if (done || all++ >= limits_.not_done) {
      continue;
    }
    std::string reasons;
    for (const std::string& reason : report.reasons) {
      reasons += "<li>" + escaped(reason) + "</li>";
    }
    rows += row_of({escaped(report.input), escaped(std::string(to_string(report.status))),
                    "<ul>" + reasons + "</ul>"});
  }
  if (all == 0) {
    return "<h2>What could not be done</h2>\n<p>Nothing is left over.</p>\n";
  }
  return "<h2>What could not be done</h2>\n" +
         table_of("file</th><th>status</th><th>reasons", rows) +
         left_out(all, std::min(all, limits_.not_done));
}

std::string StudyReport::files() const {
  const auto worst = worst_first();
  const std::size_t shown = std::min(worst.size(), limits_.files);
  std::string rows;
  for (std::size_t i = 0; i < shown; ++i) {
    const RepairReport& report = *worst[i];
    rows += row_of({escaped(report.input), escaped(report.serial),
                    std::string(to_string(report.status)), mg(report.still_error_before_mg),
                    mg(report.still_error_after_mg), bars(report),
                    fmt::format("{} / {}", report.clipped_before, report.clipped_after),
                    report.source ? escaped(report.source->brief()) : "-"});
  }
  return "<h2>Affected files, the worst first</h2>\n" +
         table_of(
             "file</th><th>unit</th><th>status</th><th>still error before, mg</th><th>after, "
             "mg</th><th></th><th>clipped before / after</th><th>constants",
             rows) +
         left_out(worst.size(), shown);
}

std::string StudyReport::thumbnails() const {
  std::string out;
  for (const RepairReport* report : worst_first()) {
    const auto found = curves_.find(report->input);
    if (found == curves_.end()) {
      continue;
    }
    const Curves& curves = found->second;
    const double highest = std::max(highest_of(curves.before_mg), highest_of(curves.after_mg));
    const SvgScale across{0, kColumns, kLeft, kWidth - 4};
    const SvgScale up{0, highest, kHeight - 16, 6};
    Svg svg;
    svg.line(kLeft, up(0), kWidth - 4, up(0), "stroke=\"#bbb\"");
    svg.text(kLeft - 4, up(highest) + 6, fmt::format("{:.0f}", highest), "text-anchor=\"end\"");
    svg.text(kWidth - 4, kHeight - 3, fmt::format("{:.1f} h", curves.hours), "text-anchor=\"end\"");
    draw(svg, curves.before_mg, across, up, kBefore);
    draw(svg, curves.after_mg, across, up, kAfter);
    out += fmt::format(
        "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 {} {}\" width=\"{}\" "
        "role=\"img\">{}</svg></figure>\n",
        escaped(report->input), kWidth, kHeight, kWidth, svg.marks());
  }
  return out.empty() ? out
                     : fmt::format(
                           "<h2>ENMO in mg, <span style=\"color:{}\">before</span> and "
                           "<span style=\"color:{}\">after</span></h2>\n{}",
                           kBefore, kAfter, out);
}

std::string StudyReport::constants() const {
  std::map<std::pair<std::string, std::string>, std::size_t> used;
  for (const RepairReport& report : reports_) {
    if (report.source && report.status == RepairStatus::repaired) {
      ++used[{report.serial, report.source->brief()}];
    }
  }
  std::string rows;
  for (const auto& [key, files] : used) {
    rows += row_of({escaped(key.first), escaped(key.second), std::to_string(files)});
  }
  return "<h2>Constants used</h2>\n" + (rows.empty() ? std::string("<p>None.</p>\n")
                                                     : table_of("unit</th><th>source (made, "
                                                                "standard uncertainty at 1 "
                                                                "g)</th><th>files",
                                                                rows));
}

std::string StudyReport::html(const StudyPage& page) const {
  std::string out = html_head(
      page.title,
      "body{max-width:1100px}ul{margin:0;padding-left:1em}figure{display:inline-block;margin:4px}"
      "figcaption{font-size:11px;font-weight:400;max-width:420px;overflow-wrap:anywhere}");
  out += fmt::format("<p>{}, {}</p>\n", escaped(page.made_at), escaped(page.software));
  out += totals() + units() + not_done() + files() + thumbnails() + constants();
  return out.append(kHtmlEnd);
}

}  // namespace sixpoint::repair

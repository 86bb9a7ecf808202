#include "repair/impact/impact.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

// In the order of Measure.
constexpr std::array<std::string_view, 6> kNames = {"enmo_mg",  "mad_mg",   "counts_x",
                                                    "counts_y", "counts_z", "counts_vm"};

bool of_counts(Measure measure) {
  return measure != Measure::enmo_mg && measure != Measure::mad_mg;
}

double propagated_mg(const PerAxis<double>& per_error, const PerAxis<double>& uncertainty_mg) {
  double square = 0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    square += std::pow(per_error[a] * uncertainty_mg[a], 2);
  }
  return std::sqrt(square);
}

// Of one epoch; nothing for counts.
std::optional<double> uncertainty_of(const Epoch& epoch, Measure measure,
                                     const std::optional<PerAxis<double>>& uncertainty_mg) {
  if (!uncertainty_mg || of_counts(measure)) {
    return std::nullopt;
  }
  return propagated_mg(measure == Measure::enmo_mg ? epoch.enmo_per_error : epoch.mad_per_error,
                       *uncertainty_mg);
}

Minutes minutes_above(const EpochSeries& series, const CutPoint& cut,
                      const std::optional<PerAxis<double>>& uncertainty_mg) {
  const double epoch_minutes = series.epoch_s / 60.0;
  Minutes minutes;
  if (uncertainty_mg && !of_counts(cut.measure)) {
    minutes.least = 0;
    minutes.most = 0;
  }
  for (const Epoch& epoch : series.epochs) {
    const double value = value_of(epoch, cut.measure);
    minutes.above += value > cut.value ? epoch_minutes : 0;
    if (const auto uncertainty = uncertainty_of(epoch, cut.measure, uncertainty_mg)) {
      *minutes.least += value - 2 * *uncertainty > cut.value ? epoch_minutes : 0;
      *minutes.most += value + 2 * *uncertainty > cut.value ? epoch_minutes : 0;
    }
  }
  return minutes;
}

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

// {before, after} of what `value` finds in a summary; null where there is none.
template <class Value>
Json pair_of(const std::optional<ImpactSummary>& before, const std::optional<ImpactSummary>& after,
             const Value& value) {
  return {{"before", before ? number(value(*before)) : Json(nullptr)},
          {"after", after ? number(value(*after)) : Json(nullptr)}};
}

// One row of the table: a name, and the value of each recording.
std::string row(std::string_view name, const std::vector<std::string>& values) {
  std::string text = fmt::format("{:<36}", name);
  for (const std::string& value : values) {
    text += fmt::format("  {:>24}", value);
  }
  return text + "\n";
}

std::string with_uncertainty(double value, const std::optional<double>& uncertainty) {
  return uncertainty ? fmt::format("{:.2f} (+- {:.2f})", value, *uncertainty)
                     : fmt::format("{:.2f}", value);
}

std::string in_words(const Minutes& minutes) {
  return minutes.least ? fmt::format("{:.1f} ({:.1f} to {:.1f})", minutes.above, *minutes.least,
                                     *minutes.most)
                       : fmt::format("{:.1f}", minutes.above);
}

}  // namespace

std::string_view to_string(Measure measure) { return kNames[static_cast<std::size_t>(measure)]; }

double value_of(const Epoch& epoch, Measure measure) {
  switch (measure) {
    case Measure::enmo_mg:
      return epoch.enmo_mg;
    case Measure::mad_mg:
      return epoch.mad_mg;
    case Measure::counts_x:
      return epoch.counts[0];
    case Measure::counts_y:
      return epoch.counts[1];
    case Measure::counts_z:
      return epoch.counts[2];
    case Measure::counts_vm:
      return std::hypot(epoch.counts[0], epoch.counts[1], epoch.counts[2]);
  }
  return 0;
}

Result<CutPoint> parse_cut_point(std::string_view text) {
  const auto refused = [&] {
    return fail(
        ErrorCode::usage, fmt::format("'{}' is no cut point", printable(text, 40)), "--cut",
        fmt::format("write NAME=MG for ENMO, such as moderate=100, or NAME=MEASURE:VALUE, such "
                    "as moderate=counts_vm:200, with one of {}",
                    fmt::join(kNames, ", ")));
  };
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    return refused();
  }
  CutPoint cut;
  cut.name = text.substr(0, equals);
  std::string_view digits = text.substr(equals + 1);
  if (const std::size_t colon = digits.find(':'); colon != std::string_view::npos) {
    const auto measure = std::ranges::find(kNames, digits.substr(0, colon));
    if (measure == kNames.end()) {
      return refused();
    }
    cut.measure = static_cast<Measure>(measure - kNames.begin());
    digits.remove_prefix(colon + 1);
  }
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), cut.value);
  if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(cut.value) ||
      cut.value < 0) {
    return refused();
  }
  return cut;
}

ImpactSummary summary_of(const EpochSeries& series,
                         const std::optional<PerAxis<double>>& uncertainty_mg,
                         std::span<const CutPoint> cuts) {
  ImpactSummary summary;
  summary.epochs = series.epochs.size();
  if (series.epochs.empty()) {
    return summary;
  }
  const auto count = static_cast<double>(series.epochs.size());
  PerAxis<double> enmo_per_error{};
  PerAxis<double> mad_per_error{};
  PerAxis<double> counts{};
  for (const Epoch& epoch : series.epochs) {
    summary.recorded_minutes += epoch.samples / series.rate_hz / 60;
    summary.enmo_mg += epoch.enmo_mg / count;
    summary.mad_mg += epoch.mad_mg / count;
    for (std::size_t a = 0; a < kAxes; ++a) {
      enmo_per_error[a] += epoch.enmo_per_error[a] / count;
      mad_per_error[a] += epoch.mad_per_error[a] / count;
      counts[a] += epoch.counts[a] / count * 60 / series.epoch_s;
    }
  }
  if (series.has_counts) {
    summary.counts_per_minute = counts;
  }
  if (uncertainty_mg) {
    summary.enmo_uncertainty_mg = propagated_mg(enmo_per_error, *uncertainty_mg);
    summary.mad_uncertainty_mg = propagated_mg(mad_per_error, *uncertainty_mg);
  }
  for (const CutPoint& cut : cuts) {
    summary.minutes.push_back(minutes_above(series, cut, uncertainty_mg));
  }
  return summary;
}

Status check(const Impact& impact) {
  for (const auto& series : {impact.before, impact.after}) {
    if (series && !series->has_counts && std::ranges::any_of(impact.cuts, [](const CutPoint& cut) {
          return of_counts(cut.measure);
        })) {
      return fail(ErrorCode::usage,
                  fmt::format("there are no counts at {} Hz: they are defined from 30 to 100 Hz in "
                              "steps of 10",
                              series->rate_hz),
                  series->path, "give cut points in enmo_mg or mad_mg");
    }
  }
  if (!impact.before || !impact.after) {
    return {};
  }
  const auto& before = impact.before->epochs;
  const auto& after = impact.after->epochs;
  const bool shared = std::ranges::any_of(before, [&](const Epoch& epoch) {
    const auto found =
        std::ranges::lower_bound(after, epoch.unix_time, std::less<>(), &Epoch::unix_time);
    return found != after.end() && found->unix_time == epoch.unix_time;
  });
  if (!shared || impact.before->epoch_s != impact.after->epoch_s) {
    return fail(ErrorCode::bad_data, "the two recordings have no epoch in common",
                impact.before->path + ", " + impact.after->path,
                "give a recording and its repaired copy");
  }
  return {};
}

std::string Impact::brief() const {
  std::vector<std::string> names;
  std::vector<ImpactSummary> columns;
  if (before) {
    names.emplace_back(after ? "before" : "");
    columns.push_back(summary_of(*before, std::nullopt, cuts));
  }
  if (after) {
    names.emplace_back("after");
    columns.push_back(summary_of(*after, after_uncertainty_mg, cuts));
  }
  const auto each = [&](const auto& text_of) {
    std::vector<std::string> values;
    std::ranges::transform(columns, std::back_inserter(values), text_of);
    return values;
  };
  std::string text = after ? row("", names) : "";
  text += row("epochs", each([](const ImpactSummary& s) { return fmt::format("{}", s.epochs); }));
  text +=
      row("recorded minutes",
          each([](const ImpactSummary& s) { return fmt::format("{:.1f}", s.recorded_minutes); }));
  text += row("ENMO, mean, mg", each([](const ImpactSummary& s) {
                return with_uncertainty(s.enmo_mg, s.enmo_uncertainty_mg);
              }));
  text += row("MAD, mean, mg", each([](const ImpactSummary& s) {
                return with_uncertainty(s.mad_mg, s.mad_uncertainty_mg);
              }));
  text += row("counts/min, X Y Z", each([](const ImpactSummary& s) {
                return s.counts_per_minute
                           ? fmt::format("{:.0f} {:.0f} {:.0f}", (*s.counts_per_minute)[0],
                                         (*s.counts_per_minute)[1], (*s.counts_per_minute)[2])
                           : std::string("not at this rate");
              }));
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    text += row(fmt::format("minutes {} > {:g}, {}", to_string(cuts[i].measure), cuts[i].value,
                            printable(cuts[i].name, 40)),
                each([&](const ImpactSummary& s) { return in_words(s.minutes[i]); }));
  }
  return text;
}

Json Impact::to_json() const {
  std::optional<ImpactSummary> was;
  std::optional<ImpactSummary> is;
  if (before) {
    was = summary_of(*before, std::nullopt, cuts);
  }
  if (after) {
    is = summary_of(*after, after_uncertainty_mg, cuts);
  }
  const auto pair = [&](const auto& value) { return pair_of(was, is, value); };
  const EpochSeries* any = before ? &*before : after ? &*after : nullptr;
  Json json = {
      {"files",
       {{"before", before ? Json(printable(before->path, 4096)) : Json(nullptr)},
        {"after", after ? Json(printable(after->path, 4096)) : Json(nullptr)}}},
      {"epoch_s", any != nullptr ? any->epoch_s : 0},
      {"epochs", any != nullptr ? any->epochs.size() : 0},
      {"recorded_minutes",
       pair([](const ImpactSummary& s) { return std::optional(s.recorded_minutes); })},
      {"enmo_mg", pair([](const ImpactSummary& s) { return std::optional(s.enmo_mg); })},
      {"enmo_uncertainty_mg", pair([](const ImpactSummary& s) { return s.enmo_uncertainty_mg; })},
      {"mad_mg", pair([](const ImpactSummary& s) { return std::optional(s.mad_mg); })},
      {"mad_uncertainty_mg", pair([](const ImpactSummary& s) { return s.mad_uncertainty_mg; })}};
  Json& counts = json["counts"] = Json::object();
  for (std::size_t a = 0; a < kAxes; ++a) {
    counts[std::string(1, "xyz"[a])] = pair([a](const ImpactSummary& s) {
      return s.counts_per_minute ? std::optional((*s.counts_per_minute)[a]) : std::nullopt;
    });
  }
  Json& minutes = json["minutes_above"] = Json::object();
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    Json cut = pair([i](const ImpactSummary& s) { return std::optional(s.minutes[i].above); });
    cut["measure"] = to_string(cuts[i].measure);
    cut["value"] = cuts[i].value;
    cut["after_least"] = is ? number(is->minutes[i].least) : Json(nullptr);
    cut["after_most"] = is ? number(is->minutes[i].most) : Json(nullptr);
    minutes[printable(cuts[i].name, 200)] = std::move(cut);
  }
  return json;
}

}  // namespace sixpoint::repair

#include "station/records/gap_trends.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "base/random.h"
#include "base/text/csv_columns.h"
#include "device/jig.h"
#include "station/statistics/distributions.h"

namespace sixpoint::station {

namespace {

double square(const SkewPattern& pattern) {
  double sum = 0;
  for (const double x : pattern) {
    sum += x * x;
  }
  return sum;
}

double rms(const SkewPattern& pattern) {
  return std::sqrt(square(pattern) / static_cast<double>(pattern.size()));
}

SkewPattern difference(SkewPattern a, const SkewPattern& b) {
  for (std::size_t k = 0; k < a.size(); ++k) {
    a[k] -= b[k];
  }
  return a;
}

SkewPattern mean_of(const std::vector<SkewPattern>& all, const std::vector<int>& signs) {
  SkewPattern mean{};
  for (std::size_t u = 0; u < all.size(); ++u) {
    for (std::size_t k = 0; k < mean.size(); ++k) {
      mean[k] += signs[u] * all[u][k] / static_cast<double>(all.size());
    }
  }
  return mean;
}

SkewPattern mean_of(const std::vector<SkewPattern>& all) {
  return mean_of(all, std::vector<int>(all.size(), 1));
}

// The randomisation test of the header.
double chance_of(const std::vector<SkewPattern>& units, std::size_t sign_patterns) {
  std::vector<int> signs(units.size(), 1);
  const double found = square(mean_of(units, signs));
  Random random(7, 0x666C6970);
  std::size_t as_long = 1;
  for (std::size_t i = 0; i < sign_patterns; ++i) {
    for (int& sign : signs) {
      sign = random.uniform() < 0.5 ? -1 : 1;
    }
    as_long += square(mean_of(units, signs)) >= found * (1 - 1e-12) ? 1 : 0;
  }
  return static_cast<double>(as_long) / static_cast<double>(sign_patterns + 1);
}

// Names in the order in which they were met.
class Numbers {
 public:
  std::size_t of(const std::string& name) {
    const auto [at, is_new] = number_.emplace(name, names_.size());
    if (is_new) {
      names_.push_back(name);
    }
    return at->second;
  }
  const std::vector<std::string>& names() const { return names_; }
  std::size_t size() const { return names_.size(); }

 private:
  std::map<std::string, std::size_t> number_;
  std::vector<std::string> names_;
};

// The runs that can be used, and who is behind their numbers.
struct Bench {
  std::vector<ModelRun> runs;
  std::vector<std::string> ids;  // of the runs
  Numbers units, units_and_filters, filters, jigs, stations, lots;
  std::vector<std::pair<std::string, std::string>> serial_and_filter;  // of units_and_filters

  ModelSizes sizes() const {
    return {units.size(), units_and_filters.size(), filters.size(),
            jigs.size(),  stations.size(),          lots.size()};
  }
};

void add_run(const StoredRun& run, RunReadings readings, const LotOfSerial& lots, Bench& bench) {
  ModelRun out;
  out.unit = bench.units.of(run.serial);
  out.unit_and_filter = bench.units_and_filters.of(run.serial + '\n' + readings.filter);
  if (out.unit_and_filter == bench.serial_and_filter.size()) {
    bench.serial_and_filter.emplace_back(run.serial, readings.filter);
  }
  out.filter = bench.filters.of(readings.filter);
  out.jig = bench.jigs.of(run.jig);
  out.station = bench.stations.of(run.station);
  if (const auto lot = lots.find(run.serial); lot != lots.end()) {
    out.lot = bench.lots.of(lot->second);
  }
  out.readings = std::move(readings);
  bench.runs.push_back(std::move(out));
  bench.ids.push_back(run.id);
}

// The mean lean of two opposite faces: by axis, towards the first and the second other axis.
std::array<double, 6> even_leans(const RunReadings& readings) {
  std::array<double, 6> out{};
  for (std::size_t f = 0; f < device::kPoses.size(); ++f) {
    for (std::size_t k = 0; k < 2; ++k) {
      out[2 * device::axis_of(device::kPoses[f]) + k] += readings.skew_deg[2 * f + k] / 2;
    }
  }
  return out;
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct UsableRun {
  const StoredRun* run = nullptr;
  RunReadings readings;
};

// Takes the runs with a badly seated face out.
std::vector<BadlySeated> set_aside(std::vector<UsableRun>& runs, const TrendOptions& options) {
  constexpr std::size_t kFewest = 3;  // of two nobody can say which one is odd
  std::map<std::string, std::vector<std::size_t>> runs_of_jig;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    runs_of_jig[runs[r].run->jig].push_back(r);
  }
  std::map<std::size_t, BadlySeated> odd;
  for (const auto& [jig, numbers] : runs_of_jig) {
    for (std::size_t k = 0; numbers.size() >= kFewest && k < 6; ++k) {
      std::vector<double> leans;
      for (const std::size_t r : numbers) {
        leans.push_back(even_leans(runs[r].readings)[k]);
      }
      const double usual = median_of(leans);
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        const double lean = leans[i] - usual;
        const StoredRun& run = *runs[numbers[i]].run;
        const auto before = odd.find(numbers[i]);
        if (std::abs(lean) >= options.badly_seated_deg &&
            (before == odd.end() || std::abs(lean) > std::abs(before->second.lean_deg))) {
          odd[numbers[i]] = {run.id, run.serial, run.jig, k / 2, lean};
        }
      }
    }
  }
  std::vector<BadlySeated> out;
  std::vector<UsableRun> kept;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (const auto found = odd.find(r); found != odd.end()) {
      out.push_back(found->second);
    } else {
      kept.push_back(std::move(runs[r]));
    }
  }
  runs = std::move(kept);
  return out;
}

std::vector<std::string> names_of(const std::vector<Rival>& rivals, const Bench& bench) {
  std::vector<std::string> out;
  out.reserve(rivals.size());
  for (const Rival& rival : rivals) {
    out.push_back(rival.level == SharedLevel::jig ? "jig " + bench.jigs.names()[rival.index]
                  : rival.level == SharedLevel::station
                      ? "station " + bench.stations.names()[rival.index]
                      : "lot " + bench.lots.names()[rival.index]);
  }
  return out;
}

// What the runs say without a model: how many, what they share, and the chance of it.
void describe(const Bench& bench, std::size_t number, const TrendOptions& options,
              JigTrend& trend) {
  std::map<std::size_t, std::vector<SkewPattern>> by_unit;
  for (const ModelRun& run : bench.runs) {
    if (run.jig == number) {
      by_unit[run.unit].push_back(run.readings.skew_deg);
    }
  }
  std::vector<SkewPattern> units;
  for (const auto& [unit, patterns] : by_unit) {
    trend.runs += patterns.size();
    units.push_back(mean_of(patterns));
  }
  trend.units = units.size();
  trend.pattern_deg = mean_of(units);
  trend.common_deg = rms(trend.pattern_deg);
  double own = 0;
  for (const SkewPattern& unit : units) {
    own += square(difference(unit, trend.pattern_deg)) / static_cast<double>(unit.size());
  }
  trend.units_deg = units.size() > 1 ? std::sqrt(own / static_cast<double>(units.size() - 1)) : 0;
  trend.has_chance = units.size() >= options.fewest_units_of_check;
  if (trend.has_chance) {
    trend.chance = chance_of(units, options.sign_patterns);
  }
}

// How each face of each jig repeats, against all others together.
std::vector<std::array<FaceRepeats, 6>> repeats_of(const Bench& bench) {
  std::vector<std::array<FaceRepeats, 6>> out(bench.jigs.size());
  for (const ModelRun& run : bench.runs) {
    for (std::size_t f = 0; f < run.readings.repeats.size(); ++f) {
      out[run.jig][f].square_deg2 += run.readings.repeats[f].square_deg2;
      out[run.jig][f].degrees_of_freedom += run.readings.repeats[f].degrees_of_freedom;
    }
  }
  return out;
}

void judge_repeats(const std::vector<std::array<FaceRepeats, 6>>& all, std::size_t jig,
                   const TrendOptions& options, std::array<FaceTrend, 6>& faces) {
  FaceRepeats sum;
  for (const auto& each : all) {
    for (const FaceRepeats& face : each) {
      sum.square_deg2 += face.square_deg2;
      sum.degrees_of_freedom += face.degrees_of_freedom;
    }
  }
  const double tests = 6 * static_cast<double>(all.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const FaceRepeats& own = all[jig][f];
    const double other_square = sum.square_deg2 - own.square_deg2;
    const double other_freedom = sum.degrees_of_freedom - own.degrees_of_freedom;
    if (!(own.degrees_of_freedom > 0)) {
      continue;
    }
    const double variance = own.square_deg2 / own.degrees_of_freedom;
    faces[f].scatter_deg = std::sqrt(variance);
    if (other_freedom > 0 && other_square > 0) {
      faces[f].scatter_chance =
          std::min(1.0, tests * f_upper_tail(variance / (other_square / other_freedom),
                                             own.degrees_of_freedom, other_freedom));
    }
    faces[f].does_not_repeat =
        faces[f].scatter_chance < options.alarm_chance && faces[f].scatter_deg >= options.least_deg;
  }
}

SharedTrend shared_trend(const ElementFinding& finding, double least, std::size_t units,
                         const Bench& bench, const TrendOptions& options) {
  SharedTrend out;
  out.probability = finding.probability;
  out.size = finding.size;
  out.standard_uncertainty = finding.standard_uncertainty;
  out.axis = finding.axis;
  out.value = finding.value;
  out.is_named = units >= options.fewest_units &&
                 bench.units.size() >= options.fewest_units_in_store &&
                 is_named(finding.probability, finding.size, least, options);
  out.not_told_apart_from = names_of(finding.rivals, bench);
  return out;
}

using FindingsOf = std::vector<ElementFinding> QuantityFindings::*;

template <class NumberOfRun>
std::vector<GroupTrend> group_trends(const Bench& bench, const SharedEffects& effects,
                                     const std::vector<std::string>& names, FindingsOf findings,
                                     NumberOfRun number_of, const TrendOptions& options) {
  std::vector<GroupTrend> out(names.size());
  std::vector<std::set<std::size_t>> units(names.size());
  std::vector<std::set<std::size_t>> jigs(names.size());
  for (const ModelRun& run : bench.runs) {
    if (const std::optional<std::size_t> number = number_of(run)) {
      ++out[*number].runs;
      units[*number].insert(run.unit);
      jigs[*number].insert(run.jig);
    }
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    out[i].name = names[i];
    out[i].units = units[i].size();
    out[i].jigs = jigs[i].size();
    const auto trend = [&](const QuantityFindings& quantity, double least) {
      return shared_trend((quantity.*findings)[i], least, out[i].units, bench, options);
    };
    out[i].skew = trend(effects.skew, options.least_deg);
    out[i].zero = trend(effects.zero, options.least_zero_mg);
    out[i].sensitivity = trend(effects.sensitivity, options.least_sensitivity_percent);
  }
  return out;
}

// Whether a lot says what this jig says (`is_blamed`), or would say.
bool lot_explains(const SharedEffects& effects, const GapTrends& trends, std::size_t jig,
                  bool is_blamed) {
  for (const Rival& rival : effects.skew.jigs[jig].rivals) {
    if (is_blamed && rival.level == SharedLevel::lot) {
      return true;
    }
  }
  for (std::size_t lot = 0; lot < trends.lots.size(); ++lot) {
    for (const Rival& rival : effects.skew.lots[lot].rivals) {
      if (trends.lots[lot].skew.is_named && rival.level == SharedLevel::jig && rival.index == jig) {
        return true;
      }
    }
  }
  return false;
}

JigTrend trend_of(const Bench& bench, const SharedEffects& effects, const GapTrends& trends,
                  const std::vector<std::array<FaceRepeats, 6>>& repeats, std::size_t number,
                  const TrendOptions& options) {
  const ElementFinding& finding = effects.skew.jigs[number];
  JigTrend out;
  out.jig = bench.jigs.names()[number];
  describe(bench, number, options, out);
  out.probability = finding.probability;
  out.tilt_probability = finding.tilt_probability;
  out.tilt_deg = finding.size;
  out.standard_uncertainty_deg = finding.standard_uncertainty;
  std::copy(finding.value.begin(), finding.value.end(), out.tilt_pattern_deg.begin());
  out.not_told_apart_from = names_of(finding.rivals, bench);

  CauseEvidence evidence;
  evidence.units = out.units;
  evidence.units_in_store = bench.units.size();
  evidence.jig = is_named(out.probability, finding.all_size, options.least_deg, options);
  evidence.tilt = is_named(out.tilt_probability, out.tilt_deg, options.least_deg, options);
  judge_repeats(repeats, number, options, out.faces);
  for (std::size_t f = 0; f < out.faces.size(); ++f) {
    FaceTrend& face = out.faces[f];
    face.face = device::kPoses[f];
    face.probability = finding.faces[f].probability;
    face.size_deg = finding.faces[f].size;
    face.standard_uncertainty_deg = finding.faces[f].standard_uncertainty;
    face.is_off = is_named(face.probability, face.size_deg, options.least_deg, options);
    evidence.face = evidence.face || face.is_off;
    evidence.face_scatters = evidence.face_scatters || face.does_not_repeat;
  }
  // A worn face matters by itself, however little it is over all six.
  evidence.jig = evidence.jig || evidence.tilt || evidence.face;
  evidence.lot_explains = lot_explains(effects, trends, number, evidence.jig);
  for (const ModelRun& run : bench.runs) {
    evidence.station =
        evidence.station || (run.jig == number && trends.stations[run.station].skew.is_named);
  }
  evidence.units_deg = out.units_deg;
  out.cause = which_cause(evidence, options);
  if (out.cause == TrendCause::too_few_units) {
    for (FaceTrend& face : out.faces) {
      face.is_off = false;
      face.does_not_repeat = false;
    }
  }
  return out;
}

// The largest step in the runs of one unit, oldest first.
struct UnitHistory {
  std::size_t unit_and_filter = 0;
  std::vector<std::size_t> runs;
};

std::vector<UnitHistory> histories_of(const Bench& bench) {
  std::vector<UnitHistory> out(bench.units_and_filters.size());
  for (std::size_t r = 0; r < bench.runs.size(); ++r) {
    out[bench.runs[r].unit_and_filter].unit_and_filter = bench.runs[r].unit_and_filter;
    out[bench.runs[r].unit_and_filter].runs.push_back(r);
  }
  std::erase_if(out, [](const UnitHistory& history) { return history.runs.size() < 2; });
  return out;
}

struct RunScatter {
  double sd = 1;
  double degrees_of_freedom = 1;
};

// By the median of the differences between successive runs: the few units that did change do not
// widen it. A median knows as much as 0.4 of its values; the prior counts as four.
RunScatter run_scatter(const std::vector<UnitHistory>& histories,
                       const std::vector<Eigen::VectorXd>& own, double prior_sd) {
  constexpr double kPerMedian = 1.4826;  // of a normal distribution
  constexpr double kEfficiency = 0.4;
  constexpr double kPriorWeight = 4;
  std::vector<double> differences;
  for (const UnitHistory& history : histories) {
    for (std::size_t i = 1; i < history.runs.size(); ++i) {
      for (const double each : own[history.runs[i]] - own[history.runs[i - 1]]) {
        differences.push_back(std::abs(each) / std::sqrt(2.0));
      }
    }
  }
  const double found = kPerMedian * median_of(differences);
  const double weight = kEfficiency * static_cast<double>(differences.size());
  return {std::sqrt((weight * found * found + kPriorWeight * prior_sd * prior_sd) /
                    (weight + kPriorWeight)),
          weight + kPriorWeight};
}

void add_changes(const Bench& bench, const QuantityFindings& findings, const std::string& quantity,
                 double prior_sd, double per_c, double least, const TrendOptions& options,
                 std::vector<UnitChange>& out) {
  const std::vector<UnitHistory> histories = histories_of(bench);
  if (histories.empty()) {
    return;
  }
  const RunScatter scatter = run_scatter(histories, findings.own, prior_sd);
  for (const UnitHistory& history : histories) {
    const auto count = history.runs.size();
    UnitChange best;
    for (std::size_t split = 1; split < count; ++split) {
      std::array<Eigen::Vector3d, 2> mean = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
      std::array<double, 2> temperature_c{};
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t side = i < split ? 0 : 1;
        const auto many = static_cast<double>(side == 0 ? split : count - split);
        mean[side] += findings.own[history.runs[i]] / many;
        temperature_c[side] +=
            bench.runs[history.runs[i]].readings.temperature_c.value_or(0) / many;
      }
      const double by_temperature = per_c * (temperature_c[1] - temperature_c[0]);
      const double variance =
          scatter.sd * scatter.sd *
              (1 / static_cast<double>(split) + 1 / static_cast<double>(count - split)) +
          by_temperature * by_temperature;
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        const double step = mean[1](a) - mean[0](a);
        const double tests = 2 * 3 * static_cast<double>((count - 1) * histories.size());
        const double chance = std::min(
            1.0, tests * f_upper_tail(step * step / variance, 1, scatter.degrees_of_freedom));
        if (std::abs(step) >= least && chance < best.chance) {
          best.chance = chance;
          best.run = bench.ids[history.runs[split]];
          best.axis = axis;
          best.size = step;
          best.standard_uncertainty = std::sqrt(variance);
          best.runs_before = split;
          best.runs_after = count - split;
        }
      }
    }
    if (best.chance < options.alarm_chance) {
      best.serial = bench.serial_and_filter[history.unit_and_filter].first;
      best.filter = bench.serial_and_filter[history.unit_and_filter].second;
      best.quantity = quantity;
      out.push_back(best);
    }
  }
}

}  // namespace

std::string_view to_string(TrendCause cause) {
  static constexpr std::array<std::string_view, 7> kNames = {
      "none", "unit", "jig", "face", "jig_or_lot", "station", "too_few_units"};
  return kNames.at(static_cast<std::size_t>(cause));
}

bool is_named(double probability, double size, double least, const TrendOptions& options) {
  return probability >= options.named_probability && std::abs(size) >= least;
}

TrendCause which_cause(const CauseEvidence& evidence, const TrendOptions& options) {
  if (evidence.units < options.fewest_units ||
      evidence.units_in_store < options.fewest_units_in_store) {
    return TrendCause::too_few_units;
  }
  return evidence.lot_explains                             ? TrendCause::jig_or_lot
         : evidence.jig && evidence.face && !evidence.tilt ? TrendCause::face
         : evidence.jig                                    ? TrendCause::jig
         : evidence.face_scatters                          ? TrendCause::face
         : evidence.station                                ? TrendCause::station
         : evidence.units_deg >= options.least_deg         ? TrendCause::unit
                                                           : TrendCause::none;
}

Result<LotOfSerial> parse_lots(std::string_view csv, const std::string& where) {
  constexpr std::array<std::string_view, 2> kNames = {"serial", "lot"};
  SIXPOINT_ASSIGN(const auto rows, csv_columns(csv, kNames, where));
  LotOfSerial lots;
  for (const CsvRow& row : rows) {
    const std::string& serial = row.fields[0];
    const auto at = lots.emplace(serial, row.fields[1]).first;
    if (serial.empty() || row.fields[1].empty() || at->second != row.fields[1]) {
      return fail(
          ErrorCode::bad_data,
          at->second == row.fields[1] ? "a serial or a lot is empty"
                                      : fmt::format("'{}' has two lots", printable(serial, 60)),
          fmt::format("{}:{}", where, row.line), "one line for each unit: its serial and lot");
    }
  }
  return lots;
}

GapTrends find_trends(const std::vector<StoredRun>& runs, const LotOfSerial& lots,
                      const TrendOptions& options) {
  GapTrends trends;
  trends.runs = runs.size();
  std::vector<UsableRun> usable;
  for (const StoredRun& run : runs) {
    if (auto readings = readings_of_run(run)) {
      usable.push_back({&run, *std::move(readings)});
    } else {
      ++trends.left_out;
    }
  }
  trends.badly_seated = set_aside(usable, options);
  Bench bench;
  for (UsableRun& run : usable) {
    add_run(*run.run, std::move(run.readings), lots, bench);
  }
  if (bench.runs.empty()) {
    return trends;
  }
  trends.units = bench.units.size();
  for (const std::string& serial : bench.units.names()) {
    trends.units_without_lot += lots.contains(serial) ? 0 : 1;
  }
  SharedEffectOptions effect_options = options.effects;
  effect_options.fewest_units = options.fewest_units;
  const SharedEffects effects = find_shared_effects(bench.runs, bench.sizes(), effect_options);
  trends.turn_deg = effects.skew.scatter[0];
  trends.shear_deg = effects.skew.scatter[1];
  trends.even_deg = effects.skew.scatter[2];
  trends.zero_mg = effects.zero.scatter[0];
  trends.sensitivity_percent = effects.sensitivity.scatter[0];
  trends.share = effects.skew.share;
  trends.stations = group_trends(
      bench, effects, bench.stations.names(), &QuantityFindings::stations,
      [](const ModelRun& run) { return std::optional(run.station); }, options);
  trends.lots = group_trends(
      bench, effects, bench.lots.names(), &QuantityFindings::lots,
      [](const ModelRun& run) { return run.lot; }, options);
  const auto repeats = repeats_of(bench);
  for (std::size_t jig = 0; jig < bench.jigs.size(); ++jig) {
    trends.jigs.push_back(trend_of(bench, effects, trends, repeats, jig, options));
  }
  std::stable_sort(trends.jigs.begin(), trends.jigs.end(),
                   [](const JigTrend& a, const JigTrend& b) { return a.runs > b.runs; });
  const auto by_name = [](const GroupTrend& a, const GroupTrend& b) { return a.name < b.name; };
  std::sort(trends.stations.begin(), trends.stations.end(), by_name);
  std::sort(trends.lots.begin(), trends.lots.end(), by_name);
  add_changes(bench, effects.zero, "zero", options.effects.zero_mg.median.run,
              options.zero_mg_per_c, options.least_zero_mg, options, trends.unit_changes);
  add_changes(bench, effects.sensitivity, "sensitivity",
              options.effects.sensitivity_percent.median.run, options.sensitivity_percent_per_c,
              options.least_sensitivity_percent, options, trends.unit_changes);
  return trends;
}

}  // namespace sixpoint::station

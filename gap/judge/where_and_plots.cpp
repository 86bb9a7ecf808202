// The gap's places, for people: residuals by axis and segment, and the series of the report.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/judge/steps.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kMostPlaces = 20;
constexpr double kHighAmplitude_g = 1.5;  // tones above show what depends on the amplitude
constexpr double kLongDwell_s = 60;

std::string_view factor_of(const Block& block, const Segment& segment, double rate_hz) {
  if (block.tone) {
    return segment.vibration->amplitude_g > kHighAmplitude_g ? "amplitude" : "frequency";
  }
  if (segment.kind != Segment::Kind::still) {
    return "temperature";
  }
  return segment.name == "yaw"                                           ? "yaw"
         : static_cast<double>(segment.samples) > kLongDwell_s * rate_hz ? "time"
                                                                         : "pose";
}

// Mean squares of one axis in one segment.
struct Cell {
  double square_mg2 = 0, square = 0, n = 0;
  std::string factor;
};

// What is more than chance in one axis of one segment.
struct Excess {
  double square = 0;  // sum of squares, in variances
  double n = 0;
  std::string factor;

  // Detection index of what is there beyond noise, once it is 3 and its chance is below a
  // thousandth (a chi-square exceeds n by 3 of its standard deviations); else 0. `known`: relative
  // uncertainty of the noise's variance.
  double index(double known) const {
    constexpr double kShown = 9, kBeyondChance_sd = 3;
    const double more = square - n;
    return more > std::max(kShown, kBeyondChance_sd * std::sqrt(2 * n) + known * n)
               ? std::sqrt(more)
               : 0;
  }
};
using Excesses = std::map<std::pair<int, std::string>, Excess>;

// Of the noise within pieces of one second.
Excesses noise_excesses(const Request& request, const Records& records) {
  Excesses cells;
  const CleanSamples& clean = records.clean;
  const auto second = static_cast<std::size_t>(request.bundle.rate_hz);
  for (const Segment& segment : request.bundle.segments) {
    const std::size_t end = segment.first_sample + segment.samples;
    std::size_t first = segment.first_sample + segment.quiet_start(request.bundle.rate_hz);
    for (; segment.at_rest() && second > 1 && first + second <= end; first += second) {
      if (clean.count_usable(first, second) < second) {
        continue;
      }
      for (std::size_t a = 0; a < 3; ++a) {
        const double mean_mg = clean.mean_mg(first, second, a);
        double square_mg2 = 0;
        for (std::size_t i = first; i < first + second; ++i) {
          square_mg2 += std::pow(clean.value_mg(i, a) - mean_mg, 2);
        }
        Excess& cell = cells[{static_cast<int>(a), segment.name}];
        cell.square += square_mg2 / std::max(1e-9, std::pow(records.noise.white_mg[a], 2));
        cell.n += static_cast<double>(second - 1);
        cell.factor = "noise";
      }
    }
  }
  return cells;
}

// Overlapping estimate over means of one second (IEEE 1139-2008). `sum`: their running sums.
double allan_variance(const std::vector<double>& sum, std::size_t seconds) {
  double square = 0;
  double n = 0;
  for (std::size_t i = 0; i + 2 * seconds < sum.size(); ++i) {
    const double d =
        (sum[i + 2 * seconds] - 2 * sum[i + seconds] + sum[i]) / static_cast<double>(seconds);
    square += d * d;
    n += 1;
  }
  return square / std::max(1.0, 2 * n);
}

// Running sums of the means of one second, mg; masked seconds repeat the one before.
std::vector<double> running_sums(const Request& request, const CleanSamples& clean,
                                 const Segment& segment, std::size_t axis) {
  const auto second = static_cast<std::size_t>(request.bundle.rate_hz);
  std::vector<double> sum = {0};
  double last = 0;
  for (std::size_t k = 0; k < segment.samples / second; ++k) {
    const std::size_t at = segment.first_sample + k * second;
    last = clean.count_usable(at, second) > 0 ? clean.mean_mg(at, second, axis) : last;
    sum.push_back(sum.back() + last);
  }
  return sum;
}

void plot_allan(const Request& request, const Records& records, const Fit& fit, Plots& plots) {
  constexpr std::size_t kLeast_s = 60;
  const Segment* longest = nullptr;
  for (const Segment& segment : request.bundle.segments) {
    if (segment.kind == Segment::Kind::still &&
        (longest == nullptr || segment.samples > longest->samples)) {
      longest = &segment;
    }
  }
  const auto second = static_cast<std::size_t>(request.bundle.rate_hz);
  if (longest == nullptr || second == 0 || longest->samples < kLeast_s * second) {
    return;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double> sum = running_sums(request, records.clean, *longest, axis);
    for (std::size_t m = 1; 4 * m < sum.size(); m *= 2) {
      const auto tau = static_cast<double>(m);
      const double white =
          std::pow(records.response.white_mg[axis], 2) / (tau * request.bundle.rate_hz);
      // Allan variances of 1/f noise and of a random walk (IEEE 1139-2008).
      const double size2 = fit.scatter_size * fit.scatter_size;
      const double slow = fit.scatter == Scatter::flicker
                              ? 2 * std::log(2.0) * flicker_density_mg2(fit.scatter_size)
                          : fit.scatter == Scatter::random_walk ? size2 * tau / 3
                                                                : 0;
      if (axis == 0) {
        plots.allan_s.push_back(tau);
      }
      plots.allan_mg[axis].push_back(std::sqrt(allan_variance(sum, m)));
      plots.allan_nominal_mg[axis].push_back(std::sqrt(white));
      plots.allan_model_mg[axis].push_back(std::sqrt(white + slow));
    }
  }
}

// The name under which most was recorded at rest: there a line shows best.
std::string longest_at_rest(const Bundle& bundle) {
  std::map<std::string, std::size_t> samples;
  std::string longest;
  for (const Segment& segment : bundle.segments) {
    if (segment.at_rest()) {
      samples[segment.name] += segment.samples;
      longest = samples[segment.name] > samples[longest] ? segment.name : longest;
    }
  }
  return longest;
}

// The axis, and the segment behind the move, that gravity moves most: there ringing shows best.
std::pair<int, std::string> largest_move(const Bundle& bundle) {
  std::pair<int, std::string> place;
  double most_g = 0;
  for (const Segment& segment : bundle.segments) {
    int axis = 0;
    const double move_g = segment.approach_g.cwiseAbs().maxCoeff(&axis);
    if (segment.at_rest() && segment.may_ring() && move_g > most_g) {
      most_g = move_g;
      place = {axis, segment.name};
    }
  }
  return place;
}

}  // namespace

Residuals locate_residuals(const Request& request, const Records& records,
                           const Explanation& explanation, const Findings& found) {
  Residuals out;
  const Fit& nominal = explanation.nominal();
  const Fit& best = explanation.best();
  std::map<std::pair<int, std::string>, Cell> cells;
  for (int row = 0; row < explanation.model().rows(); ++row) {
    const Block& block = explanation.model().block_of_row(row);
    const Segment& segment = request.bundle.segments[block.segment];
    const int feature = explanation.model().feature_of_row(row);
    const int axis = feature < kSecondHarmonic ? feature % 3 : block.axis;
    const double before = nominal.residual[row];
    const double scale_mg = std::sqrt(nominal_variance_mg2(block, feature));
    Cell& cell = cells[{axis, segment.name}];
    cell.square += std::pow(before, 2);
    cell.square_mg2 += std::pow(before * scale_mg, 2);
    cell.n += 1;
    cell.factor = factor_of(block, segment, request.bundle.rate_hz);
    if (feature < kToneAmplitude) {
      out.plot.push_back({axis, segment.name, block.temperature_c, block.middle_s / 60,
                          before * scale_mg, before, best.residual[row] * scale_mg});
    }
  }
  for (const auto& [key, cell] : cells) {
    out.where.push_back({key.first, key.second, cell.factor, std::sqrt(cell.square_mg2 / cell.n),
                         std::sqrt(cell.square / cell.n)});
  }
  const std::string quiet = longest_at_rest(request.bundle);
  for (const SpectralLine& line : records.lines.list) {
    for (int a = 0; a < 3; ++a) {
      const double size_mg = std::abs(line.vector_mg[a]);
      out.where.push_back({a, quiet, fmt::format("frequency {:.2f} Hz", line.frequency_hz),
                           size_mg / M_SQRT2, size_mg / std::max(1e-6, line.sd_mg)});
    }
  }
  const StepResponse& step = records.settling.step;
  if (found.accepted("settling") || step.left_without_sd > kAlarm_sd) {
    const auto [axis, segment] = largest_move(request.bundle);
    out.where.push_back({axis, segment, "time since move", 1000 * step.amplitude / 2,
                         step.amplitude / std::max(1e-9, step.mode.amplitude_sd)});
  }
  std::sort(out.where.begin(), out.where.end(),
            [](const Location& a, const Location& b) { return a.sigma > b.sigma; });
  out.where.resize(std::min(kMostPlaces, out.where.size()));
  return out;
}

std::vector<UnknownPlace> locate_unknown(const Request& request, const Records& records,
                                         const Explanation& explanation, const Findings& found) {
  constexpr double kNoiseKnown = 0.02;  // its spectrum bends a little
  std::set<std::string> named;
  for (const EffectFinding& effect : found.effects) {
    named.insert(effect.name);
  }
  Excesses means;
  const std::vector<double> left = explanation.left_over_sigma(named);
  for (int row = 0; row < explanation.model().rows(); ++row) {
    const Block& block = explanation.model().block_of_row(row);
    const Segment& segment = request.bundle.segments[block.segment];
    const int feature = explanation.model().feature_of_row(row);
    Excess& cell = means[{feature < kSecondHarmonic ? feature % 3 : block.axis, segment.name}];
    cell.square += std::pow(left[static_cast<std::size_t>(row)], 2);
    cell.n += 1;
    cell.factor = factor_of(block, segment, request.bundle.rate_hz);
  }
  std::map<std::pair<int, std::string>, std::pair<double, std::string>> worst;
  const auto add = [&](const Excesses& cells, double known) {
    for (const auto& [place, cell] : cells) {
      if (const double index = cell.index(known); index > worst[place].first) {
        worst[place] = {index, cell.factor};
      }
    }
  };
  add(means, 0);
  add(noise_excesses(request, records), kNoiseKnown);
  std::vector<std::pair<double, UnknownPlace>> sorted;
  for (const auto& [place, most] : worst) {
    if (most.first > 0) {
      sorted.push_back({most.first, {place.first, place.second, most.second}});
    }
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<UnknownPlace> places;
  places.reserve(sorted.size());
  for (auto& [index, place] : sorted) {
    places.push_back(std::move(place));
  }
  for (const Alarm& alarm : found.alarms) {
    for (const UnknownPlace& place : alarm.places) {
      if (std::none_of(places.begin(), places.end(), [&](const UnknownPlace& have) {
            return have.axis == place.axis && have.segment == place.segment;
          })) {
        places.push_back(place);
      }
    }
  }
  return places;
}

Plots make_plots(const Request& request, const Records& records, const Fit& best,
                 const Findings& found) {
  const double rate_hz = request.bundle.rate_hz;
  const Response& response = records.response;
  Plots plots;
  plot_allan(request, records, best, plots);
  plots.frequency_hz = records.noise.frequency_hz;
  plots.noise_mg2 = records.noise.variance_mg2;
  const double rounding_mg2 = std::pow(request.lsb_mg(), 2) / 12;
  for (std::size_t a = 0; a < 3; ++a) {
    for (const double f : plots.frequency_hz) {
      plots.noise_model_mg2[a].push_back(
          std::pow(response.white_mg[a] * response.noise_gain(f, rate_hz), 2) + rounding_mg2);
    }
  }
  const StepResponse& step = records.settling.step;
  for (std::size_t i = 0; i < step.share.size(); i += 2) {
    const double t = static_cast<double>(i) / rate_hz;
    plots.step_s.push_back(t);
    plots.step_share.push_back(step.share[i]);
    plots.step_model.push_back(found.accepted("settling") ? step.model(t) : 0);
  }
  for (const ToneFit& tone : records.tones) {
    if (tone.usable) {
      const Vibration& v = *request.bundle.segments[tone.segment].vibration;
      const double nominal_mg = best.state.gain[tone.axis] * 1000 * v.amplitude_g;
      plots.tones.push_back({tone.axis, v.frequency_hz,
                             nominal_mg > 0 ? tone.in_phase_mg[tone.axis] / nominal_mg : 0,
                             response.tone_gain(v.frequency_hz, rate_hz)});
    }
  }
  return plots;
}

}  // namespace sixpoint::gap

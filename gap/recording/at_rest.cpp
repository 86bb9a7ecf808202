#include "gap/recording/at_rest.h"

#include <algorithm>

namespace sixpoint::gap {

namespace {

Places places_as_stored(const CleanSamples& clean, const Segment& segment, std::size_t count) {
  Places places(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (clean.usable(segment.first_sample + i)) {
      places[i] = i;
    }
  }
  return places;
}

// Takes the line through its samples off each axis: the zero follows the temperature of a ramp.
void take_trend_off(Stretch& stretch) {
  const auto n = static_cast<double>(stretch.known);
  double sum_t = 0;
  double squares_t = 0;
  for (std::size_t i = 0; i < stretch.samples; ++i) {
    const double t = stretch.is_known[i] ? static_cast<double>(i) : 0;
    sum_t += t;
    squares_t += t * t;
  }
  const double middle = sum_t / n;
  for (std::vector<double>& x : stretch.x) {
    double sum = 0;
    double moment = 0;
    for (std::size_t i = 0; i < stretch.samples; ++i) {  // unknown ones are zero
      sum += x[i];
      moment += (static_cast<double>(i) - middle) * x[i];
    }
    const double slope = moment / std::max(1.0, squares_t - n * middle * middle);
    for (std::size_t i = 0; i < stretch.samples; ++i) {
      x[i] -= stretch.is_known[i] ? sum / n + slope * (static_cast<double>(i) - middle) : 0;
    }
  }
}

}  // namespace

Places places_by_clock(const CleanSamples& clean, const Segment& segment, std::size_t count) {
  Places places(count);
  const auto samples = static_cast<std::ptrdiff_t>(count);
  auto slip = std::ranges::lower_bound(clean.slips, segment.first_sample, {}, &ClockSlip::first);
  std::ptrdiff_t lost = 0;
  bool possible = true;  // a second can't repeat more samples than it holds
  for (std::size_t i = 0; i < count && possible; ++i) {
    const std::size_t sample = segment.first_sample + i;
    for (; slip != clean.slips.end() && slip->last <= sample; ++slip) {
      lost += slip->lost;
      possible = possible && slip->lost > -static_cast<std::ptrdiff_t>(slip->last - slip->first) &&
                 lost <= samples;
    }
    if (clean.in_step(sample)) {
      places[i] = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(i) + lost);
    }
  }
  return possible ? places : places_as_stored(clean, segment, count);
}

std::vector<Stretch> stretches(const Bundle& bundle, const CleanSamples& clean) {
  constexpr double kShortest_s = 4;
  constexpr std::size_t kLongest = 1U << 17;  // 22 minutes at 100 Hz
  std::vector<Stretch> all;
  for (const Segment& segment : bundle.segments) {
    const std::size_t skip = segment.quiet_start(bundle.rate_hz);
    if (!segment.at_rest() ||
        segment.samples < skip + static_cast<std::size_t>(kShortest_s * bundle.rate_hz)) {
      continue;
    }
    const std::size_t stored = std::min(segment.samples - skip, kLongest);
    if (clean.count_usable(segment.first_sample + skip, stored) * 10 < stored * 9) {
      continue;
    }
    const Places places = places_by_clock(clean, segment, skip + stored);
    Stretch stretch;
    stretch.rotation = segment.rotation;
    stretch.pose = segment.pose;
    std::optional<std::size_t> start;
    for (std::size_t i = skip; i < places.size(); ++i) {
      if (!places[i]) {
        continue;
      }
      start = start.value_or(*places[i]);
      stretch.is_known.resize(*places[i] - *start, false);
      stretch.is_known.push_back(true);
      ++stretch.known;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double x_mg = clean.value_mg(segment.first_sample + i, axis);
        stretch.x[axis].resize(*places[i] - *start, 0);
        stretch.x[axis].push_back(x_mg);
      }
    }
    if (2 * stretch.known < stored) {
      continue;
    }
    stretch.start_s = segment.host_start_s + static_cast<double>(*start) / bundle.rate_hz;
    stretch.samples = stretch.is_known.size();
    take_trend_off(stretch);
    all.push_back(std::move(stretch));
  }
  return all;
}

std::vector<RestPiece> rest_pieces(const Bundle& bundle, std::size_t segment, std::size_t length,
                                   std::size_t every) {
  const Segment& from = bundle.segments[segment];
  std::vector<RestPiece> pieces;
  for (std::size_t i = from.quiet_start(bundle.rate_hz); from.at_rest() && i < from.samples;
       i += every * length) {
    pieces.push_back({segment, from.first_sample + i, std::min(length, from.samples - i)});
  }
  return pieces;
}

}  // namespace sixpoint::gap

#include "gap/recording/at_rest.h"

#include <algorithm>

namespace sixpoint::gap {

std::vector<Stretch> stretches(const Bundle& bundle, const CleanSamples& clean) {
  constexpr double kShortest_s = 4;
  constexpr std::size_t kLongest = 1U << 17;  // 22 minutes at 100 Hz
  std::vector<Stretch> all;
  for (const Segment& segment : bundle.segments) {
    const std::size_t skip = segment.quiet_start(bundle.rate_hz);
    if (!segment.at_rest() || segment.kind == Segment::Kind::ramp ||
        segment.samples < skip + static_cast<std::size_t>(kShortest_s * bundle.rate_hz)) {
      continue;
    }
    Stretch stretch;
    stretch.samples = std::min(segment.samples - skip, kLongest);
    stretch.start_s = segment.host_start_s + static_cast<double>(skip) / bundle.rate_hz;
    stretch.rotation = segment.rotation;
    stretch.pose = segment.pose;
    const std::size_t first = segment.first_sample + skip;
    if (clean.count_usable(first, stretch.samples) * 10 < stretch.samples * 9) {
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double mean_mg = clean.mean_mg(first, stretch.samples, axis);
      for (std::size_t i = 0; i < stretch.samples; ++i) {
        stretch.x[axis].push_back(
            clean.usable(first + i) ? clean.value_mg(first + i, axis) - mean_mg : 0);
      }
    }
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

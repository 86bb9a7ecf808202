#include "repair/compare/align.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "base/measure.h"

namespace sixpoint::repair {
namespace {

constexpr double kBlock_s = 60;
constexpr std::size_t kMaxBlocks = 60;
constexpr double kFineReach_s = 2;      // about the lag found to the second
constexpr double kNearBest = 0.6;       // of the best correlation: lags to the second worth a look
constexpr std::size_t kMostCoarse = 8;  // of these
constexpr double kSureFit = 0.8;  // mean correlation of the minutes: no other lag is looked at
constexpr double kGoodCorrelation = 0.5;  // below, a minute does not fit at all
constexpr double kRivalFactor = 0.85;     // peaks this close to a minute's best are rivals
constexpr std::size_t kMaxRivals = 12;
constexpr double kInlier_s = 0.03;
constexpr double kSwellTrust_s = 0.2;  // standard error of the lag found from swelling and fading
constexpr double kRivalLine = 0.8;     // a line with so much of the best one's votes is a rival
constexpr int kMaxDrift_ppm = 100;     // a cold watch crystal is off by 35
constexpr double kLongEnoughForDrift_s = 600;

// Pearson's correlation of pairs given one by one; pairs with a missing value are left out.
class Correlation {
 public:
  void add(double x, double y) {
    if (std::isnan(x) || std::isnan(y)) {
      return;
    }
    ++count_;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    yy_ += y * y;
    xy_ += x * y;
  }
  std::size_t count() const { return count_; }
  double value() const {
    const auto n = static_cast<double>(count_);
    const double vx = xx_ - x_ * x_ / n;
    const double vy = yy_ - y_ * y_ / n;
    return count_ > 2 && vx > 0 && vy > 0 ? (xy_ - x_ * y_ / n) / std::sqrt(vx * vy) : 0;
  }

 private:
  std::size_t count_ = 0;
  double x_ = 0;
  double y_ = 0;
  double xx_ = 0;
  double yy_ = 0;
  double xy_ = 0;
};

// How much the second from each step on moves, for steps of hop_s from the whole second before the
// trace's start. The logarithm lets rest and gentle motion have a say beside the wildest shaking.
std::vector<float> motion_of(const Trace& trace, double hop_s) {
  std::vector<float> motion;
  const double start_s = std::floor(trace.start_s());
  const auto steps = static_cast<std::size_t>((trace.end_s() - start_s) / hop_s);
  motion.reserve(steps);
  for (std::size_t i = 0; i < steps; ++i) {
    motion.push_back(
        std::log(second_at(trace, start_s + static_cast<double>(i) * hop_s).sd_g + 0.01F));
  }
  return motion;
}

// The lags about `about_s`, in steps of hop_s, at which the motions fit, the best first; of the
// others those that come near it. None where the best is no fit.
std::vector<double> motion_lags(const Trace& a, const Trace& b, double hop_s, double about_s,
                                double reach_s) {
  const std::vector<float> motion_a = motion_of(a, hop_s);
  const std::vector<float> motion_b = motion_of(b, hop_s);
  const auto offset = static_cast<std::ptrdiff_t>(
      std::llround((std::floor(a.start_s()) - std::floor(b.start_s()) + about_s) / hop_s));
  const auto reach = static_cast<std::ptrdiff_t>(std::llround(reach_s / hop_s));
  std::vector<double> values;
  for (std::ptrdiff_t lag = -reach; lag <= reach; ++lag) {
    Correlation correlation;
    for (std::ptrdiff_t i = 0; i < std::ssize(motion_a); ++i) {
      const std::ptrdiff_t j = i + offset + lag;
      if (j >= 0 && j < std::ssize(motion_b)) {
        correlation.add(motion_a[static_cast<std::size_t>(i)],
                        motion_b[static_cast<std::size_t>(j)]);
      }
    }
    // Few seconds in common correlate well by chance.
    values.push_back(static_cast<double>(correlation.count()) * hop_s >= 10 ? correlation.value()
                                                                            : 0);
  }
  const double best = std::ranges::max(values);
  if (best < 0.2) {
    return {};
  }
  std::vector<std::pair<double, double>> peaks;  // value, lag
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double left = i == 0 ? -1 : values[i - 1];
    const double right = i + 1 == values.size() ? -1 : values[i + 1];
    if (values[i] < kNearBest * best || values[i] <= left || values[i] < right) {
      continue;
    }
    double at = static_cast<double>(i);
    if (i != 0 && i + 1 != values.size()) {
      const double bend = left - 2 * values[i] + right;
      at += bend < 0 ? 0.5 * (left - right) / bend : 0;
    }
    peaks.emplace_back(values[i], about_s + (at - static_cast<double>(reach)) * hop_s);
  }
  std::ranges::sort(peaks, std::greater<>());
  std::vector<double> lags;
  for (std::size_t i = 0; i < std::min(peaks.size(), kMostCoarse); ++i) {
    lags.push_back(peaks[i].second);
  }
  return lags;
}

// To some tenths of a second, about a lag that is known to a second.
double tenths_of(const Trace& a, const Trace& b, double second_s) {
  const auto tenth = motion_lags(a, b, 0.1, std::round(second_s), kFineReach_s);
  return tenth.empty() ? second_s : tenth.front();
}

struct Block {
  std::size_t begin = 0;  // into A
  std::size_t end = 0;
  double middle_s = 0;  // A's time
  double motion_g = 0;
};

// The liveliest minutes of A, in order of time.
std::vector<Block> lively_blocks(const Trace& a, const CompareOptions& options) {
  const double length_s = std::min(kBlock_s, static_cast<double>(a.size()) / a.rate_hz());
  const auto steps = std::max<std::size_t>(2, static_cast<std::size_t>(length_s * a.rate_hz()));
  std::vector<Block> blocks;
  for (std::size_t begin = 0; begin + steps <= a.size(); begin += steps) {
    Moments present;
    for (std::size_t i = begin; i < begin + steps; ++i) {
      if (const double value = a.magnitude_g(i); !std::isnan(value)) {
        present.add(value);
      }
    }
    if (10 * present.count() < 9 * steps) {
      continue;
    }
    const double motion = present.sd();
    if (motion * kMgPerG >= options.min_motion_mg) {
      blocks.push_back(
          {begin, begin + steps,
           a.start_s() +
               (static_cast<double>(begin) + static_cast<double>(steps) / 2) / a.rate_hz(),
           motion});
    }
  }
  std::ranges::sort(blocks, std::greater<>(), &Block::motion_g);
  blocks.resize(std::min(blocks.size(), kMaxBlocks));
  std::ranges::sort(blocks, std::less<>(), &Block::middle_s);
  return blocks;
}

struct Candidate {
  std::size_t block;
  double lag_s;
  double correlation;
};

double block_correlation(const Trace& a, const Trace& b, const Block& block, double lag_s) {
  Correlation correlation;
  for (std::size_t i = block.begin; i < block.end; ++i) {
    correlation.add(a.magnitude_g(i),
                    b.at(a.start_s() + static_cast<double>(i) / a.rate_hz() + lag_s));
  }
  return 2 * correlation.count() > block.end - block.begin ? correlation.value() : 0;
}

// Adds every lag at which this block fits about as well as it ever does there, and says how well
// that is: 0 where it does not fit.
double add_candidates(const Trace& a, const Trace& b, const Block& block, std::size_t index,
                      double about_s, std::vector<Candidate>& candidates) {
  const double step_s = 1 / std::max(a.rate_hz(), b.rate_hz());
  const auto reach = static_cast<int>(kFineReach_s / step_s);
  std::vector<double> values;
  for (int k = -reach; k <= reach; ++k) {
    values.push_back(block_correlation(a, b, block, about_s + k * step_s));
  }
  const double best = *std::ranges::max_element(values);
  if (best < kGoodCorrelation) {
    return 0;
  }
  std::vector<Candidate> found;
  for (std::size_t k = 1; k + 1 < values.size(); ++k) {
    const double left = values[k - 1];
    const double here = values[k];
    const double right = values[k + 1];
    if (here < kRivalFactor * best || here < left || here <= right) {
      continue;
    }
    const double bend = left - 2 * here + right;
    const double shift = bend < 0 ? 0.5 * (left - right) / bend : 0;
    found.push_back({index, about_s + (static_cast<double>(k) - reach + shift) * step_s, here});
  }
  std::ranges::sort(found, std::greater<>(), &Candidate::correlation);
  found.resize(std::min(found.size(), kMaxRivals));
  candidates.insert(candidates.end(), found.begin(), found.end());
  return best;
}

// The line that most blocks agree on: for every drift, lags corrected for it fall into bins; bins
// near the lag that swelling and fading gave count for more. `rival_s` becomes the distance of the
// next line that nearly as many agree on, 0 where there is none.
Line vote(const std::vector<Candidate>& candidates, const std::vector<Block>& blocks,
          double middle_s, bool with_drift, std::optional<double> about_s, double& rival_s) {
  struct Best {
    double votes = -1;
    double slope = 0;
  };
  std::map<std::int64_t, Best> lines;
  const int limit_ppm = with_drift ? kMaxDrift_ppm : 0;
  for (int ppm = -limit_ppm; ppm <= limit_ppm; ppm += 2) {
    std::map<std::int64_t, double> bins;
    for (const Candidate& candidate : candidates) {
      const double corrected =
          candidate.lag_s - ppm * 1e-6 * (blocks[candidate.block].middle_s - middle_s);
      bins[std::llround(corrected / kInlier_s)] += candidate.correlation;
    }
    for (const auto& [bin, votes] : bins) {
      // The neighbouring bins have half a vote: agreement need not fall into the middle of a bin.
      const auto neighbour = [&](std::int64_t other) {
        const auto at = bins.find(other);
        return at == bins.end() ? 0.0 : 0.5 * at->second;
      };
      const double off =
          about_s ? (static_cast<double>(bin) * kInlier_s - *about_s) / kSwellTrust_s : 0;
      // Of equal drifts the smaller one: real ones are.
      const double total = (votes + neighbour(bin - 1) + neighbour(bin + 1)) *
                           std::exp(-0.5 * off * off) * (1 - 1e-4 * std::abs(ppm));
      if (Best& best = lines[bin]; total > best.votes) {
        best = {total, ppm * 1e-6};
      }
    }
  }
  const auto best = std::ranges::max_element(
      lines, [](const auto& x, const auto& y) { return x.second.votes < y.second.votes; });
  rival_s = 0;
  for (const auto& [bin, line] : lines) {
    const double distance_s = static_cast<double>(std::abs(bin - best->first)) * kInlier_s;
    if (distance_s > 3 * kInlier_s && line.votes > kRivalLine * best->second.votes) {
      rival_s = std::max(rival_s, distance_s);
    }
  }
  return {static_cast<double>(best->first) * kInlier_s, best->second.slope, middle_s};
}

// The lag of one block near `guess_s`, by least squares on the difference (Gauss-Newton), each
// unit's own mean and gain apart. Nothing where it leaves the neighbourhood.
std::optional<double> refined_lag(const Trace& a, const Trace& b, const Block& block,
                                  double guess_s) {
  const double half_step_s = 0.5 / b.rate_hz();
  double lag_s = guess_s;
  for (int round = 0; round < 8; ++round) {
    // a = offset + gain * b(t + lag) + gain * b'(t + lag) * change: three unknowns, by their normal
    // equations.
    double n = 0, sb = 0, sd = 0, sa = 0, sbb = 0, sbd = 0, sdd = 0, sab = 0, sad = 0;
    for (std::size_t i = block.begin; i < block.end; ++i) {
      const double time_s = a.start_s() + static_cast<double>(i) / a.rate_hz() + lag_s;
      const double va = a.magnitude_g(i);
      const double vb = b.at(time_s);
      const double d =
          (b.at(time_s + half_step_s) - b.at(time_s - half_step_s)) / (2 * half_step_s);
      if (std::isnan(va) || std::isnan(vb) || std::isnan(d)) {
        continue;
      }
      n += 1, sb += vb, sd += d, sa += va, sbb += vb * vb, sbd += vb * d, sdd += d * d,
          sab += va * vb, sad += va * d;
    }
    if (n < 10) {
      return std::nullopt;
    }
    const double cbb = sbb - sb * sb / n;
    const double cbd = sbd - sb * sd / n;
    const double cdd = sdd - sd * sd / n;
    const double cab = sab - sa * sb / n;
    const double cad = sad - sa * sd / n;
    const double determinant = cbb * cdd - cbd * cbd;
    if (!(determinant > 1e-12 * cbb * cdd)) {
      return std::nullopt;
    }
    const double gain = (cab * cdd - cad * cbd) / determinant;
    const double gain_times_change = (cad * cbb - cab * cbd) / determinant;
    if (!(gain > 0.1)) {
      return std::nullopt;
    }
    const double change = std::clamp(gain_times_change / gain, -half_step_s, half_step_s);
    lag_s += change;
    if (std::abs(change) < 1e-7) {
      break;
    }
  }
  return std::abs(lag_s - guess_s) < 2 * kInlier_s ? std::optional(lag_s) : std::nullopt;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

// A straight line through the blocks' lags; those far off (a block that fitted one period aside)
// are left out.
void fit_line(const std::vector<std::pair<double, double>>& points, bool with_drift, Line& line,
              PairComparison& result) {
  std::vector<double> distances;
  distances.reserve(points.size());
  for (const auto& [time_s, lag_s] : points) {
    distances.push_back(lag_s - line.at(time_s));
  }
  const double centre = median(distances);
  for (double& distance : distances) {
    distance = std::abs(distance - centre);
  }
  // 1.4826: from the median of absolute deviations to a standard deviation, for normal scatter.
  const double limit = std::max(1e-3, 4 * 1.4826 * median(distances));
  // The lag is said for the middle of the minutes that it comes from, where it is known best.
  double n = 0;
  double time_sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (distances[i] <= limit) {
      n += 1;
      time_sum += points[i].first;
    }
  }
  line.middle_s = time_sum / n;
  double st = 0, sl = 0, stt = 0, stl = 0, sll = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (distances[i] > limit) {
      continue;
    }
    const double t = points[i].first - line.middle_s;
    const double l = points[i].second;
    st += t, sl += l, stt += t * t, stl += t * l, sll += l * l;
  }
  const double ctt = stt - st * st / n;
  const double ctl = stl - st * sl / n;
  line.slope = with_drift && ctt > 0 ? ctl / ctt : 0;
  line.lag_s = (sl - line.slope * st) / n;
  const double rest = std::max(0.0, sll - sl * sl / n - line.slope * ctl);
  result.minutes_used = static_cast<std::size_t>(n);
  result.lag_uncertainty_s = n > 2 ? std::sqrt(rest / (n - 2) / n) : 0;
}

}  // namespace

Line align(const Trace& a, const Trace& b, const CompareOptions& options, PairComparison& result) {
  Line line{0, 0, a.start_s()};
  const std::vector<Block> blocks = lively_blocks(a, options);
  if (blocks.empty()) {
    result.remarks.emplace_back("nothing moved, so the clocks cannot be aligned; lag taken as 0");
    return line;
  }
  // By how the motion swells and fades, which the period of a tone cannot mislead.
  const auto seconds = motion_lags(a, b, 1, 0, std::floor(options.max_lag_s));
  if (seconds.empty() && blocks.size() > 1) {
    result.remarks.push_back(fmt::format(
        "the motions do not fit at any lag up to {:.0f} s: were the units moved together?",
        options.max_lag_s));
    return line;
  }
  // Motion that goes on and off by a period swells alike at several lags: its minutes fit best at
  // the right one.
  std::vector<Candidate> candidates;
  std::optional<double> coarse;
  double best = 0;
  for (std::size_t i = 0; i < std::max<std::size_t>(seconds.size(), 1) && best < kSureFit; ++i) {
    const double about_s = seconds.empty() ? 0 : tenths_of(a, b, seconds[i]);
    std::vector<Candidate> here;
    double fit = 0;
    for (std::size_t n = 0; n < blocks.size(); ++n) {
      fit += add_candidates(a, b, blocks[n], n, about_s, here) / static_cast<double>(blocks.size());
    }
    if (fit > best) {
      best = fit;
      candidates = std::move(here);
      coarse = seconds.empty() ? std::nullopt : std::optional(about_s);
    }
  }
  if (candidates.empty()) {
    result.remarks.emplace_back("no lively minute fits: were the units moved together?");
    return line;
  }
  line.middle_s = (blocks.front().middle_s + blocks.back().middle_s) / 2;
  const bool with_drift = blocks.back().middle_s - blocks.front().middle_s >= kLongEnoughForDrift_s;
  double rival_s = 0;
  line = vote(candidates, blocks, line.middle_s, with_drift, coarse, rival_s);
  std::vector<std::pair<double, double>> points;
  for (const Block& block : blocks) {
    const auto lag = refined_lag(a, b, block, line.at(block.middle_s));
    if (lag && block_correlation(a, b, block, *lag) >= kGoodCorrelation) {
      points.emplace_back(block.middle_s, *lag);
    }
  }
  if (!points.empty()) {
    fit_line(points, with_drift && points.size() >= 4, line, result);
    result.aligned = true;
    if (rival_s > 0) {
      result.lag_uncertainty_s = std::max(result.lag_uncertainty_s, rival_s);
      result.remarks.push_back(fmt::format(
          "the motion is periodic: the lag may be off by {:.2f} s, which the envelopes do not mind "
          "but the RMS does",
          rival_s));
    }
  }
  return line;
}

}  // namespace sixpoint::repair

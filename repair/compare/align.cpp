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
// Of a short recording a twentieth, so that it has parts enough to agree; in less than ten seconds
// nearly everything fits somewhere.
constexpr double kShortestBlock_s = 10;
constexpr double kBlocksOfARecording = 20;
constexpr std::size_t kMaxBlocks = 60;
constexpr double kFineReach_s = 2;       // about the lag that swelling and fading gave
constexpr double kCoarseHop_s = 0.25;    // swelling by whole seconds does not see lags of half ones
constexpr double kNearBest = 0.6;        // of the best correlation: coarse lags worth a look
constexpr std::size_t kMostCoarse = 32;  // of these
constexpr double kCoarseApart_s = 1;     // those nearer to a better one are looked at with it
// Cubic interpolation halfway between samples keeps 0.64 of their noise: so much may lags that fit
// equally well differ in what does not fit (1 - correlation).
constexpr double kAlike = 1 / 0.64;
constexpr double kLeastMisfit = 1e-3;     // the least that is told apart
constexpr double kGoodCorrelation = 0.5;  // below, a minute does not fit at all
constexpr double kRivalFactor = 0.85;     // peaks this close to a minute's best are rivals
constexpr std::size_t kMaxRivals = 12;
constexpr double kInlier_s = 0.03;
constexpr double kSwellTrust_s = 0.2;  // standard error of the lag found from swelling and fading
constexpr double kRivalLine = 0.8;     // a line with so much of the best one's votes is a rival
constexpr int kMaxDrift_ppm = 100;     // a cold watch crystal is off by 35
constexpr double kLongEnoughForDrift_s = 240;  // beyond, a drifting clock moves by a sample
constexpr std::size_t kFewestAgreeing = 3;     // a line goes through any two
constexpr double kMostChance = 1e-4;
constexpr double kSwellMemory_s = 120;  // how long motion may go on as before
constexpr double kSurestSwell = 0.01;   // swelling alone is never an alignment
constexpr double kSurestStep = 0.02;    // of a sample: what cubic interpolation cannot tell

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

// How much the second from each step on moves, for steps of hop_s from shift_s behind the whole
// second before the trace's start. The logarithm lets rest and gentle motion have a say beside the
// wildest shaking.
std::vector<float> motion_of(const Trace& trace, double hop_s, double shift_s = 0) {
  std::vector<float> motion;
  const double start_s = std::floor(trace.start_s()) + shift_s;
  const auto steps = static_cast<std::size_t>((trace.end_s() - start_s) / hop_s);
  motion.reserve(steps);
  for (std::size_t i = 0; i < steps; ++i) {
    motion.push_back(
        std::log(second_at(trace, start_s + static_cast<double>(i) * hop_s).sd_g + 0.01F));
  }
  return motion;
}

// The lags about `about_s`, in steps of hop_s, at which the motions fit, the best first; of the
// others those that come near it, a second and more from a better one; none beyond max_lag_s. None
// where the best is no fit.
std::vector<double> motion_lags(const Trace& a, const Trace& b, double hop_s, double about_s,
                                double reach_s, double max_lag_s) {
  const std::vector<float> motion_a = motion_of(a, 1);
  const std::vector<float> motion_b = motion_of(b, hop_s);
  const auto hops_per_second = static_cast<std::ptrdiff_t>(std::llround(1 / hop_s));
  const auto offset = static_cast<std::ptrdiff_t>(
      std::llround((std::floor(a.start_s()) - std::floor(b.start_s()) + about_s) / hop_s));
  const auto reach = static_cast<std::ptrdiff_t>(std::llround(reach_s / hop_s));
  std::vector<double> values;
  for (std::ptrdiff_t lag = -reach; lag <= reach; ++lag) {
    Correlation correlation;
    for (std::ptrdiff_t i = 0; i < std::ssize(motion_a); ++i) {
      const std::ptrdiff_t j = i * hops_per_second + offset + lag;
      if (j >= 0 && j < std::ssize(motion_b)) {
        correlation.add(motion_a[static_cast<std::size_t>(i)],
                        motion_b[static_cast<std::size_t>(j)]);
      }
    }
    // Few seconds in common correlate well by chance.
    values.push_back(correlation.count() >= 10 ? correlation.value() : 0);
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
    const double lag_s = about_s + (at - static_cast<double>(reach)) * hop_s;
    if (std::abs(lag_s) <= max_lag_s + hop_s) {
      peaks.emplace_back(values[i], std::clamp(lag_s, -max_lag_s, max_lag_s));
    }
  }
  std::ranges::sort(peaks, std::greater<>());
  std::vector<double> lags;
  for (const auto& peak : peaks) {
    const double lag_s = peak.second;
    if (lags.size() < kMostCoarse && std::ranges::none_of(lags, [&](double better_s) {
          return std::abs(better_s - lag_s) < kCoarseApart_s;
        })) {
      lags.push_back(lag_s);
    }
  }
  return lags;
}

// To some tenths of a second, about a lag that is known less well.
double tenths_of(const Trace& a, const Trace& b, double coarse_s, double max_lag_s) {
  const auto tenth =
      motion_lags(a, b, 0.1, std::round(10 * coarse_s) / 10, kCoarseApart_s, max_lag_s);
  return tenth.empty() ? coarse_s : tenth.front();
}

// That unrelated motions swell and fade so much alike at any of the lags tried. Neighbouring
// seconds are alike, so there are fewer to count than there are (Bartlett). 1 where they swell more
// alike at another lag, two minutes beyond the limit included: what is related beyond the limit
// swells a little alike within it too.
double swell_chance(const Trace& a, const Trace& b, double lag_s, double limit_s) {
  const std::vector<float> motion_a = motion_of(a, 1);
  const auto here_s = static_cast<std::ptrdiff_t>(std::llround(lag_s));
  const std::vector<float> motion_b = motion_of(b, 1, lag_s - static_cast<double>(here_s));
  const auto correlation_of = [](const std::vector<float>& x, const std::vector<float>& y,
                                 std::ptrdiff_t shift) {
    Correlation correlation;
    for (std::ptrdiff_t i = 0; i < std::ssize(x); ++i) {
      if (i + shift >= 0 && i + shift < std::ssize(y)) {
        correlation.add(x[static_cast<std::size_t>(i)], y[static_cast<std::size_t>(i + shift)]);
      }
    }
    return correlation;
  };
  const auto offset =
      static_cast<std::ptrdiff_t>(std::floor(a.start_s()) - std::floor(b.start_s()));
  const Correlation both = correlation_of(motion_a, motion_b, offset + here_s);
  const auto reach = static_cast<std::ptrdiff_t>(limit_s + kSwellMemory_s);
  for (std::ptrdiff_t other_s = -reach; other_s <= reach; ++other_s) {
    const bool beyond = std::abs(static_cast<double>(other_s)) > limit_s;
    if (!beyond && std::abs(other_s - here_s) <= 1) {
      continue;
    }
    const Correlation other = correlation_of(motion_a, motion_b, offset + other_s);
    if (2 * other.count() > both.count() &&
        (other.value() > both.value() || (beyond && other_s == here_s))) {
      return 1;
    }
  }
  double alike = 1;
  for (std::ptrdiff_t shift = 1; shift <= static_cast<std::ptrdiff_t>(kSwellMemory_s); ++shift) {
    alike += 2 * correlation_of(motion_a, motion_a, shift).value() *
             correlation_of(motion_b, motion_b, shift).value();
  }
  const double seconds = static_cast<double>(both.count()) / std::max(1.0, alike);
  if (seconds <= 4) {
    return 1;
  }
  const double deviations = std::atanh(std::min(both.value(), 1 - 1e-9)) * std::sqrt(seconds - 3);
  return std::min(
      1.0, 0.5 * std::erfc(deviations / std::sqrt(2)) * (2 * static_cast<double>(reach) + 1));
}

struct Block {
  std::size_t begin = 0;  // into A
  std::size_t end = 0;
  double middle_s = 0;  // A's time
  double motion_g = 0;
};

// The liveliest minutes of A, in order of time; of a short recording, parts of it.
std::vector<Block> lively_blocks(const Trace& a, const CompareOptions& options) {
  const double all_s = static_cast<double>(a.size()) / a.rate_hz();
  const double length_s =
      std::min(all_s, std::clamp(all_s / kBlocksOfARecording, kShortestBlock_s, kBlock_s));
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

// Adds every lag up to limit_s at which this block fits about as well as it ever does there.
void add_candidates(const Trace& a, const Trace& b, const Block& block, std::size_t index,
                    double about_s, double limit_s, std::vector<Candidate>& candidates) {
  // A's step is a whole number of steps, so that B is interpolated once for all lags.
  const auto finer = static_cast<std::size_t>(std::ceil(b.rate_hz() / a.rate_hz()));
  const double step_s = 1 / (a.rate_hz() * static_cast<double>(finer));
  const auto reach = static_cast<std::size_t>(kFineReach_s / step_s);
  const std::size_t samples = block.end - block.begin;
  const double from_s = a.start_s() + static_cast<double>(block.begin) / a.rate_hz() + about_s -
                        static_cast<double>(reach) * step_s;
  std::vector<double> theirs;
  for (std::size_t i = 0; i <= (samples - 1) * finer + 2 * reach; ++i) {
    theirs.push_back(b.at(from_s + static_cast<double>(i) * step_s));
  }
  std::vector<double> values;
  for (std::size_t k = 0; k <= 2 * reach; ++k) {
    Correlation correlation;
    for (std::size_t i = 0; i < samples; ++i) {
      correlation.add(a.magnitude_g(block.begin + i), theirs[i * finer + k]);
    }
    values.push_back(2 * correlation.count() > samples ? correlation.value() : 0);
  }
  const double best = *std::ranges::max_element(values);
  if (best < kGoodCorrelation) {
    return;
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
    const double lag_s =
        about_s + (static_cast<double>(k) - static_cast<double>(reach) + shift) * step_s;
    if (std::abs(lag_s) <= limit_s) {
      found.push_back({index, lag_s, here});
    }
  }
  std::ranges::sort(found, std::greater<>(), &Candidate::correlation);
  found.resize(std::min(found.size(), kMaxRivals));
  candidates.insert(candidates.end(), found.begin(), found.end());
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

// How far an error of so many degrees of freedom reaches in 99 of 100 cases, in standard errors:
// Student's t, by Fisher's expansion; within 2 % from three on.
double t_99(double freedom) {
  return 2.5758 + 4.917 / freedom + 8.83 / (freedom * freedom) +
         12.1 / (freedom * freedom * freedom);
}

struct LineFit {
  std::size_t agreeing = 0;
  double half_width_s = 0;   // the agreeing are so near to the line
  double uncertainty_s = 0;  // of the lag in its middle, 99 of 100
};

// A straight line through the blocks' lags; those far off (a block that fitted one period aside)
// are left out.
LineFit fit_line(const std::vector<std::pair<double, double>>& points, bool with_drift,
                 Line& line) {
  LineFit fit;
  // The voted line is known to a bin only: the second and third round measure from the fitted one.
  for (int round = 0; round < 3; ++round) {
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
    const bool sloped = with_drift && n >= 4 && ctt > 0;
    line.slope = sloped ? ctl / ctt : 0;
    line.lag_s = (sl - line.slope * st) / n;
    const double rest = std::max(0.0, sll - sl * sl / n - line.slope * ctl);
    const double freedom = n - (sloped ? 2 : 1);
    fit = {static_cast<std::size_t>(n), std::min(limit, 2 * kInlier_s),
           freedom > 0 ? t_99(freedom) * std::sqrt(rest / freedom / n) : 0};
  }
  return fit;
}

// How likely it is that each block that fits somewhere has one of its good lags by the line, where
// its lags are anywhere within reach_s.
Agreement agreement_of(const std::vector<Candidate>& candidates, const std::vector<Block>& blocks,
                       const LineFit& fit, std::size_t rank, double reach_s, bool with_drift) {
  Agreement agreement;
  agreement.agreeing = fit.agreeing;
  std::map<std::size_t, std::size_t> lags_of;
  for (const Candidate& candidate : candidates) {
    ++lags_of[candidate.block];
  }
  for (const auto& [block, lags] : lags_of) {
    agreement.chances.push_back(
        std::min(1.0, static_cast<double>(lags) * fit.half_width_s / reach_s));
  }
  const double half_span_s = (blocks.back().middle_s - blocks.front().middle_s) / 2;
  const double slopes = with_drift ? 1 + kMaxDrift_ppm * 1e-6 * half_span_s / fit.half_width_s : 1;
  // The width of what agrees is taken from the parts themselves: of its halvings the k-th is worth
  // one in (k + 1)(k + 2), which is 1 for all of them.
  const double halvings = std::log2(2 * kInlier_s / fit.half_width_s);
  // So is one of the lags that swelling gave. A line three standard errors from it has no votes.
  const auto lag = static_cast<double>(rank);
  agreement.lines_tried = (lag + 1) * (lag + 2) *
                          std::max(1.0, std::min(reach_s, 3 * kSwellTrust_s) / fit.half_width_s) *
                          slopes * (halvings + 1) * (halvings + 2);
  return agreement;
}

// The line near a lag.
struct Fitted {
  Line line;
  LineFit fit;
  Agreement agreement;  // without the swelling
  double rival_s = 0;   // as of vote()
};

// Of all samples: where a steady tone begins and ends tells one of its periods from the next.
double whole_correlation(const Trace& a, const Trace& b, const Line& line) {
  Correlation correlation;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double time_s = a.start_s() + static_cast<double>(i) / a.rate_hz();
    correlation.add(a.magnitude_g(i), b.at(time_s + line.at(time_s)));
  }
  return correlation.value();
}

// Nothing where no block fits near `about_s`, the lag that swelling gave (0 where it gave none), the
// rank-th best by it.
std::optional<Fitted> fitted_near(const Trace& a, const Trace& b, const std::vector<Block>& blocks,
                                  std::optional<double> about_s, double limit_s, std::size_t rank) {
  Fitted fitted;
  const double half_span_s = (blocks.back().middle_s - blocks.front().middle_s) / 2;
  // Away from the middle a clock may have drifted beyond the limit.
  const double block_limit_s = limit_s + kMaxDrift_ppm * 1e-6 * half_span_s;
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    add_candidates(a, b, blocks[i], i, about_s.value_or(0), block_limit_s, candidates);
  }
  if (candidates.empty()) {
    return std::nullopt;
  }
  const bool with_drift = 2 * half_span_s >= kLongEnoughForDrift_s;
  fitted.line = vote(candidates, blocks, (blocks.front().middle_s + blocks.back().middle_s) / 2,
                     with_drift, about_s, fitted.rival_s);
  std::vector<std::pair<double, double>> points;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    // A part that fitted nowhere is no witness: it would agree without a chance of its own.
    if (std::ranges::find(candidates, i, &Candidate::block) == candidates.end()) {
      continue;
    }
    const Block& block = blocks[i];
    const auto lag = refined_lag(a, b, block, fitted.line.at(block.middle_s));
    if (lag && block_correlation(a, b, block, *lag) >= kGoodCorrelation) {
      points.emplace_back(block.middle_s, *lag);
    }
  }
  if (!points.empty()) {
    fitted.fit = fit_line(points, with_drift, fitted.line);
    // By the limit the lags may be closer together than the search reaches.
    const double reach_s = std::min(kFineReach_s, block_limit_s);
    fitted.agreement = agreement_of(candidates, blocks, fitted.fit, rank, reach_s, with_drift);
  }
  return fitted;
}

}  // namespace

double Agreement::by_chance() const {
  // The distribution of how many agree, one part after another.
  std::vector<double> exactly = {1};
  for (const double chance : chances) {
    exactly.push_back(0);
    for (std::size_t k = exactly.size(); k-- > 0;) {
      exactly[k] = exactly[k] * (1 - chance) + (k > 0 ? exactly[k - 1] * chance : 0);
    }
  }
  double tail = 0;
  for (std::size_t k = agreeing; k < exactly.size(); ++k) {
    tail += exactly[k];
  }
  return std::min(1.0, tail * lines_tried) * std::max(swelling, kSurestSwell);
}

bool is_alignment(const Agreement& agreement, double lag_s, double limit_s) {
  return agreement.agreeing >= kFewestAgreeing && agreement.by_chance() < kMostChance &&
         std::abs(lag_s) <= limit_s;
}

Line align(const Trace& a, const Trace& b, const CompareOptions& options, PairComparison& result) {
  Line line{0, 0, a.start_s()};
  const std::vector<Block> blocks = lively_blocks(a, options);
  if (blocks.empty()) {
    result.remarks.emplace_back("nothing moved, so the clocks cannot be aligned; lag taken as 0");
    return line;
  }
  // By how the motion swells and fades, which the period of a tone cannot mislead.
  const auto coarse =
      motion_lags(a, b, kCoarseHop_s, 0, std::ceil(options.max_lag_s), options.max_lag_s);
  if (coarse.empty() && blocks.size() > 1) {
    result.remarks.push_back(fmt::format(
        "the motions do not fit at any lag up to {:.0f} s: were the units moved together?",
        options.max_lag_s));
    return line;
  }
  const double limit_s = options.max_lag_s + 1 / std::min(a.rate_hz(), b.rate_hz());
  // Motion that goes on and off by a period swells alike at several lags: its minutes fit best at
  // the right one.
  std::vector<Fitted> found;
  for (std::size_t i = 0; i < std::max<std::size_t>(coarse.size(), 1); ++i) {
    const auto about_s = coarse.empty()
                             ? std::nullopt
                             : std::optional(tenths_of(a, b, coarse[i], options.max_lag_s));
    if (auto fitted = fitted_near(a, b, blocks, about_s, limit_s, i)) {
      found.push_back(std::move(*fitted));
    }
  }
  if (found.empty()) {
    result.remarks.emplace_back("no lively minute fits: were the units moved together?");
    return line;
  }
  // No other one swells more alike.
  found.front().agreement.swelling = swell_chance(a, b, found.front().line.lag_s, limit_s);
  const auto end = std::partition(found.begin(), found.end(), [limit_s](const Fitted& fitted) {
    return is_alignment(fitted.agreement, fitted.line.lag_s, limit_s);
  });
  if (end == found.begin()) {
    const auto most = std::ranges::max_element(
        found, {}, [](const Fitted& fitted) { return fitted.agreement.agreeing; });
    result.remarks.push_back(fmt::format(
        "{} of {} lively parts agree on a lag up to {:g} s, which chance does too: were the units "
        "moved together?",
        most->agreement.agreeing, blocks.size(), options.max_lag_s));
    return {0, 0, a.start_s()};
  }
  found.erase(end, found.end());
  // Of the lags that chance does not give, the one at which the recordings fit best.
  std::vector<double> misfit;
  misfit.reserve(found.size());
  for (const Fitted& fitted : found) {
    misfit.push_back(1 - whole_correlation(a, b, fitted.line));
  }
  const auto least = std::ranges::min_element(misfit);
  const auto& [best_line, fit, agreement, near_s] =
      found[static_cast<std::size_t>(least - misfit.begin())];
  line = best_line;
  double rival_s = near_s;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double distance_s = std::abs(found[i].line.at(line.middle_s) - line.lag_s);
    if (distance_s > 3 * kInlier_s && misfit[i] <= kAlike * std::max(*least, kLeastMisfit)) {
      rival_s = std::max(rival_s, distance_s);
    }
  }
  result.aligned = true;
  const double part_s =
      static_cast<double>(blocks.front().end - blocks.front().begin) / a.rate_hz();
  result.minutes_used = static_cast<std::size_t>(
      std::max(1LL, std::llround(static_cast<double>(fit.agreeing) * part_s / 60)));
  result.lag_uncertainty_s =
      std::max(rival_s, std::hypot(fit.uncertainty_s, kSurestStep / a.rate_hz()));
  if (rival_s > 0) {
    result.remarks.push_back(fmt::format(
        "the motion is periodic: the lag may be off by {:.2f} s, which the envelopes do not mind "
        "but the RMS does",
        rival_s));
  }
  return line;
}

}  // namespace sixpoint::repair

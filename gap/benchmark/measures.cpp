#include "gap/benchmark/measures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/random.h"

namespace sixpoint::gap {

double right_above(std::span<const Ranked> known, std::span<const double> unknown) {
  if (known.empty() || unknown.empty()) {
    return kNotDefined;
  }
  std::vector<double> sorted(unknown.begin(), unknown.end());
  std::ranges::sort(sorted);
  double pairs = 0;
  for (const Ranked& answer : known) {
    if (answer.right) {
      const auto low = std::lower_bound(sorted.begin(), sorted.end(), answer.confidence);
      const auto high = std::upper_bound(low, sorted.end(), answer.confidence);
      pairs += static_cast<double>(low - sorted.begin()) + 0.5 * static_cast<double>(high - low);
    }
  }
  return pairs / static_cast<double>(known.size()) / static_cast<double>(unknown.size());
}

double area_under_risk_coverage(std::span<const Ranked> answers) {
  if (answers.empty()) {
    return kNotDefined;
  }
  std::vector<Ranked> sorted(answers.begin(), answers.end());
  std::ranges::sort(sorted, std::greater(), &Ranked::confidence);
  const auto all = static_cast<double>(sorted.size());
  double area = 0;
  double wrong = 0;
  for (std::size_t i = 0; i < sorted.size();) {
    std::size_t next = i;
    double more = 0;
    for (; next < sorted.size() && sorted[next].confidence == sorted[i].confidence; ++next) {
      more += sorted[next].right ? 0 : 1;
    }
    area += static_cast<double>(next - i) / all * (wrong + more / 2) / all;
    wrong += more;
    i = next;
  }
  return area;
}

double calibration_error(std::span<const Said> said) {
  if (said.empty()) {
    return kNotDefined;
  }
  constexpr int kBins = 10;
  std::map<std::pair<std::string, int>, double> differences;
  for (const Said& one : said) {
    const int bin = std::clamp(static_cast<int>(one.probability * kBins), 0, kBins - 1);
    differences[{one.label, bin}] += one.probability - (one.right ? 1 : 0);
  }
  double error = 0;
  for (const auto& [bin, difference] : differences) {
    error += std::abs(difference);
  }
  return error / static_cast<double>(said.size());
}

double half_named_at(std::span<const Sized> effects) {
  constexpr double kReach = 8;
  constexpr double kPenalty = 0.01;
  constexpr int kMostSteps = 100;
  std::vector<std::pair<double, double>> points;
  for (const Sized& effect : effects) {
    if (effect.size >= 1 / kReach && effect.size <= kReach) {
      points.emplace_back(std::log(effect.size), effect.named ? 1 : 0);
    }
  }
  if (points.size() < 4) {
    return kNotDefined;
  }
  double a = 0;
  double b = 1;
  for (int step = 0; step < kMostSteps; ++step) {
    double gradient_a = 0, gradient_b = -kPenalty * b;
    double aa = 1e-9, ab = 0, bb = kPenalty;
    for (const auto& [x, named] : points) {
      const double p = 1 / (1 + std::exp(-(a + b * x)));
      const double weight = p * (1 - p);
      gradient_a += named - p;
      gradient_b += (named - p) * x;
      aa += weight;
      ab += weight * x;
      bb += weight * x * x;
    }
    const double determinant = aa * bb - ab * ab;
    double move_a = (bb * gradient_a - ab * gradient_b) / determinant;
    double move_b = (aa * gradient_b - ab * gradient_a) / determinant;
    const double longest = std::max(std::abs(move_a), std::abs(move_b));
    const double shrink = longest > 2 ? 2 / longest : 1;
    a += shrink * move_a;
    b += shrink * move_b;
    if (longest < 1e-10) {
      break;
    }
  }
  const double half = std::exp(-a / b);
  return b > 0 && half > 1 / (kReach * kReach) && half < kReach * kReach ? half : kNotDefined;
}

std::array<double, 2> bootstrap_interval(std::size_t count, const Statistic& statistic,
                                         std::uint64_t seed, std::size_t draws) {
  constexpr double kTail = 0.025;
  constexpr std::uint64_t kStream = 0x626F6F74;
  std::vector<double> values;
  Random random(seed, kStream);
  std::vector<std::size_t> drawn(count);
  for (std::size_t k = 0; k < draws && count > 0; ++k) {
    std::ranges::generate(drawn, [&] { return static_cast<std::size_t>(random.below(count)); });
    if (const double value = statistic(drawn); std::isfinite(value)) {
      values.push_back(value);
    }
  }
  if (values.empty() || 2 * values.size() < draws) {
    return {kNotDefined, kNotDefined};
  }
  std::ranges::sort(values);
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(
        std::lround(share * static_cast<double>(values.size() - 1)))];
  };
  return {at(kTail), at(1 - kTail)};
}

}  // namespace sixpoint::gap

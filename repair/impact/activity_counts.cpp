#include "repair/impact/activity_counts.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sixpoint::repair {
namespace {

// The band pass of the publication, at 30 Hz.
constexpr std::array<double, 8> kZeros = {
    -0.009341062898525, -0.025470289659360, -0.004235264826105, 0.044152415456420,
    0.036493718347760,  -0.011893961934740, -0.022917390623150, -0.006788163862310};
constexpr std::array<double, 7> kPoles = {-3.63367395910957, 5.03689812757486, -3.09612247819666,
                                          0.50620507633883,  0.32421701566682, -0.15685485875559,
                                          0.01949130205890};
// g to counts: the resolution of an older unit's converter, and its gain.
constexpr double kCountsPerG = (3.0 / 4096.0) / (2.6 / 256.0) * 237.5;
constexpr double kMostCounts = 128;
constexpr double kLeastCounts = 4;
// The first value is taken to have stood for 36 s, as the publication does.
constexpr int kSettling = 180 * 6;

struct Factors {
  int rate_hz;
  int up;
  int down;
};
constexpr std::array<Factors, 8> kFactors = {{{30, 1, 1},
                                              {40, 3, 4},
                                              {50, 3, 5},
                                              {60, 1, 2},
                                              {70, 3, 7},
                                              {80, 3, 8},
                                              {90, 1, 3},
                                              {100, 3, 10}}};

}  // namespace

bool ActivityCounts::knows(double rate_hz) {
  return std::ranges::any_of(
      kFactors, [&](const Factors& factors) { return std::abs(factors.rate_hz - rate_hz) < 1e-9; });
}

ActivityCounts::ActivityCounts(int rate_hz, int epoch_s, CountFilter filter)
    : filter_(filter), values_per_epoch_(10 * epoch_s) {
  const auto found = std::ranges::find(kFactors, rate_hz, &Factors::rate_hz);
  const Factors factors = found == kFactors.end() ? kFactors.front() : *found;
  up_ = factors.up;
  down_ = factors.down;
  low_pass_ = up_ > 1;
}

std::optional<int> ActivityCounts::push(double g) {
  std::optional<int> complete;
  const double a = up_ * std::numbers::pi / (std::numbers::pi + 2 * up_);
  const double b = (std::numbers::pi - 2 * up_) / (std::numbers::pi + 2 * up_);
  for (int i = 0; i < up_; ++i) {
    const double in = i == 0 ? g : 0;
    double out = in;
    if (low_pass_) {
      out = a * (in + last_in_) - b * last_out_;
      last_in_ = in;
      last_out_ = out;
    }
    if (phase_ == 0) {
      // At most one of these completes an epoch: an epoch has at least 30 of them.
      if (const auto count = add_at_30_hz(std::round(1000 * out) / 1000)) {
        complete = count;
      }
      phase_ = down_;
    }
    --phase_;
  }
  return complete;
}

double ActivityCounts::band_pass(double value) {
  std::shift_right(in_.begin(), in_.end(), 1);
  in_[0] = value;
  double filtered = 0;
  for (std::size_t i = 0; i < kZeros.size(); ++i) {
    filtered += kZeros[i] * in_[i];
  }
  double poles = 0;
  for (std::size_t i = 0; i < kPoles.size(); ++i) {
    poles += kPoles[i] * out_[i];
  }
  filtered -= poles;
  std::shift_right(out_.begin(), out_.end(), 1);
  out_[0] = filtered;
  return filtered;
}

int ActivityCounts::rectified(double filtered) const {
  const double amount = std::min(std::abs(kCountsPerG * filtered), kMostCounts);
  if (amount >= kLeastCounts) {
    return static_cast<int>(amount);
  }
  return filter_ == CountFilter::low_frequency_extension && amount >= 1
             ? static_cast<int>(amount) - 1
             : 0;
}

std::optional<int> ActivityCounts::add_at_30_hz(double value) {
  if (!settled_) {
    settled_ = true;
    for (int i = 0; i < kSettling; ++i) {
      band_pass(value);
    }
  }
  sum_of_three_ += rectified(band_pass(value));
  if (++of_three_ < 3) {
    return std::nullopt;
  }
  sum_ += sum_of_three_ / 3;
  sum_of_three_ = 0;
  of_three_ = 0;
  if (++of_epoch_ < values_per_epoch_) {
    return std::nullopt;
  }
  of_epoch_ = 0;
  const int complete = sum_;
  sum_ = 0;
  return complete;
}

}  // namespace sixpoint::repair

// 1/f noise of the front end. `mg` is the square root of its one-sided power density at 1 Hz; the
// Allan deviation then has a floor of 1.18 times that (sqrt(2 ln 2)).
//
// One white noise per axis drives one-pole low-passes with time constants in geometric steps r,
// from 10 ms to 3 hours, with gains that rise as the square root of the time constant. Their sum is
// integral of u^(-1/2) / (1 + i u) du / ln r = pi / ln r times the wanted 1 / sqrt(f) law, which
// gives the scale. Over a pause the poles move as their joint Gaussian law says.
#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <numbers>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

constexpr std::size_t kPoles = 10;
constexpr double kShortest_s = 0.01;
constexpr double kLongest_s = 10'800;
using Poles = Eigen::Array<double, static_cast<int>(kPoles), 1>;
using PoleMatrix = Eigen::Matrix<double, static_cast<int>(kPoles), static_cast<int>(kPoles)>;

class Flicker final : public Effect {
 public:
  Flicker(const ParameterSet& values, Random random)
      : g_(values.at("mg")[0] / kMgPerG), random_(random) {}
  void on_recording(const RecordingPlan& plan) override {
    rate_hz_ = plan.rate_hz;
    const double ratio = std::pow(kLongest_s / kShortest_s, 1.0 / (kPoles - 1));
    for (std::size_t k = 0; k < kPoles; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      tau_s_[i] = kShortest_s * std::pow(ratio, static_cast<double>(k));
      keep_[i] = std::exp(-1 / (rate_hz_ * tau_s_[i]));
      weight_[i] =
          std::sqrt(tau_s_[i]) * g_ * std::log(ratio) * std::sqrt(rate_hz_ / std::numbers::pi);
    }
    advance(kLongest_s * 10 * rate_hz_);
  }
  void on_sensor(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double samples = (block.time_s[i] - last_s_) * rate_hz_;
      last_s_ = block.time_s[i];
      if (samples > 1.5) {
        advance(samples);
      }
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        Poles& state = state_[static_cast<std::size_t>(axis)];
        const double white = random_.normal();
        state += (1 - keep_) * (white - state);
        block.sensed_g[i][axis] += (weight_ * state).sum();
      }
    }
  }

 private:
  // Jumps `samples` ahead: state' = keep^n state + a Gaussian of covariance
  // (1-k_i)(1-k_j)(1-(k_i k_j)^n) / (1 - k_i k_j).
  void advance(double samples) {
    PoleMatrix covariance;
    for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
      for (Eigen::Index j = 0; j < covariance.cols(); ++j) {
        const double product = keep_[i] * keep_[j];
        covariance(i, j) =
            (1 - keep_[i]) * (1 - keep_[j]) * (1 - std::pow(product, samples)) / (1 - product);
      }
      covariance(i, i) *= 1 + 1e-9;
    }
    const PoleMatrix root = covariance.llt().matrixL();
    const Poles left = keep_.pow(samples);
    for (Poles& state : state_) {
      Eigen::Matrix<double, static_cast<int>(kPoles), 1> white;
      for (Eigen::Index i = 0; i < white.size(); ++i) {
        white[i] = random_.normal();
      }
      state = left * state + (root * white).array();
    }
  }

  double g_;
  Random random_;
  double rate_hz_ = 1;
  double last_s_ = 0;
  Poles tau_s_ = Poles::Zero();
  Poles keep_ = Poles::Zero();
  Poles weight_ = Poles::Zero();
  std::array<Poles, kAxes> state_{Poles::Zero(), Poles::Zero(), Poles::Zero()};
};

}  // namespace

EffectKind flicker_kind() {
  return effect_kind(
      "flicker", Stage::sensor, "1/f noise", make_effect<Flicker>,
      {parameter("mg", "mg", {0.5}, 0, 2,
                 "square root of the power density at 1 Hz; consumer MEMS: 0.2 to 1 mg")});
}

}  // namespace sixpoint::sim

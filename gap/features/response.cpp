#include "gap/features/response.h"

#include <algorithm>
#include <cmath>
#include <complex>

namespace sixpoint::gap {
namespace {

struct Bin {
  std::size_t axis;
  double frequency_hz;
  double variance;
};

struct Ratio {
  std::size_t axis;
  double frequency_hz;
  double log_amplitude;  // over what the protocol says
  double sd;
};

double axis_free_chi(const std::vector<Ratio>& ratios, const std::vector<double>& log_gain) {
  std::array<double, 3> w{};
  std::array<double, 3> wy{};
  std::array<double, 3> wyy{};
  for (std::size_t i = 0; i < ratios.size(); ++i) {
    const double d = ratios[i].log_amplitude - log_gain[i];
    const double weight = 1 / (ratios[i].sd * ratios[i].sd);
    w[ratios[i].axis] += weight;
    wy[ratios[i].axis] += weight * d;
    wyy[ratios[i].axis] += weight * d * d;
  }
  double chi = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    if (w[a] > 0) {
      chi += wyy[a] - wy[a] * wy[a] / w[a];
    }
  }
  return chi;
}

struct Pink {
  double mg = 0;
  double slope = 1;
};

class Search {
 public:
  Search(const Bundle& bundle, const NoiseSpectrum& noise, const std::vector<ToneFit>& tones,
         const ResponseOptions& options)
      : rate_hz_(bundle.rate_hz), options_(options) {
    const double lsb_mg = 1000 / bundle.accel_scale_lsb_per_g;
    rounding_ = lsb_mg * lsb_mg / 12;
    effective_ = static_cast<double>(noise.blocks) / 1.9;  // Hann: neighbouring bins share
    for (std::size_t axis = 0; axis < 3 && noise.usable(); ++axis) {
      for (std::size_t k = 0; k < noise.frequency_hz.size(); ++k) {
        const double f = noise.frequency_hz[k];
        const bool beside_line = std::any_of(options.lines_hz.begin(), options.lines_hz.end(),
                                             [&](double l) { return std::abs(l - f) < 2.1; });
        if (f >= 2 && !beside_line) {
          bins_.push_back({axis, f, noise.variance_mg2[axis][k]});
        }
      }
    }
    for (const ToneFit& tone : tones) {
      const Segment& segment = bundle.segments[tone.segment];
      if (!tone.usable || tone.clipped_share > 0 || segment.vibration->amplitude_g > 1.5) {
        continue;  // small tones only: the large ones also show curvature of third order
      }
      const auto axis = static_cast<std::size_t>(tone.axis);
      const Eigen::Vector3d along = segment.rotation * segment.vibration->direction_lab;
      const double given = 1000 * std::abs(along[tone.axis]) * segment.vibration->amplitude_g;
      const double seen = tone.in_phase_mg[tone.axis];
      if (!(given > 0) || !(seen > 0)) {
        continue;
      }
      const double sd = std::max(tone.residual_mg, noise.white_mg[axis]) *
                        std::sqrt(2 / static_cast<double>(tone.samples)) / seen;
      // Each slip costs a piece at its edges, known to a sample.
      const double slipped = 0.01 * std::sqrt(static_cast<double>(tone.slips.size()));
      // A third-order term bends 1 g tones by up to 0.3 mg of 1 g.
      ratios_.push_back({axis, segment.vibration->frequency_hz, std::log(seen / given),
                         std::hypot(sd, 1e-4, slipped)});
    }
  }

  Response run() {
    Response response;
    response.has_tones = !ratios_.empty();
    std::array<double, 3> white{};
    auto flat_fit = noise_nats({}, white);
    response.noise_flat_sd = flat_fit.left_sd;
    response.noise_left_sd = flat_fit.left_sd;
    response.white_mg = white;
    const Pink pink = find_pink({}, flat_fit.nats);
    if (pink.mg > 0) {
      pink_ = pink;
      flat_fit.nats = noise_nats({}, white).nats - kPinkCost;
      response.white_mg = white;
      response.pink_mg = pink.mg;
      pink_ = {};
    }
    const std::vector<double> none(ratios_.size(), 0);
    const double flat_chi = axis_free_chi(ratios_, none);
    const double freedom = tone_freedom();
    response.tone_flat_sd = freedom > 0 ? (flat_chi - freedom) / std::sqrt(2 * freedom) : 0;
    double best = 0;
    std::vector<double> low_pass_log(ratios_.size(), 0);
    Pink low_pass_pink;
    for (const Pink& with_pink :
         pink.mg > 0 ? std::vector<Pink>{{}, pink} : std::vector<Pink>{{}}) {
      pink_ = with_pink;
      const double before = best;
      search_low_pass(flat_fit.nats, flat_chi, best, response, white);
      if (best > before) {
        low_pass_pink = with_pink;
      }
    }
    pink_ = low_pass_pink;
    double step = 0.048;
    for (int halving = 0; halving < 15 && response.low_pass.corner_hz > 0; ++halving) {
      step /= 2;
      const double centre = response.low_pass.corner_hz;
      for (const double k : {-1.0, 1.0}) {
        const double corner = centre * (1 + k * step);
        if (corner < 0.495 * rate_hz_) {
          LowPass near = response.low_pass;
          near.corner_hz = corner;
          try_low_pass(near, flat_fit.nats, flat_chi, best, response, white);
        }
      }
    }
    // Corner and order are two numbers found on a grid of a few hundred.
    const double joint = response.low_pass.noise_nats + response.low_pass.tone_nats;
    const bool noise_agrees = response.low_pass.noise_nats > 5;
    response.low_pass_significant = options_.allow_low_pass && joint > 14 && noise_agrees;
    double base_chi = flat_chi;
    if (response.low_pass_significant) {
      for (std::size_t i = 0; i < ratios_.size(); ++i) {
        low_pass_log[i] = log_low_pass(i, response.low_pass);
      }
      base_chi = axis_free_chi(ratios_, low_pass_log);
      std::array<double, 3> own{};
      pink_ = {};
      const auto alone = noise_nats(response.low_pass, own);
      response.noise_left_sd = alone.left_sd;
      pink_ = pink.mg > 0 ? find_pink(response.low_pass, alone.nats) : Pink{};
      response.pink_mg = pink_.mg;
      const auto fit = noise_nats(response.low_pass, own);
      response.white_mg = own;
      LowPass near = response.low_pass;
      near.corner_hz *= 1.01;
      const double up = noise_nats(near, own).nats;
      near.corner_hz = 0.99 * response.low_pass.corner_hz;
      const double down = noise_nats(near, own).nats;
      const double curvature =
          (2 * fit.nats - up - down) / std::pow(0.01 * response.low_pass.corner_hz, 2);
      response.low_pass.corner_sd_hz =
          curvature > 0 ? 1 / std::sqrt(curvature) : response.low_pass.corner_hz;
    }
    double chi = base_chi;
    for (const ResonanceForm form :
         {ResonanceForm::base_excited, ResonanceForm::second_order, ResonanceForm::peak}) {
      const auto frequencies = static_cast<int>(std::log(0.5 * rate_hz_ / 4) / std::log(1.02));
      for (int i = 0; i < frequencies; ++i) {
        const double f0 = 4 * std::pow(1.02, i);
        for (int k = 0; k < 35; ++k) {
          const double q = 0.7 * std::pow(1.08, k);
          try_resonance({f0, q, form, 0}, low_pass_log, base_chi, chi, response);
        }
      }
    }
    double step_f = 0.01;
    double step_q = 0.04;
    for (int round = 0; round < 400 && step_f > 1e-8 && response.resonance.frequency_hz > 0;
         ++round) {
      const Resonance centre = response.resonance;
      const double before = chi;
      for (int i = -1; i <= 1; ++i) {
        for (int k = -1; k <= 1; ++k) {
          try_resonance(
              {centre.frequency_hz * (1 + i * step_f), centre.q * (1 + k * step_q), centre.form, 0},
              low_pass_log, base_chi, chi, response);
        }
      }
      if (chi >= before) {
        step_f /= 2;
        step_q /= 2;
      }
    }
    response.tone_flat_chi = base_chi;
    response.tone_left_chi = chi;
    if (response.low_pass_significant) {
      response.low_pass.held_out_nats = held_out_low_pass(response.low_pass);
    }
    // A mount's form is not known to the last per cent: nine tenths of what is there must go.
    const Resonance& mount = response.resonance;
    const bool can_be = mount.frequency_hz > 4 && mount.frequency_hz < 45 && mount.q < 8;
    response.resonance_significant = options_.allow_resonance && mount.tone_nats > 14 && can_be &&
                                     chi - freedom < 0.1 * (base_chi - freedom);
    if (response.resonance_significant) {
      response.resonance.held_out_nats = held_out_resonance(response.resonance, low_pass_log);
    }
    const double left = response.resonance_significant ? chi : base_chi;
    const double left_freedom = freedom - (response.low_pass_significant ? 1 : 0) -
                                (response.resonance_significant ? 2 : 0);
    response.tone_left_sd =
        left_freedom > 0 ? (left - left_freedom) / std::sqrt(2 * left_freedom) : 0;
    if (left > left_freedom && left_freedom > 0 &&
        (response.low_pass_significant || response.resonance_significant)) {
      double variance = 0;
      for (const Ratio& r : ratios_) {
        variance += r.sd * r.sd / static_cast<double>(ratios_.size());
      }
      response.tone_form_share = std::sqrt((left / left_freedom - 1) * variance);
    }
    return response;
  }

 private:
  void search_low_pass(double flat_nats, double flat_chi, double& best, Response& response,
                       std::array<double, 3>& white) const {
    for (const LowPassForm form :
         {LowPassForm::sampled, LowPassForm::mixed, LowPassForm::analogue}) {
      for (const int order : {4, 2, 1, 3, 6, 8}) {
        const auto corners = static_cast<int>(std::log(0.492 * rate_hz_ / 4) / std::log(1.05));
        for (int k = 0; k <= corners; ++k) {
          const double corner = 4 * std::pow(1.05, k);
          try_low_pass({corner, 0, order, 0, 0, form}, flat_nats, flat_chi, best, response, white);
        }
      }
    }
  }

  static constexpr double kPinkCost = 2;  // a size found on a grid

  // The likeliest 1/f noise beside this low-pass, 0 where it does not pay.
  Pink find_pink(const LowPass& low_pass, double without_nats) {
    const Pink kept = pink_;
    double best = without_nats + kPinkCost;
    Pink found;
    std::array<double, 3> white{};
    for (const double slope : {1.0, 0.8, 1.2, 1.4, 1.7, 2.0}) {
      double mg = 0.08;
      for (int step = 0; step < 22; ++step, mg *= 1.2) {  // to 3.7 mg
        pink_ = {mg, slope};
        if (const double nats = noise_nats(low_pass, white).nats; nats > best) {
          best = nats;
          found = pink_;
        }
      }
    }
    pink_ = kept;
    return found;
  }

  struct NoiseFit {
    double nats = 0;
    double left_sd = 0;
  };

  // Whittle's likelihood, the white level of each axis in closed iteration.
  NoiseFit noise_nats(const LowPass& low_pass, std::array<double, 3>& white_mg,
                      int only = -1) const {
    NoiseFit fit;
    double chi = 0;
    std::vector<double> h2(bins_.size());
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      h2[i] = low_pass.order == 0
                  ? 1
                  : std::pow(low_pass.noise_gain(bins_[i].frequency_hz, rate_hz_), 2);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (only >= 0 && axis != static_cast<std::size_t>(only)) {
        continue;
      }
      double s2 = 16;
      for (int round = 0; round < 8; ++round) {
        double up = 0;
        double down = 0;
        for (std::size_t i = 0; i < bins_.size(); ++i) {
          const Bin& bin = bins_[i];
          if (bin.axis == axis) {
            const double h = h2[i];
            const double other = rounding_ + pink_at(bin.frequency_hz) * h;
            const double p = s2 * h + other;
            up += h * (bin.variance - other) / (p * p);
            down += h * h / (p * p);
          }
        }
        s2 = down > 0 ? std::max(0.01, up / down) : s2;
      }
      white_mg[axis] = std::sqrt(s2);
      for (std::size_t i = 0; i < bins_.size(); ++i) {
        const Bin& bin = bins_[i];
        if (bin.axis == axis) {
          const double p = (s2 + pink_at(bin.frequency_hz)) * h2[i] + rounding_;
          fit.nats -= effective_ * (std::log(p) + bin.variance / p);
          // Rounding of noise narrower than an LSB is not quite white: a filter's shape is seen to
          // some per cent.
          const double form = low_pass.order == 0 ? 0 : effective_ * 0.05 * 0.05;
          chi += effective_ * std::pow(bin.variance / p - 1, 2) / (1 + form);
        }
      }
    }
    const auto n = static_cast<double>(bins_.size());
    fit.left_sd = n > 3 ? (chi - n + 3) / std::sqrt(2 * n) : 0;
    return fit;
  }

  // 1/f noise as equivalent white variance. Real 1/f noise keeps to its law within some tenths of
  // the exponent.
  double pink_at(double frequency_hz) const {
    return pink_.mg == 0
               ? 0
               : pink_.mg * pink_.mg * std::pow(frequency_hz, -pink_.slope) * rate_hz_ / 2;
  }

  double axis_noise_nats(const LowPass& low_pass, int axis) const {
    std::array<double, 3> white{};
    return noise_nats(low_pass, white, axis).nats;
  }

  double log_low_pass(std::size_t i, const LowPass& low_pass) const {
    return std::log(std::max(1e-6, low_pass.tone_gain(ratios_[i].frequency_hz, rate_hz_)));
  }
  double tone_freedom() const {
    std::array<bool, 3> seen{};
    for (const Ratio& r : ratios_) {
      seen[r.axis] = true;
    }
    return static_cast<double>(ratios_.size()) -
           static_cast<double>(std::count(seen.begin(), seen.end(), true));
  }

  void try_low_pass(LowPass low_pass, double flat_nats, double flat_chi, double& best,
                    Response& response, std::array<double, 3>& white) const {
    if (ratios_.empty() && low_pass.form == LowPassForm::mixed) {
      return;  // without tones it is the sampled filter
    }
    const double noise = noise_nats(low_pass, white).nats - flat_nats;
    std::vector<double> log_gain(ratios_.size());
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      log_gain[i] = log_low_pass(i, low_pass);
    }
    const double tone = 0.5 * (flat_chi - axis_free_chi(ratios_, log_gain));
    if (noise + tone > best) {
      best = noise + tone;
      response.low_pass = low_pass;
      response.low_pass.noise_nats = noise;
      response.low_pass.tone_nats = tone;
    }
  }

  void try_resonance(Resonance resonance, const std::vector<double>& low_pass_log, double base_chi,
                     double& chi, Response& response) const {
    if (ratios_.empty()) {
      return;
    }
    std::vector<double> log_gain = low_pass_log;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      log_gain[i] += std::log(std::max(1e-6, resonance_gain(ratios_[i].frequency_hz, resonance)));
    }
    const double c = axis_free_chi(ratios_, log_gain);
    if (c < chi) {
      chi = c;
      response.resonance = resonance;
      response.resonance.tone_nats = 0.5 * (base_chi - c);
    }
  }

  static constexpr int kFolds = 4;

  // Tones by frequency, in order of appearance.
  std::vector<int> folds() const {
    std::vector<double> frequencies;
    std::vector<int> fold;
    for (const Ratio& r : ratios_) {
      const auto at = std::find(frequencies.begin(), frequencies.end(), r.frequency_hz);
      fold.push_back(static_cast<int>(at - frequencies.begin()) % kFolds);
      if (at == frequencies.end()) {
        frequencies.push_back(r.frequency_hz);
      }
    }
    return fold;
  }

  // Chi-square of the tones of one fold about the level that the others set on their axis.
  double unseen_chi(const std::vector<double>& log_gain, const std::vector<int>& fold,
                    int left_out) const {
    std::array<double, 3> w{};
    std::array<double, 3> wy{};
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      if (fold[i] != left_out) {
        const double weight = 1 / (ratios_[i].sd * ratios_[i].sd);
        w[ratios_[i].axis] += weight;
        wy[ratios_[i].axis] += weight * (ratios_[i].log_amplitude - log_gain[i]);
      }
    }
    double chi = 0;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      const std::size_t axis = ratios_[i].axis;
      if (fold[i] == left_out && w[axis] > 0) {
        const double d = ratios_[i].log_amplitude - log_gain[i] - wy[axis] / w[axis];
        chi += d * d / (ratios_[i].sd * ratios_[i].sd + 1 / w[axis]);
      }
    }
    return chi;
  }

  double seen_chi(const std::vector<double>& log_gain, const std::vector<int>& fold,
                  int left_out) const {
    std::vector<Ratio> seen;
    std::vector<double> gain;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      if (fold[i] != left_out) {
        seen.push_back(ratios_[i]);
        gain.push_back(log_gain[i]);
      }
    }
    return axis_free_chi(seen, gain);
  }

  double held_out_low_pass(const LowPass& found) const {
    std::vector<double> log_gain(ratios_.size());
    const std::vector<double> flat(ratios_.size(), 0);
    const auto set = [&](const LowPass& low_pass) {
      for (std::size_t i = 0; i < ratios_.size(); ++i) {
        log_gain[i] = log_low_pass(i, low_pass);
      }
    };
    const std::vector<int> fold = folds();
    double nats = 0;
    for (int k = 0; k < (ratios_.empty() ? 3 : kFolds); ++k) {
      LowPass best = found;
      double least = 1e300;
      for (int i = -12; i <= 12; ++i) {
        LowPass low_pass = found;
        low_pass.corner_hz = std::min(found.corner_hz * (1 + 0.01 * i), 0.495 * rate_hz_);
        double cost = 0;
        if (ratios_.empty()) {
          for (int axis = 0; axis < 3; ++axis) {
            cost -= axis == k ? 0 : axis_noise_nats(low_pass, axis);
          }
        } else {
          std::array<double, 3> white{};
          set(low_pass);
          cost = 0.5 * seen_chi(log_gain, fold, k) - noise_nats(low_pass, white).nats;
        }
        if (cost < least) {
          least = cost;
          best = low_pass;
        }
      }
      if (ratios_.empty()) {
        nats += axis_noise_nats(best, k) - axis_noise_nats({}, k);
      } else {
        set(best);
        nats += 0.5 * (unseen_chi(flat, fold, k) - unseen_chi(log_gain, fold, k));
      }
    }
    return nats;
  }

  double held_out_resonance(const Resonance& found, const std::vector<double>& base) const {
    std::vector<double> log_gain(ratios_.size());
    const std::vector<int> fold = folds();
    double nats = 0;
    for (int k = 0; k < kFolds; ++k) {
      Resonance best = found;
      double least = 1e300;
      double step = 0.06;
      for (int refinement = 0; refinement < 13; ++refinement, step /= 1.6) {
        const Resonance centre = best;
        for (int i = -2; i <= 2; ++i) {
          for (int j = -2; j <= 2; ++j) {
            Resonance trial = centre;
            trial.frequency_hz *= 1 + i * step;
            trial.q *= 1 + 2 * j * step;
            for (std::size_t n = 0; n < ratios_.size(); ++n) {
              log_gain[n] = base[n] + std::log(std::max(
                                          1e-6, resonance_gain(ratios_[n].frequency_hz, trial)));
            }
            const double cost = seen_chi(log_gain, fold, k);
            if (cost < least) {
              least = cost;
              best = trial;
            }
          }
        }
      }
      for (std::size_t n = 0; n < ratios_.size(); ++n) {
        log_gain[n] =
            base[n] + std::log(std::max(1e-6, resonance_gain(ratios_[n].frequency_hz, best)));
      }
      nats += 0.5 * (unseen_chi(base, fold, k) - unseen_chi(log_gain, fold, k));
    }
    return nats;
  }

  double rate_hz_;
  ResponseOptions options_;
  Pink pink_;  // beside the white in noise_nats
  double rounding_ = 0;
  double effective_ = 0;
  std::vector<Bin> bins_;
  std::vector<Ratio> ratios_;
};

}  // namespace

double low_pass_gain(double frequency_hz, double corner_hz, int order, double rate_hz) {
  const double f = std::min(frequency_hz, 0.499 * rate_hz);
  const double r = std::tan(M_PI * f / rate_hz) / std::tan(M_PI * corner_hz / rate_hz);
  return 1 / std::sqrt(1 + std::pow(r, 2 * order));
}

double LowPass::tone_gain(double frequency_hz, double rate_hz) const {
  if (form == LowPassForm::sampled) {
    return low_pass_gain(frequency_hz, corner_hz, order, rate_hz);
  }
  return 1 / std::sqrt(1 + std::pow(frequency_hz / corner_hz, 2 * order));
}

double LowPass::noise_gain(double frequency_hz, double rate_hz) const {
  if (form != LowPassForm::analogue) {
    return low_pass_gain(frequency_hz, corner_hz, order, rate_hz);
  }
  const auto power = [&](double f) { return 1 / (1 + std::pow(f / corner_hz, 2 * order)); };
  return std::sqrt(power(frequency_hz) + power(rate_hz - frequency_hz) +
                   power(rate_hz + frequency_hz));
}

double Response::tone_gain(double frequency_hz, double rate_hz) const {
  return (low_pass_significant ? low_pass.tone_gain(frequency_hz, rate_hz) : 1) *
         (resonance_significant ? resonance_gain(frequency_hz, resonance) : 1);
}

double Response::noise_gain(double frequency_hz, double rate_hz) const {
  return low_pass_significant ? low_pass.noise_gain(frequency_hz, rate_hz) : 1;
}

double resonance_gain(double frequency_hz, const Resonance& resonance) {
  const double r = frequency_hz / resonance.frequency_hz;
  if (resonance.form == ResonanceForm::peak) {
    return 1 + (resonance.q - 1) / (1 + std::pow(2 * resonance.q * (r - 1), 2));
  }
  const std::complex<double> damping(0, r / resonance.q);
  const std::complex<double> below = 1 - r * r + damping;
  return std::abs(
      (resonance.form == ResonanceForm::base_excited ? 1.0 + damping : std::complex<double>(1)) /
      below);
}

Response find_response(const Bundle& bundle, const NoiseSpectrum& noise,
                       const std::vector<ToneFit>& tones, const ResponseOptions& options) {
  return Search(bundle, noise, tones, options).run();
}

}  // namespace sixpoint::gap

#include "gap/features/response.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <span>

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
  int fold;
};

// Sums of one axis, weighted: they give its level and the chi-square about it.
struct Level {
  double w = 0, wy = 0, wyy = 0;
  void add(double y, double sd) {
    const double weight = 1 / (sd * sd);
    w += weight;
    wy += weight * y;
    wyy += weight * y * y;
  }
};

struct Pink {
  double mg = 0, slope = 1;
};

// Decisions in nats. Corner and order, or frequency and q, are two numbers found on a grid of some
// hundreds of points: log(1000) and as much again for one false alarm in a thousand.
constexpr double kSignificant_nats = 14;
constexpr double kLeft_sd = 4;           // that a low-pass leaves of the tones: something is wrong
constexpr double kNoiseAgrees_nats = 5;  // of a low-pass that tones show: noise passes it, too
constexpr double kPinkCost_nats = 2;     // a size found on a grid
// A mount's form is not known to the last per cent: nine tenths of what is there must go.
constexpr double kFormLeft = 0.1;
// Mounts and straps (gap.md: 8 to 25 Hz, q of 1.5 to 4), with room on either side.
constexpr double kMountLowest_hz = 4, kMountHighest_hz = 45, kMountHighest_q = 8;
constexpr double kLowestCorner_hz = 4;    // of corners and resonances tried
constexpr double kHighestOfRate = 0.495;  // corners: what the bilinear transform can hold
constexpr double kHighestTried = 0.492;   // the end of the grid of corners
constexpr double kSmallTone_g = 1.5;      // larger tones also show curvature of third order
constexpr double kLineGuard_hz = 2.1;     // four bins beside a line
constexpr std::array kForms = {LowPassForm::sampled, LowPassForm::mixed, LowPassForm::analogue};
constexpr int kFolds = 4;  // of the tones' frequencies

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
        if (f >= 2 && std::ranges::none_of(options.lines_hz, [&](double line_hz) {
              return std::abs(line_hz - f) < kLineGuard_hz;
            })) {
          bins_.push_back({axis, f, noise.variance_mg2[axis][k]});
        }
      }
    }
    for (const ToneFit& tone : tones) {
      add_ratio(tone, bundle.segments[tone.segment], noise);
    }
    flat_.assign(ratios_.size(), 0);
    mount_log_ = flat_;
    std::set<std::size_t> axes;
    for (const Ratio& r : ratios_) {
      axes.insert(r.axis);
    }
    freedom_ = static_cast<double>(ratios_.size()) - static_cast<double>(axes.size());
  }

  Response run() {
    out_.has_tones = !ratios_.empty();
    fit_flat();
    find_bounds();
    const Search from_noise = *this;
    find_low_pass();
    double chi = find_mount();
    // The tones may have chosen another filter than the noise passed, or none, without the mount.
    if (chi - freedom_ > kLeft_sd * std::sqrt(2 * freedom_)) {
      for (const LowPassForm form : kForms) {
        Search other = from_noise;
        if (!other.find_low_pass_beside_mount(form)) {
          continue;
        }
        const double other_chi = other.find_mount();
        if (other.out_.resonance_significant &&
            other.out_.low_pass.noise_nats - 0.5 * other_chi >
                out_.low_pass.noise_nats - 0.5 * chi + kSignificant_nats) {
          *this = std::move(other);
          chi = other_chi;
        }
      }
    }
    measure_left_over(chi);
    return out_;
  }

 private:
  // The mount on top of the low-pass, where that is significant. What is significant of both is left
  // with the chi-square that is returned.
  double find_mount() {
    std::vector<double> low_pass_log = flat_;
    double base_chi = chi_of(flat_);
    if (out_.low_pass_significant) {
      fit_noise_behind_low_pass();
      out_.low_pass.held_out_nats = held_out_low_pass(out_.low_pass);
      mount_log_ = flat_;
      low_pass_log = logs_of(out_.low_pass);
      base_chi = chi_of(low_pass_log);
    }
    const double chi = find_resonance(low_pass_log, base_chi);
    const Resonance& mount = out_.resonance;
    out_.resonance_significant =
        options_.allow_resonance && mount.tone_nats > kSignificant_nats &&
        mount.frequency_hz > kMountLowest_hz && mount.frequency_hz < kMountHighest_hz &&
        mount.q < kMountHighest_q && chi - freedom_ < kFormLeft * (base_chi - freedom_);
    if (!out_.resonance_significant) {
      return base_chi;
    }
    out_.resonance.held_out_nats = held_out_resonance(out_.resonance, low_pass_log);
    return chi;
  }

  // The low-pass of this form that the noise alone chooses, the mount on top of it, and the low-pass
  // that noise and tones choose beside that mount: a mount does not act on the sensor's noise, and
  // the noise does not tell how tones pass. False where there is no mount.
  bool find_low_pass_beside_mount(LowPassForm form) {
    tones_count_ = false;
    search_low_pass({&form, 1});
    tones_count_ = true;
    const std::vector<double> low_pass_log = logs_of(out_.low_pass);
    const double base_chi = chi_of(low_pass_log);
    find_resonance(low_pass_log, base_chi);
    if (!options_.allow_resonance || out_.resonance.tone_nats <= kSignificant_nats) {
      return false;
    }
    mount_log_ = logs_of(out_.resonance, flat_);
    out_.low_pass = {};
    out_.resonance = {};
    find_low_pass();
    return out_.low_pass_significant;
  }

  struct NoiseFit {
    double nats = 0, left_sd = 0;
    std::array<double, 3> white_mg{};
  };

  void add_ratio(const ToneFit& tone, const Segment& segment, const NoiseSpectrum& noise) {
    if (!tone.usable || tone.clipped_share > 0 || segment.vibration->amplitude_g > kSmallTone_g) {
      return;
    }
    const auto axis = static_cast<std::size_t>(tone.axis);
    const Eigen::Vector3d along = segment.rotation * segment.vibration->direction_lab;
    const double given = 1000 * std::abs(along[tone.axis]) * segment.vibration->amplitude_g;
    const double measured = tone.in_phase_mg[tone.axis];
    if (!(given > 0) || !(measured > 0)) {
      return;
    }
    // Where a harmonic folds onto the tone itself (a third of the sample rate), neither is known.
    const double sd = std::hypot(std::max(tone.residual_mg, noise.white_mg[axis]) *
                                     std::sqrt(std::max(2 / static_cast<double>(tone.samples),
                                                        tone.covariance_shape(1, 1))),
                                 std::sqrt(tone.line_mg2[0][tone.axis])) /
                      measured;
    // Each slip costs a piece at its edges, known to a sample.
    const double slipped = 0.01 * std::sqrt(static_cast<double>(tone.slips.size()));
    // A third-order term bends 1 g tones by up to 0.3 mg of 1 g.
    const double f = segment.vibration->frequency_hz;
    const auto known = std::ranges::find(tone_hz_, f);
    const int fold = static_cast<int>(known - tone_hz_.begin()) % kFolds;
    ratios_.push_back({axis, f, std::log(measured / given), std::hypot(sd, 1e-4, slipped), fold});
    if (known == tone_hz_.end()) {
      tone_hz_.push_back(f);
    }
  }

  void fit_flat() {
    const NoiseFit flat = fit_noise({});
    out_.noise_flat_sd = flat.left_sd;
    out_.noise_left_sd = flat.left_sd;
    out_.white_mg = flat.white_mg;
    flat_nats_ = flat.nats;
    flat_pink_ = find_pink({}, flat.nats);
    if (flat_pink_.mg > 0) {
      pink_ = flat_pink_;
      const NoiseFit with_pink = fit_noise({});
      flat_nats_ = with_pink.nats - kPinkCost_nats;
      out_.white_mg = with_pink.white_mg;
      pink_ = {};
    }
  }

  // What the data of a unit with this filter or mount, and without chance, say of it. A search of
  // two numbers finds one nat more, by chance.
  double expected_nats(const LowPass& low_pass) const {
    Search made = *this;
    made.pink_ = {};
    const std::vector<double> logs = logs_of(low_pass);
    for (Bin& bin : made.bins_) {
      const double h2 = std::pow(low_pass.noise_gain(bin.frequency_hz, rate_hz_), 2);
      bin.variance = std::pow(out_.white_mg[bin.axis], 2) * h2 + rounding_;
    }
    for (std::size_t i = 0; i < made.ratios_.size(); ++i) {
      made.ratios_[i].log_amplitude = logs[i];
    }
    const double noise_nats = made.fit_noise(low_pass).nats - made.fit_noise({}).nats;
    return noise_nats > kNoiseAgrees_nats ? noise_nats + 0.5 * made.chi_of(flat_) : 0;
  }
  double expected_nats(const Resonance& resonance) const {
    Search made = *this;
    const std::vector<double> logs = logs_of(resonance, flat_);
    for (std::size_t i = 0; i < made.ratios_.size(); ++i) {
      made.ratios_[i].log_amplitude = logs[i];
    }
    return 0.5 * made.chi_of(flat_);
  }

  void find_bounds() {
    const double needed_nats = std::max(kSignificant_nats, options_.named_from_nats) - 1;
    // The highest frequency up to `high` from which on down it shows.
    const auto highest = [&](double low, double high, const auto& of) {
      if (expected_nats(of(low)) < needed_nats) {
        return 0.0;
      }
      for (int halving = 0; halving < 12; ++halving) {
        const double middle = std::sqrt(low * high);
        (expected_nats(of(middle)) < needed_nats ? high : low) = middle;
      }
      return low;
    };
    out_.bound_corner_hz =
        highest(kLowestCorner_hz, kHighestTried * rate_hz_,
                [](double corner_hz) { return LowPass{.corner_hz = corner_hz, .order = 4}; });
    out_.bound_mount_hz = highest(kMountLowest_hz, kMountHighest_hz, [](double frequency_hz) {
      return Resonance{.frequency_hz = frequency_hz, .q = 2.5};
    });
  }

  // Without and with 1/f noise.
  void find_low_pass() {
    search_low_pass();
    if (flat_pink_.mg > 0) {
      const double without = nats_of(out_.low_pass);
      pink_ = flat_pink_;
      search_low_pass();
      pink_ = nats_of(out_.low_pass) > without ? flat_pink_ : Pink{};
    }
    out_.low_pass_significant =
        options_.allow_low_pass &&
        out_.low_pass.noise_nats + out_.low_pass.tone_nats > kSignificant_nats &&
        out_.low_pass.noise_nats > kNoiseAgrees_nats;
  }

  static double nats_of(const LowPass& low_pass) {
    return low_pass.noise_nats + low_pass.tone_nats;
  }

  // On a grid of orders, forms and corners. The corner is refined for each form and order: a tone
  // at the corner tells it to a thousandth, and on the grid a wrong form may be nearer.
  void search_low_pass(std::span<const LowPassForm> forms = kForms) {
    const auto corners =
        static_cast<int>(std::log(kHighestTried * rate_hz_ / kLowestCorner_hz) / std::log(1.05));
    for (const LowPassForm form : forms) {
      if (ratios_.empty() && form == LowPassForm::mixed) {
        continue;  // without tones it is the sampled filter
      }
      for (const int order : {4, 2, 1, 3, 6, 8}) {
        LowPass best;
        for (int k = 0; k <= corners; ++k) {
          try_low_pass({kLowestCorner_hz * std::pow(1.05, k), 0, order, 0, 0, form}, best);
        }
        refine_corner(best);
        if (nats_of(best) > nats_of(out_.low_pass)) {
          out_.low_pass = best;
        }
      }
    }
  }

  void refine_corner(LowPass& best) const {
    double step = 0.048;
    for (int halving = 0; halving < 15 && best.corner_hz > 0; ++halving) {
      step /= 2;
      LowPass near = best;
      for (const double k : {-1.0, 1.0}) {
        near.corner_hz = best.corner_hz * (1 + k * step);
        if (near.corner_hz < kHighestOfRate * rate_hz_) {
          try_low_pass(near, best);
        }
      }
    }
  }

  void try_low_pass(LowPass low_pass, LowPass& best) const {
    low_pass.noise_nats = fit_noise(low_pass).nats - flat_nats_;
    low_pass.tone_nats = tones_count_ ? 0.5 * (chi_of(mount_log_) - chi_of(logs_of(low_pass))) : 0;
    if (nats_of(low_pass) > nats_of(best)) {
      best = low_pass;
    }
  }

  // Levels of white and 1/f noise behind the low-pass, and how well its corner is known.
  void fit_noise_behind_low_pass() {
    pink_ = {};
    const NoiseFit alone = fit_noise(out_.low_pass);
    out_.noise_left_sd = alone.left_sd;
    pink_ = flat_pink_.mg > 0 ? find_pink(out_.low_pass, alone.nats) : Pink{};
    const NoiseFit fit = fit_noise(out_.low_pass);
    out_.white_mg = fit.white_mg;
    const auto nats_at = [&](double factor) {
      LowPass near = out_.low_pass;
      near.corner_hz *= factor;
      return fit_noise(near).nats;
    };
    const double curvature = (2 * fit.nats - nats_at(1.01) - nats_at(0.99)) /
                             std::pow(0.01 * out_.low_pass.corner_hz, 2);
    out_.low_pass.corner_sd_hz = curvature > 0 ? 1 / std::sqrt(curvature) : out_.low_pass.corner_hz;
  }

  // The likeliest resonance on top of the low-pass; its chi-square. Refined for each form: on the
  // grid a wrong one may be nearer.
  double find_resonance(const std::vector<double>& low_pass_log, double base_chi) {
    double chi = base_chi;
    if (ratios_.empty()) {
      return chi;
    }
    for (const ResonanceForm form :
         {ResonanceForm::base_excited, ResonanceForm::second_order, ResonanceForm::peak}) {
      Resonance best;
      const double own = find_resonance_of(form, low_pass_log, base_chi, best);
      if (own < chi) {
        chi = own;
        out_.resonance = best;
        out_.resonance.tone_nats = 0.5 * (base_chi - chi);
      }
    }
    return chi;
  }

  double find_resonance_of(ResonanceForm form, const std::vector<double>& low_pass_log,
                           double base_chi, Resonance& best) const {
    double chi = base_chi;
    const auto try_one = [&](double frequency_hz, double q) {
      const Resonance resonance = {frequency_hz, q, form};
      if (const double c = chi_of(logs_of(resonance, low_pass_log)); c < chi) {
        chi = c;
        best = resonance;
      }
    };
    const auto frequencies =
        static_cast<int>(std::log(0.5 * rate_hz_ / kLowestCorner_hz) / std::log(1.02));
    for (int i = 0; i < frequencies; ++i) {
      for (int k = 0; k < 35; ++k) {
        try_one(kLowestCorner_hz * std::pow(1.02, i), 0.7 * std::pow(1.08, k));
      }
    }
    double step_f = 0.01, step_q = 0.04;
    for (int round = 0; round < 400 && step_f > 1e-8 && best.frequency_hz > 0; ++round) {
      const Resonance centre = best;
      const double before = chi;
      for (int i = -1; i <= 1; ++i) {
        for (int k = -1; k <= 1; ++k) {
          try_one(centre.frequency_hz * (1 + i * step_f), centre.q * (1 + k * step_q));
        }
      }
      if (chi >= before) {
        step_f /= 2;
        step_q /= 2;
      }
    }
    return chi;
  }

  void measure_left_over(double chi) {
    const double freedom =
        freedom_ - (out_.low_pass_significant ? 1 : 0) - (out_.resonance_significant ? 2 : 0);
    out_.tone_left_sd = freedom > 0 ? (chi - freedom) / std::sqrt(2 * freedom) : 0;
    if (chi > freedom && freedom > 0 && (out_.low_pass_significant || out_.resonance_significant)) {
      double variance = 0;
      for (const Ratio& r : ratios_) {
        variance += r.sd * r.sd / static_cast<double>(ratios_.size());
      }
      out_.tone_form_share = std::sqrt((chi / freedom - 1) * variance);
    }
  }

  // The likeliest 1/f noise beside this low-pass, 0 where it does not pay.
  Pink find_pink(const LowPass& low_pass, double without_nats) {
    const Pink before = pink_;
    double best = without_nats + kPinkCost_nats;
    Pink found;
    for (const double slope : {1.0, 0.8, 1.2, 1.4, 1.7, 2.0}) {
      double mg = 0.08;
      for (int step = 0; step < 22; ++step, mg *= 1.2) {  // to 3.7 mg
        pink_ = {mg, slope};
        if (const double nats = fit_noise(low_pass).nats; nats > best) {
          best = nats;
          found = pink_;
        }
      }
    }
    pink_ = before;
    return found;
  }

  // Whittle's likelihood, the white level of each axis in closed iteration.
  NoiseFit fit_noise(const LowPass& low_pass, std::optional<std::size_t> only = {}) const {
    NoiseFit fit;
    double chi = 0;
    // Rounding of noise narrower than an LSB is not quite white: a filter's shape shows to some per
    // cent.
    const double form = low_pass.order == 0 ? 0 : effective_ * 0.05 * 0.05;
    std::vector<double> h2(bins_.size(), 1);
    for (std::size_t i = 0; i < bins_.size() && low_pass.order != 0; ++i) {
      h2[i] = std::pow(low_pass.noise_gain(bins_[i].frequency_hz, rate_hz_), 2);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (only.value_or(axis) != axis) {
        continue;
      }
      const double s2 = white_level(axis, h2);
      fit.white_mg[axis] = std::sqrt(s2);
      for (std::size_t i = 0; i < bins_.size(); ++i) {
        const Bin& bin = bins_[i];
        if (bin.axis == axis) {
          const double p = (s2 + pink_at(bin.frequency_hz)) * h2[i] + rounding_;
          fit.nats -= effective_ * (std::log(p) + bin.variance / p);
          chi += effective_ * std::pow(bin.variance / p - 1, 2) / (1 + form);
        }
      }
    }
    const auto n = static_cast<double>(bins_.size());
    fit.left_sd = n > 3 ? (chi - n + 3) / std::sqrt(2 * n) : 0;
    return fit;
  }

  // Variance of the white noise before the filter, whose power gain is `h2` per bin.
  double white_level(std::size_t axis, const std::vector<double>& h2) const {
    double s2 = 16;  // 4 mg, the nominal unit's; the iteration forgets it
    for (int round = 0; round < 8; ++round) {
      double up = 0, down = 0;
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
    return s2;
  }

  // 1/f noise as equivalent white variance. Real 1/f noise keeps to its law within some tenths of
  // the exponent.
  double pink_at(double frequency_hz) const {
    return pink_.mg == 0
               ? 0
               : pink_.mg * pink_.mg * std::pow(frequency_hz, -pink_.slope) * rate_hz_ / 2;
  }

  // Logarithms of a low-pass' gain at the tones, on top of a mount; of a resonance' gain on top of
  // `base`.
  std::vector<double> logs_of(const LowPass& low_pass) const {
    std::vector<double> logs = mount_log_;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      logs[i] += std::log(std::max(1e-6, low_pass.tone_gain(ratios_[i].frequency_hz, rate_hz_)));
    }
    return logs;
  }
  std::vector<double> logs_of(const Resonance& resonance, const std::vector<double>& base) const {
    std::vector<double> logs = base;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      logs[i] += std::log(std::max(1e-6, resonance_gain(ratios_[i].frequency_hz, resonance)));
    }
    return logs;
  }

  // Levels of the axes over all tones but those of one fold.
  std::array<Level, 3> levels(const std::vector<double>& log_gain, int left_out) const {
    std::array<Level, 3> sums;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      if (ratios_[i].fold != left_out) {
        sums[ratios_[i].axis].add(ratios_[i].log_amplitude - log_gain[i], ratios_[i].sd);
      }
    }
    return sums;
  }
  // Chi-square of the tones about the levels of their axes, without those of one fold.
  double chi_of(const std::vector<double>& log_gain, int left_out = -1) const {
    double chi = 0;
    for (const Level& level : levels(log_gain, left_out)) {
      chi += level.w > 0 ? level.wyy - level.wy * level.wy / level.w : 0;
    }
    return chi;
  }
  // Chi-square of the tones of one fold about the levels that the others set.
  double held_out_chi(const std::vector<double>& log_gain, int left_out) const {
    const std::array<Level, 3> level = levels(log_gain, left_out);
    double chi = 0;
    for (std::size_t i = 0; i < ratios_.size(); ++i) {
      const Ratio& r = ratios_[i];
      const Level& own = level[r.axis];
      if (r.fold == left_out && own.w > 0) {
        const double d = r.log_amplitude - log_gain[i] - own.wy / own.w;
        chi += d * d / (r.sd * r.sd + 1 / own.w);
      }
    }
    return chi;
  }

  // The low-pass of least cost with a corner within 12 % of the one found.
  template <class Cost>
  LowPass refitted(const LowPass& found, const Cost& cost) const {
    LowPass best = found;
    double least = 1e300;
    for (int i = -12; i <= 12; ++i) {
      LowPass low_pass = found;
      low_pass.corner_hz = std::min(found.corner_hz * (1 + 0.01 * i), kHighestOfRate * rate_hz_);
      if (const double c = cost(low_pass); c < least) {
        least = c;
        best = low_pass;
      }
    }
    return best;
  }

  double held_out_low_pass(const LowPass& found) const {
    double nats = 0;
    if (ratios_.empty()) {
      for (std::size_t left_out = 0; left_out < 3; ++left_out) {
        const LowPass best = refitted(found, [&](const LowPass& low_pass) {
          double cost = 0;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            cost -= axis == left_out ? 0 : fit_noise(low_pass, axis).nats;
          }
          return cost;
        });
        nats += fit_noise(best, left_out).nats - fit_noise({}, left_out).nats;
      }
      return nats;
    }
    for (int k = 0; k < kFolds; ++k) {
      const LowPass best = refitted(found, [&](const LowPass& low_pass) {
        return 0.5 * chi_of(logs_of(low_pass), k) - fit_noise(low_pass).nats;
      });
      nats += 0.5 * (held_out_chi(mount_log_, k) - held_out_chi(logs_of(best), k));
    }
    return nats;
  }

  double held_out_resonance(const Resonance& found, const std::vector<double>& base) const {
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
            if (const double cost = chi_of(logs_of(trial, base), k); cost < least) {
              least = cost;
              best = trial;
            }
          }
        }
      }
      nats += 0.5 * (held_out_chi(base, k) - held_out_chi(logs_of(best, base), k));
    }
    return nats;
  }

  double rate_hz_;
  ResponseOptions options_;
  double rounding_ = 0;   // variance, mg^2
  double effective_ = 0;  // independent blocks of the spectrum
  std::vector<Bin> bins_;
  std::vector<Ratio> ratios_;
  std::vector<double> tone_hz_;    // in order of appearance: their folds
  std::vector<double> flat_;       // zeros: no gain at any tone
  std::vector<double> mount_log_;  // of a mount that is known while low-passes are searched
  bool tones_count_ = true;        // in the choice of a low-pass
  double freedom_ = 0;             // of the ratios
  Pink pink_;                      // beside the white in fit_noise()
  Pink flat_pink_;                 // beside flat noise
  double flat_nats_ = 0;           // of flat noise, with its 1/f noise
  Response out_;
};

}  // namespace

double Response::correlated_samples(double rate_hz) const {
  constexpr int kFrequencies = 128;
  double square = 0;
  double fourth = 0;
  for (int i = 0; i < kFrequencies; ++i) {
    const double h2 = std::pow(noise_gain(rate_hz / 2 * (i + 0.5) / kFrequencies, rate_hz), 2);
    square += h2 / kFrequencies;
    fourth += h2 * h2 / kFrequencies;
  }
  return fourth / (square * square);
}

Response find_response(const Bundle& bundle, const NoiseSpectrum& noise,
                       const std::vector<ToneFit>& tones, const ResponseOptions& options) {
  return Search(bundle, noise, tones, options).run();
}

}  // namespace sixpoint::gap

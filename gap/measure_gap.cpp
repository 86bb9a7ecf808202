#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

void Diagnoser::measure_gap() {
  const EvidenceSearch::HeldOut held = search_->held_out();
  GapSize& gap = out_.gap;
  gap.floor_mg = held.floor_mg;
  gap.before_mg = std::sqrt(held.before_mg * held.before_mg + extra_mg2_);
  gap.after_mg = held.after_mg;
  gap.before_sigma =
      held.floor_mg > 0
          ? std::sqrt(std::pow(held.before_sigma, 2) + extra_mg2_ / std::pow(held.floor_mg, 2))
          : 0;
  gap.after_sigma = held.after_sigma;
  if (!alarms_.empty()) {
    // What is not explained stays: effects outside means count by what they would have taken off.
    double explained = 0;
    for (const EffectFinding& e : out_.effects) {
      explained += e.nats;
    }
    if (explained == 0) {
      gap.after_mg = gap.before_mg;
      gap.after_sigma = gap.before_sigma;
    }
  }
  const double half = 1.96 * gap.after_mg / std::sqrt(2.0 * std::max(1, held.rows / 3));
  gap.after_interval_mg = {std::max(0.0, gap.after_mg - half), gap.after_mg + half};
  const double open = gap.before_mg * gap.before_mg - gap.floor_mg * gap.floor_mg;
  const double left = std::max(0.0, gap.after_mg * gap.after_mg - gap.floor_mg * gap.floor_mg);
  gap.closed_fraction =
      out_.effects.empty() || open <= 0 ? 0 : std::clamp(1 - left / open, 0.0, 1.0);
  const auto pair = [](double before2, double after2) {
    return std::array<double, 2>{std::sqrt(std::max(0.0, before2)),
                                 std::sqrt(std::max(0.0, after2))};
  };
  gap.by_feature[0] = {held.mean_before_sigma, held.mean_after_sigma};
  double tone_before = std::pow(held.tone_before_sigma, 2);
  double tone_after = std::pow(held.tone_after_sigma, 2);
  if (response_.has_tones) {
    const double tones = std::max<double>(1, static_cast<double>(tones_.size()));
    tone_before += 2 *
                   ((response_.low_pass_significant ? response_.low_pass.tone_nats : 0) +
                    (response_.resonance_significant ? response_.resonance.tone_nats : 0)) /
                   tones;
  }
  gap.by_feature[1] = pair(tone_before, tone_after);
  const double bins =
      3.0 * static_cast<double>(std::max<std::size_t>(1, noise_.frequency_hz.size()));
  double line_nats = 0;
  for (const SpectralLine& line : lines_.lines) {
    line_nats += line.gain_nats;
  }
  gap.by_feature[2] = pair(
      1 + std::max(0.0, response_.noise_flat_sd) * std::sqrt(2 / bins) + 2 * line_nats / bins,
      1 + std::max(0.0, response_.noise_left_sd) * std::sqrt(2 / bins) +
          (accepted("floor_vibration") || accepted("electrical_line") ? 0 : 2 * line_nats / bins));
  double code_before = 1;
  double time_before = 1;
  for (const EffectFinding& e : out_.effects) {
    const CatalogueEntry* entry = find_entry(e.name);
    if (entry != nullptr && (entry->family == "holds" || entry->family == "range" ||
                             entry->family == "number_format" || entry->family == "axes")) {
      code_before += 2 * e.nats / std::max<double>(1, static_cast<double>(codes_.samples)) * 100;
    }
    if (entry != nullptr && entry->family == "timing") {
      time_before += 2 * e.nats / std::max<double>(1, static_cast<double>(timing_.packets));
    }
  }
  gap.by_feature[3] = pair(code_before + std::max(0.0, codes_.spread_sd) * 0.05,
                           1 + std::max(0.0, codes_.spread_sd) * 0.05);
  const double scatter2 =
      timing_.usable ? std::pow(timing_.scatter_ms / (1e3 * kHostStamp_s / std::sqrt(3.0)), 2) : 0;
  gap.by_feature[4] = pair(timing_.usable ? time_before - 1 + scatter2 : 0, scatter2);

  // Where: the nominal simulator's residuals by axis and segment.
  struct Cell {
    double square_mg2 = 0, square = 0, n = 0;
    std::string factor;
  };
  std::map<std::pair<int, std::string>, Cell> cells;
  std::vector<Plots::Residual> plots;
  const Fit& nominal = search_->nominal();
  const Fit& best = search_->best();
  int last_block = -1;
  int k = 0;
  for (Eigen::Index row = 0; row < nominal.residual.size(); ++row) {
    const int b = nominal.row_block[static_cast<std::size_t>(row)];
    k = b == last_block ? k + 1 : 0;
    last_block = b;
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    const Segment& segment = bundle_.segments[block.segment];
    const int axis = k < 3 ? k : k < 6 ? k - 3 : block.axis;
    const double scale =
        std::sqrt(block.white_mg2(k, k) +
                  std::pow(kNominalSeating_deg, 2) * seating_lever(block).row(k).squaredNorm());
    Cell& cell = cells[{axis, segment.name}];
    cell.square += std::pow(nominal.residual[row], 2);
    cell.square_mg2 += std::pow(nominal.residual[row] * scale, 2);
    cell.n += 1;
    cell.factor = block.tone ? (segment.vibration->amplitude_g > 1.5 ? "amplitude" : "frequency")
                  : segment.kind == Segment::Kind::still
                      ? (segment.name == "yaw"                                         ? "yaw"
                         : static_cast<double>(segment.samples) > 60 * bundle_.rate_hz ? "time"
                                                                                       : "pose")
                      : "temperature";
    if (k < 3) {
      const double s0 = nominal.residual[row];
      const double s1 = row < best.residual.size() ? best.residual[row] : 0;
      plots.push_back({axis, segment.name, static_cast<int>(block.segment), block.temperature_c,
                       block.middle_s / 60, s0 * scale, s0, s1 * scale, s1});
    }
  }
  for (const auto& [key, cell] : cells) {
    out_.where.push_back({key.first, key.second, cell.factor, std::sqrt(cell.square_mg2 / cell.n),
                          std::sqrt(cell.square / cell.n)});
  }
  for (const SpectralLine& line : lines_.lines) {
    for (int a = 0; a < 3; ++a) {
      out_.where.push_back({a, "still", fmt::format("frequency {:.2f} Hz", line.frequency_hz),
                            std::abs(line.vector_mg[a]) / M_SQRT2,
                            std::abs(line.vector_mg[a]) / std::max(1e-6, line.sd_mg)});
    }
  }
  if (accepted("settling") || step_.left_without_sd > kAlarm_sd) {
    out_.where.push_back({0, "faces", "time since move", 1000 * step_.amplitude / 2,
                          step_.amplitude / std::max(1e-9, step_.mode.amplitude_sd)});
  }
  std::sort(out_.where.begin(), out_.where.end(),
            [](const Location& a, const Location& b) { return a.sigma > b.sigma; });
  if (out_.where.size() > 20) {
    out_.where.resize(20);
  }
  out_.plots.residuals = std::move(plots);
  plot_allan();
  out_.plots.frequency_hz = noise_.frequency_hz;
  out_.plots.noise_mg2 = noise_.variance_mg2;
  for (std::size_t a = 0; a < 3; ++a) {
    const double rounding = std::pow(1000 / bundle_.accel_scale_lsb_per_g, 2) / 12;
    for (const double f : noise_.frequency_hz) {
      const double h = response_.noise_gain(f, bundle_.rate_hz);
      out_.plots.noise_model_mg2[a].push_back(std::pow(response_.white_mg[a] * h, 2) + rounding);
    }
  }
  for (std::size_t i = 0; i < step_.share.size(); i += 2) {
    const double t = static_cast<double>(i) / bundle_.rate_hz;
    out_.plots.step_s.push_back(t);
    out_.plots.step_share.push_back(step_.share[i]);
    out_.plots.step_model.push_back(accepted("settling") ? step_.model(t) : 0);
  }
  for (const ToneFit& tone : tones_) {
    if (!tone.usable) {
      continue;
    }
    const Segment& s = bundle_.segments[tone.segment];
    const double h = response_.tone_gain(s.vibration->frequency_hz, bundle_.rate_hz);
    const double gain = best.state.gain[tone.axis] * 1000 * s.vibration->amplitude_g;
    out_.plots.tones.push_back({tone.axis, s.vibration->frequency_hz, s.vibration->amplitude_g,
                                gain > 0 ? tone.in_phase_mg[tone.axis] / gain : 0, h});
  }
}

// Overlapping estimate over means of one second (IEEE 1139); masked seconds repeat the last.
void Diagnoser::plot_allan() {
  const Segment* longest = nullptr;
  for (const Segment& segment : bundle_.segments) {
    if (segment.kind == Segment::Kind::still &&
        (longest == nullptr || segment.samples > longest->samples)) {
      longest = &segment;
    }
  }
  const auto second = static_cast<std::size_t>(bundle_.rate_hz);
  if (longest == nullptr || second == 0 || longest->samples < 60 * second) {
    return;
  }
  const Fit& fit = search_->best();
  const std::size_t count = longest->samples / second;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> sum = {0};
    double last = 0;
    for (std::size_t k = 0; k < count; ++k) {
      double total = 0;
      double n = 0;
      for (std::size_t i = 0; i < second; ++i) {
        const std::size_t at = longest->first_sample + k * second + i;
        if ((clean_.flags[at] & (kSampleZero | kSampleHeld | kSampleClipped)) == 0) {
          total += 1000.0 * clean_.samples[at][axis] / bundle_.accel_scale_lsb_per_g;
          n += 1;
        }
      }
      last = n > 0 ? total / n : last;
      sum.push_back(sum.back() + last);
    }
    for (std::size_t m = 1; 4 * m <= count; m *= 2) {
      double square = 0;
      double n = 0;
      for (std::size_t i = 0; i + 2 * m < sum.size(); ++i) {
        const double d = (sum[i + 2 * m] - 2 * sum[i + m] + sum[i]) / static_cast<double>(m);
        square += d * d;
        n += 1;
      }
      const auto tau = static_cast<double>(m);
      const double white = std::pow(response_.white_mg[axis], 2) / (tau * bundle_.rate_hz);
      double slow = 0;
      if (fit.scatter == Scatter::flicker) {
        slow = 2 * std::log(2.0) * flicker_density_mg2(fit.scatter_size);
      } else if (fit.scatter == Scatter::random_walk) {
        slow = fit.scatter_size * fit.scatter_size * tau / 3;
      }
      if (axis == 0) {
        out_.plots.allan_s.push_back(tau);
      }
      out_.plots.allan_mg[axis].push_back(std::sqrt(square / std::max(1.0, 2 * n)));
      out_.plots.allan_nominal_mg[axis].push_back(std::sqrt(white));
      out_.plots.allan_model_mg[axis].push_back(std::sqrt(white + slow));
    }
  }
}

}  // namespace sixpoint::gap

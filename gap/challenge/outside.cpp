#include "gap/challenge/outside.h"

#include <array>

#include "gap/challenge/outside_parts.h"

namespace sixpoint::gap {

namespace {

using namespace outside_parts;

// Random telegraph ("popcorn") noise of a bad contact or a trap in the front end.
Made popcorn(Draw d) {
  const double g = 3 * d.severity / kMgPerG;
  return acting_at(&Parts::sensor, [g, d, next_s = 0.0, up = false](SimulatedBlock& block) mutable {
    constexpr double kMeanStay_s = 20;
    for (std::size_t i = 0; i < block.size(); ++i) {
      while (block.time_s[i] >= next_s) {
        next_s += -kMeanStay_s * std::log(1 - d.random.uniform());
        up = !up;
      }
      block.sensed_g[i][0] += up ? g : 0;
    }
  });
}

// A knock moves the zero once and for all.
Made zero_step(Draw d) {
  const double share = d.between(0.25, 0.75);
  return acting_from(share, [g = 3 * d.severity / kMgPerG](Eigen::Vector3d& sensed) {
    sensed += Eigen::Vector3d(g, -g, g);
  });
}

// The lowest bit of one axis never changes.
Made stuck_bit(Draw d) {
  return stored_effect([axis = d.axis()](gt3x::Counts& counts) {
    counts[axis] = static_cast<std::int16_t>(counts[axis] & ~1);
  });
}

// Sensitivity that differs between the two directions of an axis.
Made asymmetry(Draw d) {
  return sensed_effect([ratio = 3 * d.severity / kMgPerG](Eigen::Vector3d& sensed) {
    sensed.array() += ratio * sensed.array() * (sensed.array() * 20).tanh() * 0.5;
    sensed[1] += ratio * sensed[0] * sensed[2];  // and a cross-axis product
  });
}

// A machine that runs up and down: a line whose frequency wanders.
Made swept_line(Draw d) {
  return acting_at(&Parts::stimulus, [g = 3 * d.severity / kMgPerG,
                                      phase = d.between(0, 6)](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double t = block.time_s[i];
      const double angle = kTwoPi * (14 * t - 4 * 60 / 6.3 * std::cos(6.3 * t / 60));
      block.motion[i].force_lab_g.z() += g * std::sin(angle + phase);
    }
  });
}

// A converter that never gives some of its codes: their neighbours get them.
Made missing_codes(Draw d) {
  const std::array<int, 4> every = {4, 8, 16, 32};
  const int period = every[static_cast<std::size_t>(d.random.below(every.size()))];
  const int code = static_cast<int>(d.random.below(static_cast<std::uint64_t>(period)));
  return stored_effect([axis = d.axis(), period, code,
                        side = d.random.uniform() < 0.5 ? 1 : -1](gt3x::Counts& counts) {
    if (((counts[axis] % period) + period) % period == code) {
      counts[axis] = static_cast<std::int16_t>(counts[axis] + side);
    }
  });
}

// Play in the jig's hinge: the pose falls short of where it was turned to.
Made hinge_backlash(Draw d) {
  auto made = std::make_unique<Parts>();
  auto error = std::make_shared<Eigen::Matrix3d>(Eigen::Matrix3d::Identity());
  made->placement = [error, deg = 0.15 * d.severity](const Placement& at) {
    const Eigen::AngleAxisd moved(at.rotation * at.previous.transpose());
    if (moved.angle() > 0.05) {
      *error = turn_by(-deg * moved.axis());
    }
  };
  made->stimulus = [error](SimulatedBlock& block) {
    for (sim::MotionState& motion : block.motion) {
      motion.rotation = *error * motion.rotation;
    }
  };
  return made;
}

// The gain rises or falls with the rate of change, as behind a leaky coupling.
Made rate_gain(Draw d) {
  return acting_at(&Parts::tone, [per_decade = d.sign() * 0.02 * d.severity](sim::Tone& tone) {
    tone.amplitude_g *= 1 + per_decade * std::log10(std::max(0.1, tone.frequency_hz) / 2);
  });
}

// Something that switches on and off on the same supply moves the zero with it.
Made supply_crosstalk(Draw d) {
  const double period_s = d.between_log(4, 60);
  return added_effect([period_s, on_s = period_s * d.between(0.1, 0.5),
                       g = d.vector_of_mg(2 * d.severity),
                       phase_s = d.between(0, period_s)](double time_s, double) {
    return std::fmod(time_s + phase_s, period_s) < on_s ? g : Eigen::Vector3d::Zero();
  });
}

// A controller that hunts: the zero swings slowly.
Made slow_oscillation(Draw d) {
  return added_effect([g = d.vector_of_mg(2 * d.severity), period_s = d.between_log(25, 700),
                       phase = d.between(0, kTwoPi)](double time_s, double) -> Eigen::Vector3d {
    return g * std::sin(kTwoPi * time_s / period_s + phase);
  });
}

// One axis clips on one side only.
Made one_sided_clip(Draw d) {
  return sensed_effect(
      [axis = d.axis(), side = d.sign(), level_g = d.between(3.5, 7)](Eigen::Vector3d& sensed) {
        double& x = sensed[row(axis)];
        x = side > 0 ? std::min(x, level_g) : std::max(x, -level_g);
      });
}

// The zero goes up one way with the temperature and comes down another.
Made thermal_hysteresis(Draw d) {
  return added_effect([g = d.vector_of_mg(1.5 * d.severity), width_c = d.between(0.5, 4),
                       play_c = 0.0, started = false](double, double t) mutable -> Eigen::Vector3d {
    play_c = started ? std::clamp(play_c, t - width_c, t + width_c) : t;
    started = true;
    return g * ((t - play_c) / width_c);
  });
}

// The nest wears: each time the unit sits a little further off than the time before.
Made seating_walk(Draw d) {
  auto made = std::make_unique<Parts>();
  auto where = std::make_shared<Eigen::Vector3d>(Eigen::Vector3d::Zero());
  made->placement = [where, d](const Placement& at) mutable {
    if (at.anew) {
      const double step_deg = 0.04 * d.severity;
      *where += step_deg * Eigen::Vector3d(d.random.normal(), d.random.normal(), d.random.normal());
    }
  };
  made->stimulus = [where](SimulatedBlock& block) {
    const Eigen::Matrix3d turn = turn_by(*where);
    for (sim::MotionState& motion : block.motion) {
      motion.rotation = turn * motion.rotation;
    }
  };
  return made;
}

// Two packets in the wrong order, now and then: the samples of half a second change places.
Made swapped_packets(Draw d) {
  return acting_at(&Parts::sampling, [d](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i + 50 <= block.size(); i += 50) {
      if (d.random.uniform() < 0.03 * d.severity) {
        for (std::size_t k = 0; k < 25; ++k) {
          std::swap(block.time_s[i + k], block.time_s[i + k + 25]);
        }
      }
    }
  });
}

// The firmware averages neighbours.
Made averaged_neighbours(Draw d) {
  return sensed_effect(
      [last = Eigen::Vector3d(Eigen::Vector3d::Zero()), weight = std::min(0.5, 0.3 * d.severity),
       fresh = true](Eigen::Vector3d& sensed) mutable {
        const Eigen::Vector3d now = sensed;
        // The first of a pose follows itself: what went before was left out.
        const bool near = !fresh && (now - last).cwiseAbs().maxCoeff() < 0.3;
        sensed = near ? Eigen::Vector3d((1 - weight) * now + weight * last) : now;
        last = now;
        fresh = false;
      },
      &Parts::analog);
}

// The gain of one axis or all jumps once.
Made gain_step(Draw d) {
  const double share = d.between(0.2, 0.8);
  return acting_from(share, [ratio = d.vector(0.003 * d.severity)](Eigen::Vector3d& sensed) {
    sensed += ratio.cwiseProduct(sensed);
  });
}

// One axis is read a sample later than the others.
Made delayed_axis(Draw d) {
  return stored_effect([axis = d.axis(), last = std::int16_t{0}](gt3x::Counts& counts) mutable {
    std::swap(counts[axis], last);
  });
}

// Now and then the noise is louder for a while.
Made noise_spells(Draw d) {
  const double period_s = d.between_log(20, 400);
  return acting_at(&Parts::sensor, [d, period_s, on_s = period_s * d.between(0.1, 0.4),
                                    g = 2.5 * d.severity / kMgPerG](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (std::fmod(block.time_s[i], period_s) < on_s) {
        for (double& x : block.sensed_g[i]) {
          x += g * d.random.normal();
        }
      }
    }
  });
}

// Vibration of the table has a narrow band, but no line: the building sways at its own pace.
Made narrow_band(Draw d) {
  const double f = d.between(5, 35);
  const double damping = d.between_log(0.01, 0.08);
  const Eigen::Vector3d direction = d.vector_of_mg(2 * d.severity);
  const double keep = std::exp(-kTwoPi * f * damping * 0.01);
  const double push = std::sqrt(1 - keep * keep);
  const double c = std::cos(kTwoPi * f * 0.01);
  const double s = std::sin(kTwoPi * f * 0.01);
  return motion_effect([=, x = 0.0, y = 0.0](sim::MotionState& motion) mutable {
    const double turned = c * x - s * y;
    y = keep * (s * x + c * y) + push * d.random.normal();
    x = keep * turned + push * d.random.normal();
    motion.force_lab_g += x * direction;
  });
}

// Stiction: the reading stays until the force has moved on by this much.
Made dead_zone(Draw d) {
  return sensed_effect(
      [width = 3 * d.severity / kMgPerG,
       held = Eigen::Vector3d(9, 9, 9)](Eigen::Vector3d& sensed) mutable {
        for (Eigen::Index a = 0; a < 3; ++a) {
          held[a] = std::clamp(held[a], sensed[a] - width, sensed[a] + width);
          sensed[a] = held[a];
        }
      },
      &Parts::analog);
}

// The front end follows no faster than so many g per second.
Made slew_limit(Draw d) {
  return acting_at(&Parts::sensor, [most = 0.8 / d.severity, last = Eigen::Vector3d(9, 9, 9),
                                    end_s = -1.0](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      Eigen::Vector3d& sensed = block.sensed_g[i];
      if (block.time_s[i] < end_s + 0.1) {
        for (Eigen::Index a = 0; a < 3; ++a) {
          sensed[a] = std::clamp(sensed[a], last[a] - most, last[a] + most);
        }
      }
      last = sensed;
      end_s = block.time_s[i];
    }
  });
}

// The low bits are not there: steps of two to eight.
Made coarse_steps(Draw d) {
  return stored_effect([step = d.severity < 0.7   ? 2
                               : d.severity < 1.5 ? 4
                                                  : 8](gt3x::Counts& counts) {
    for (std::int16_t& x : counts) {
      x = static_cast<std::int16_t>(std::lround(static_cast<double>(x) / step) * step);
    }
  });
}

// A higher bit of one axis always reads one.
Made stuck_high_bit(Draw d) {
  return stored_effect(
      [axis = d.axis(), bit = 1 << (1 + static_cast<int>(d.random.below(4)))](
          gt3x::Counts& counts) { counts[axis] = static_cast<std::int16_t>(counts[axis] | bit); });
}

// The zero follows the square of the temperature, or a kink in it.
Made bent_tempco(Draw d) {
  return added_effect([g = d.vector_of_mg(3 * d.severity), kink = d.random.uniform() < 0.5,
                       at_c = d.between(20, 30)](double, double temperature_c) -> Eigen::Vector3d {
    const double x = (temperature_c - at_c) / 12;
    return g * (kink ? std::max(0.0, x) : x * x);
  });
}

// The hand warms the unit at every placement.
Made hand_warmth(Draw d) {
  auto made = std::make_unique<Parts>();
  auto since_s = std::make_shared<double>(-1e9);
  made->placement = [since_s](const Placement& at) {
    if (at.anew) {
      *since_s = at.start_s;
    }
  };
  made->sensor = [since_s, g = d.vector_of_mg(2 * d.severity),
                  tau_s = d.between_log(4, 40)](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += g * std::exp(-std::max(0.0, block.time_s[i] - *since_s) / tau_s);
    }
  };
  return made;
}

// The battery runs down, and the gain with it.
Made battery_droop(Draw d) {
  return acting_at(&Parts::sensor, [per_h = -0.002 * d.severity](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] *= 1 + per_h * block.time_s[i] / 3600;
    }
  });
}

// A machine that runs for a while and rests for a while.
Made blower(Draw d) {
  const double period_s = d.between_log(20, 200);
  return acting_at(&Parts::stimulus,
                   [g = d.vector_of_mg(2 * d.severity), f = d.between(6, 40), period_s,
                    on_s = period_s * d.between(0.2, 0.6)](SimulatedBlock& block) {
                     for (std::size_t i = 0; i < block.size(); ++i) {
                       if (std::fmod(block.time_s[i], period_s) < on_s) {
                         block.motion[i].force_lab_g += g * std::sin(kTwoPi * f * block.time_s[i]);
                       }
                     }
                   });
}

// The board bends under its own weight: how the sensor sits depends on the pose.
Made sagging_board(Draw d) {
  return sensed_effect(
      [deg = 0.1 * d.severity, a = d.axis(), b = d.axis()](Eigen::Vector3d& sensed) {
        Eigen::Vector3d bend = Eigen::Vector3d::Zero();
        bend[row(b)] = deg * sensed[row(a)];
        sensed = turn_by(bend) * sensed;
      });
}

// The sample clock drifts with the temperature.
Made clock_tempco(Draw d) {
  // The chamber's programme as the clock feels it: it swings by 12 C in half an hour.
  return shifted_effect([ppm_per_c = d.sign() * 8 * d.severity](double time_s) {
    return 0.01 * 1e-6 * ppm_per_c * 12 * std::sin(kTwoPi * time_s / 3600);
  });
}

// A buffer overflows now and then: tens of samples are lost in one go.
Made lost_bursts(Draw d) {
  return shifted_effect([d](double) mutable {
    const bool lost = d.random.uniform() < 2e-4 * d.severity;
    return lost ? 0.01 * static_cast<double>(5 + d.random.below(45)) : 0;
  });
}

// For some samples two axes change places.
Made crossed_axes(Draw d) {
  return stored_effect([d, a = d.axis(), left = std::uint64_t{0}](gt3x::Counts& counts) mutable {
    if (left == 0 && d.random.uniform() < 2e-4 * d.severity) {
      left = 1 + d.random.below(100);
    }
    if (left > 0) {
      --left;
      std::swap(counts[a], counts[(a + 1) % kAxes]);
    }
  });
}

// The sensor runs at half the rate that is stored: every value comes twice.
Made half_rate(Draw /*d*/) {
  return acting_at(&Parts::firmware, [last = gt3x::Counts{}](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if ((block.first_sample + i) % 2 == 1 && i > 0) {
        block.stored[i] = last;
      }
      last = block.stored[i];
    }
  });
}

// Knocks against the table.
Made knocks(Draw d) {
  return motion_effect([d, g = Eigen::Vector3d(Eigen::Vector3d::Zero()), age_s = 1e9,
                        f = d.between(8, 30)](sim::MotionState& motion) mutable {
    if (d.random.uniform() < 3e-4) {
      g = d.vector_of_mg(40 * d.severity);
      age_s = 0;
    }
    age_s += 0.01;
    motion.force_lab_g += g * (std::exp(-age_s / 0.15) * std::cos(kTwoPi * f * age_s));
  });
}

// The table settles: its level creeps while the units are measured.
Made creeping_table(Draw d) {
  return acting_at(&Parts::stimulus, [deg = 0.15 * d.severity, direction = d.between(0, kTwoPi),
                                      tau_s = d.between_log(60, 3000)](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double now = deg * (1 - std::exp(-block.time_s[i] / tau_s));
      block.motion[i].rotation =
          block.motion[i].rotation *
          turn_by(now * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0));
    }
  });
}

// One axis is noisier than its kind.
Made noisy_axis(Draw d) {
  return sensed_effect(
      [d, axis = d.axis(), g = 4 * d.severity / kMgPerG](Eigen::Vector3d& sensed) mutable {
        sensed[row(axis)] += g * d.random.normal();
      });
}

// An auto-zero that hunts: the zero ramps off and is set back, again and again.
Made saw_tooth(Draw d) {
  return added_effect([g = d.vector_of_mg(2 * d.severity), period_s = d.between_log(30, 300)](
                          double time_s, double) -> Eigen::Vector3d {
    return g * (std::fmod(time_s, period_s) / period_s);
  });
}

}  // namespace

const std::vector<OutsideKind>& outside_kinds() {
  static const std::vector<OutsideKind> kKinds = [] {
    std::vector<OutsideKind> kinds = {
        outside("popcorn", Stage::sensor, popcorn),
        outside("zero_step", Stage::sensor, zero_step),
        outside("stuck_bit", Stage::firmware, stuck_bit),
        outside("asymmetry", Stage::sensor, asymmetry, "curvature"),
        outside("swept_line", Stage::stimulus, swept_line, "line"),
        outside("missing_codes", Stage::firmware, missing_codes),
        outside("hinge_backlash", Stage::stimulus, hinge_backlash, "repeat"),
        outside("rate_gain", Stage::stimulus, rate_gain, "response", false),
        outside("supply_crosstalk", Stage::sensor, supply_crosstalk),
        outside("slow_oscillation", Stage::sensor, slow_oscillation),
        outside("one_sided_clip", Stage::sensor, one_sided_clip, "range", false),
        outside("thermal_hysteresis", Stage::sensor, thermal_hysteresis, "", false),
        outside("seating_walk", Stage::stimulus, seating_walk, "repeat"),
        outside("swapped_packets", Stage::sampling, swapped_packets, "timing", false),
        outside("averaged_neighbours", Stage::sensor, averaged_neighbours, "response"),
        outside("gain_step", Stage::sensor, gain_step),
        outside("delayed_axis", Stage::firmware, delayed_axis, "", false),
        outside("noise_spells", Stage::sensor, noise_spells),
        outside("narrow_band", Stage::stimulus, narrow_band, "line"),
        // The kinds from here on were written after the diagnosis was frozen (docs/gap.md).
        outside("dead_zone", Stage::sensor, dead_zone),
        outside("slew_limit", Stage::sensor, slew_limit, "", false),
        outside("coarse_steps", Stage::firmware, coarse_steps, "rounding"),
        outside("stuck_high_bit", Stage::firmware, stuck_high_bit),
        outside("bent_tempco", Stage::sensor, bent_tempco, "", false),
        outside("hand_warmth", Stage::sensor, hand_warmth),
        outside("battery_droop", Stage::sensor, battery_droop, "", false),
        outside("blower", Stage::stimulus, blower, "line"),
        outside("sagging_board", Stage::sensor, sagging_board),
        outside("clock_tempco", Stage::sampling, clock_tempco, "timing", false),
        outside("lost_bursts", Stage::sampling, lost_bursts, "timing"),
        outside("crossed_axes", Stage::firmware, crossed_axes),
        outside("half_rate", Stage::firmware, half_rate, "timing"),
        outside("knocks", Stage::stimulus, knocks),
        outside("creeping_table", Stage::stimulus, creeping_table),
        outside("noisy_axis", Stage::sensor, noisy_axis),
        outside("saw_tooth", Stage::sensor, saw_tooth),
    };
    for (OutsideKind& kind : serviced_kinds()) {
      kind.only_by_name = true;
      kinds.push_back(std::move(kind));
    }
    return kinds;
  }();
  return kKinds;
}

}  // namespace sixpoint::gap

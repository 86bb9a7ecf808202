#include "station/gap_outside.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numbers>

namespace sixpoint::station {

namespace {

using sim::Effect;
using sim::EffectKind;
using sim::ParameterSet;
using sim::Placement;
using sim::RecordingPlan;
using sim::SimulatedBlock;
using sim::Stage;

constexpr double kTwoPi = 2 * std::numbers::pi;

// An effect out of functions: each kind sets those it needs.
struct Parts final : Effect {
  std::function<void(const RecordingPlan&)> recording;
  std::function<void(const Placement&)> placement;
  std::function<void(sim::Tone&)> tone;
  std::function<void(SimulatedBlock&)> sampling, stimulus, sensor, analog, firmware;

  void on_recording(const RecordingPlan& plan) override {
    if (recording) {
      recording(plan);
    }
  }
  void on_placement(const Placement& at) override {
    if (placement) {
      placement(at);
    }
  }
  void on_tone(sim::Tone& of) const override {
    if (tone) {
      tone(of);
    }
  }
  void on_sampling(SimulatedBlock& block) override { run(sampling, block); }
  void on_stimulus(SimulatedBlock& block) override { run(stimulus, block); }
  void on_sensor(SimulatedBlock& block) override { run(sensor, block); }
  void on_analog(SimulatedBlock& block) override { run(analog, block); }
  void on_firmware(SimulatedBlock& block) override { run(firmware, block); }

 private:
  static void run(const std::function<void(SimulatedBlock&)>& part, SimulatedBlock& block) {
    if (part) {
      part(block);
    }
  }
};

using Made = std::unique_ptr<Effect>;

// What a kind draws from.
struct Draw {
  double severity;
  Random random;

  double between(double low, double high) { return random.uniform(low, high); }
  double between_log(double low, double high) {
    return std::exp(random.uniform(std::log(low), std::log(high)));
  }
  double sign() { return random.uniform() < 0.5 ? -1 : 1; }
  std::size_t axis() { return static_cast<std::size_t>(random.below(kAxes)); }
  // Three numbers whose largest is `size`, either sign.
  Eigen::Vector3d vector(double size) {
    Eigen::Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
    return v * (size / std::max(v.cwiseAbs().maxCoeff(), 1e-6));
  }
};

Eigen::Matrix3d turn_by(const Eigen::Vector3d& deg) {
  const double angle = deg.norm() * std::numbers::pi / 180;
  return angle < 1e-15 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                       : Eigen::AngleAxisd(angle, deg.normalized()).toRotationMatrix();
}

// A sample number somewhere in the middle half of the recording.
struct Moment {
  double share;
  std::uint64_t sample = 0;
  void in(const RecordingPlan& plan) {
    sample = static_cast<std::uint64_t>(share * static_cast<double>(plan.length()));
  }
};

Eigen::Index row(std::size_t axis) { return static_cast<Eigen::Index>(axis); }

// Random telegraph ("popcorn") noise of a bad contact or a trap in the front end.
Made popcorn(Draw d) {
  auto made = std::make_unique<Parts>();
  const double g = 3 * d.severity / kMgPerG;
  made->sensor = [g, d, next_s = 0.0, up = false](SimulatedBlock& block) mutable {
    constexpr double kMeanStay_s = 20;
    for (std::size_t i = 0; i < block.size(); ++i) {
      while (block.time_s[i] >= next_s) {
        next_s += -kMeanStay_s * std::log(1 - d.random.uniform());
        up = !up;
      }
      block.sensed_g[i][0] += up ? g : 0;
    }
  };
  return made;
}

// A knock moves the zero once and for all.
Made zero_step(Draw d) {
  auto made = std::make_unique<Parts>();
  const double g = 3 * d.severity / kMgPerG;
  auto moment = std::make_shared<Moment>(Moment{d.between(0.25, 0.75)});
  made->recording = [moment](const RecordingPlan& plan) { moment->in(plan); };
  made->sensor = [g, moment](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.first_sample + i >= moment->sample) {
        block.sensed_g[i] += Eigen::Vector3d(g, -g, g);
      }
    }
  };
  return made;
}

// The lowest bit of one axis never changes.
Made stuck_bit(Draw d) {
  auto made = std::make_unique<Parts>();
  made->firmware = [axis = d.axis()](SimulatedBlock& block) {
    for (gt3x::Counts& counts : block.stored) {
      counts[axis] = static_cast<std::int16_t>(counts[axis] & ~1);
    }
  };
  return made;
}

// Sensitivity that differs between the two directions of an axis.
Made asymmetry(Draw d) {
  auto made = std::make_unique<Parts>();
  made->sensor = [ratio = 3 * d.severity / kMgPerG](SimulatedBlock& block) {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      sensed.array() += ratio * sensed.array() * (sensed.array() * 20).tanh() * 0.5;
      sensed[1] += ratio * sensed[0] * sensed[2];  // and a cross-axis product
    }
  };
  return made;
}

// A machine that runs up and down: a line whose frequency wanders.
Made swept_line(Draw d) {
  auto made = std::make_unique<Parts>();
  made->stimulus = [g = 3 * d.severity / kMgPerG, phase = d.between(0, 6)](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double t = block.time_s[i];
      const double angle = kTwoPi * (14 * t - 4 * 60 / 6.3 * std::cos(6.3 * t / 60));
      block.motion[i].force_lab_g.z() += g * std::sin(angle + phase);
    }
  };
  return made;
}

// A converter that never gives some of its codes: their neighbours get them.
Made missing_codes(Draw d) {
  auto made = std::make_unique<Parts>();
  const std::array<int, 4> every = {4, 8, 16, 32};
  const int period = every[static_cast<std::size_t>(d.random.below(every.size()))];
  const int code = static_cast<int>(d.random.below(static_cast<std::uint64_t>(period)));
  made->firmware = [axis = d.axis(), period, code,
                    side = d.random.uniform() < 0.5 ? 1 : -1](SimulatedBlock& block) {
    for (gt3x::Counts& counts : block.stored) {
      if (((counts[axis] % period) + period) % period == code) {
        counts[axis] = static_cast<std::int16_t>(counts[axis] + side);
      }
    }
  };
  return made;
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
  auto made = std::make_unique<Parts>();
  made->tone = [per_decade = d.sign() * 0.02 * d.severity](sim::Tone& tone) {
    tone.amplitude_g *= 1 + per_decade * std::log10(std::max(0.1, tone.frequency_hz) / 2);
  };
  return made;
}

// Something that switches on and off on the same supply moves the zero with it.
Made supply_crosstalk(Draw d) {
  auto made = std::make_unique<Parts>();
  const double period_s = d.between_log(4, 60);
  made->sensor = [period_s, on_s = period_s * d.between(0.1, 0.5),
                  g = d.vector(2 * d.severity) / kMgPerG,
                  phase_s = d.between(0, period_s)](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (std::fmod(block.time_s[i] + phase_s, period_s) < on_s) {
        block.sensed_g[i] += g;
      }
    }
  };
  return made;
}

// A controller that hunts: the zero swings slowly.
Made slow_oscillation(Draw d) {
  auto made = std::make_unique<Parts>();
  made->sensor = [g = d.vector(2 * d.severity) / kMgPerG, period_s = d.between_log(25, 700),
                  phase = d.between(0, kTwoPi)](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += g * std::sin(kTwoPi * block.time_s[i] / period_s + phase);
    }
  };
  return made;
}

// One axis clips on one side only.
Made one_sided_clip(Draw d) {
  auto made = std::make_unique<Parts>();
  made->sensor = [axis = d.axis(), side = d.sign(),
                  level_g = d.between(3.5, 7)](SimulatedBlock& block) {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      double& x = sensed[row(axis)];
      x = side > 0 ? std::min(x, level_g) : std::max(x, -level_g);
    }
  };
  return made;
}

// The zero goes up one way with the temperature and comes down another.
Made thermal_hysteresis(Draw d) {
  auto made = std::make_unique<Parts>();
  made->sensor = [g = d.vector(1.5 * d.severity) / kMgPerG, width_c = d.between(0.5, 4),
                  play_c = 0.0, started = false](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double t = block.temperature_c[i];
      play_c = started ? std::clamp(play_c, t - width_c, t + width_c) : t;
      started = true;
      block.sensed_g[i] += g * ((t - play_c) / width_c);
    }
  };
  return made;
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
  auto made = std::make_unique<Parts>();
  made->sampling = [d](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i + 50 <= block.size(); i += 50) {
      if (d.random.uniform() < 0.03 * d.severity) {
        for (std::size_t k = 0; k < 25; ++k) {
          std::swap(block.time_s[i + k], block.time_s[i + k + 25]);
        }
      }
    }
  };
  return made;
}

// The firmware averages neighbours.
Made averaged_neighbours(Draw d) {
  auto made = std::make_unique<Parts>();
  auto last = std::make_shared<Eigen::Vector3d>(Eigen::Vector3d::Zero());
  made->analog = [last, weight = std::min(0.5, 0.3 * d.severity),
                  fresh = true](SimulatedBlock& block) mutable {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      const Eigen::Vector3d now = sensed;
      // The first of a pose follows itself: what went before was left out.
      const bool near = !fresh && (now - *last).cwiseAbs().maxCoeff() < 0.3;
      sensed = near ? Eigen::Vector3d((1 - weight) * now + weight * *last) : now;
      *last = now;
      fresh = false;
    }
  };
  return made;
}

// The gain of one axis or all jumps once.
Made gain_step(Draw d) {
  auto made = std::make_unique<Parts>();
  auto moment = std::make_shared<Moment>(Moment{d.between(0.2, 0.8)});
  Eigen::Vector3d ratio = d.vector(0.003 * d.severity);
  made->recording = [moment](const RecordingPlan& plan) { moment->in(plan); };
  made->sensor = [moment, ratio](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.first_sample + i >= moment->sample) {
        block.sensed_g[i] += ratio.cwiseProduct(block.sensed_g[i]);
      }
    }
  };
  return made;
}

// One axis is read a sample later than the others.
Made delayed_axis(Draw d) {
  auto made = std::make_unique<Parts>();
  made->firmware = [axis = d.axis(), last = std::int16_t{0}](SimulatedBlock& block) mutable {
    for (gt3x::Counts& counts : block.stored) {
      std::swap(counts[axis], last);
    }
  };
  return made;
}

// Now and then the noise is louder for a while.
Made noise_spells(Draw d) {
  auto made = std::make_unique<Parts>();
  const double period_s = d.between_log(20, 400);
  made->sensor = [d, period_s, on_s = period_s * d.between(0.1, 0.4),
                  g = 2.5 * d.severity / kMgPerG](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (std::fmod(block.time_s[i], period_s) < on_s) {
        for (double& x : block.sensed_g[i]) {
          x += g * d.random.normal();
        }
      }
    }
  };
  return made;
}

// Vibration of the table has a narrow band, but no line: the building sways at its own pace.
Made narrow_band(Draw d) {
  auto made = std::make_unique<Parts>();
  const double f = d.between(5, 35);
  const double damping = d.between_log(0.01, 0.08);
  const Eigen::Vector3d direction = d.vector(2 * d.severity) / kMgPerG;
  made->stimulus = [d, f, damping, direction, x = 0.0, y = 0.0](SimulatedBlock& block) mutable {
    const double keep = std::exp(-kTwoPi * f * damping * 0.01);
    const double push = std::sqrt(1 - keep * keep);
    const double c = std::cos(kTwoPi * f * 0.01);
    const double s = std::sin(kTwoPi * f * 0.01);
    for (sim::MotionState& motion : block.motion) {
      const double turned = c * x - s * y;
      y = keep * (s * x + c * y) + push * d.random.normal();
      x = keep * turned + push * d.random.normal();
      motion.force_lab_g += x * direction;
    }
  };
  return made;
}

template <Made (*kMake)(Draw)>
OutsideKind outside(const char* name, Stage stage, std::string_view family, bool in_faces = true) {
  EffectKind kind = {name,
                     stage,
                     "outside the catalogue",
                     {{"severity", "1", {1}, 0, 10, "drawn"}},
                     [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
                       return kMake(Draw{values.at("severity")[0], random});
                     }};
  return {std::move(kind), family, in_faces};
}

}  // namespace

const std::vector<OutsideKind>& outside_kinds() {
  static const std::vector<OutsideKind> kKinds = {
      outside<popcorn>("popcorn", Stage::sensor, ""),
      outside<zero_step>("zero_step", Stage::sensor, ""),
      outside<stuck_bit>("stuck_bit", Stage::firmware, ""),
      outside<asymmetry>("asymmetry", Stage::sensor, "curvature"),
      outside<swept_line>("swept_line", Stage::stimulus, "line"),
      outside<missing_codes>("missing_codes", Stage::firmware, ""),
      outside<hinge_backlash>("hinge_backlash", Stage::stimulus, "repeat"),
      outside<rate_gain>("rate_gain", Stage::stimulus, "response", false),
      outside<supply_crosstalk>("supply_crosstalk", Stage::sensor, ""),
      outside<slow_oscillation>("slow_oscillation", Stage::sensor, ""),
      outside<one_sided_clip>("one_sided_clip", Stage::sensor, "range", false),
      outside<thermal_hysteresis>("thermal_hysteresis", Stage::sensor, "", false),
      outside<seating_walk>("seating_walk", Stage::stimulus, "repeat"),
      outside<swapped_packets>("swapped_packets", Stage::sampling, "timing", false),
      outside<averaged_neighbours>("averaged_neighbours", Stage::sensor, "response"),
      outside<gain_step>("gain_step", Stage::sensor, ""),
      outside<delayed_axis>("delayed_axis", Stage::firmware, "", false),
      outside<noise_spells>("noise_spells", Stage::sensor, ""),
      outside<narrow_band>("narrow_band", Stage::stimulus, "line"),
  };
  return kKinds;
}

}  // namespace sixpoint::station

// Kinds outside the catalogue that occur in the service of accelerometers. They are drawn only by
// name, and were written without regard to the diagnosis.
#include <array>
#include <limits>

#include "gap/challenge/outside_parts.h"

namespace sixpoint::gap::outside_parts {

namespace {

// The codes of the sensor's own converter: the firmware's constants come later and change them by a
// few percent only.
constexpr double kConverterLsbPerG = 256;
constexpr int kLow12 = -2048;
constexpr int kHigh12 = 2047;

std::int16_t twelve_bits(std::uint32_t bits) {
  const int low = static_cast<int>(bits & 0xFFFU);
  return static_cast<std::int16_t>(low > kHigh12 ? low - 4096 : low);
}
std::uint32_t bits_of(std::int16_t count) { return static_cast<std::uint32_t>(count) & 0xFFFU; }

// Time since the sample before, pauses between the segments included.
struct Stopwatch {
  double last_s = std::numeric_limits<double>::quiet_NaN();
  double lap(double now_s) {
    const double passed_s = std::isnan(last_s) ? 0 : std::max(0.0, now_s - last_s);
    last_s = now_s;
    return passed_s;
  }
};

Eigen::Vector3d direction(Draw& d) {
  return Eigen::Vector3d(d.random.normal(), d.random.normal(), d.random.normal()).normalized();
}

// The adhesive under the sensor creeps: after a change of load the zero goes on moving, and for a
// while it remembers the loads before. A standard linear solid of one or two time constants.
Made stress_creep(Draw d) {
  const double quick_s = d.between_log(5, 40);
  const double slow_s = quick_s * d.between(4, 20);
  const double slow_share = d.random.uniform() < 0.5 ? 0 : d.between(0.2, 0.6);
  return acting_at(&Parts::sensor, [=, ratio = d.vector_of_mg(2 * d.severity), watch = Stopwatch{},
                                    fresh = true, load = Eigen::Vector3d(Eigen::Vector3d::Zero()),
                                    quick = Eigen::Vector3d(Eigen::Vector3d::Zero()),
                                    slow = Eigen::Vector3d(Eigen::Vector3d::Zero())](
                                       SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (fresh) {
        load = quick = slow = block.sensed_g[i];
        fresh = false;
      }
      const double passed_s = watch.lap(block.time_s[i]);
      quick += (1 - std::exp(-passed_s / quick_s)) * (load - quick);
      slow += (1 - std::exp(-passed_s / slow_s)) * (load - slow);
      load = block.sensed_g[i];
      block.sensed_g[i] +=
          ratio.cwiseProduct((1 - slow_share) * (load - quick) + slow_share * (load - slow));
    }
  });
}

// One or two bits of a successive-approximation converter do not weigh what they should: the codes
// step where a bit turns over (differential nonlinearity). One converter for all, or one axis.
Made bit_weight(Draw d) {
  constexpr int kBits = 12;
  std::array<double, kBits> error_lsb{};
  const std::uint64_t wrong = 1 + d.random.below(2);
  for (std::uint64_t i = 0; i < wrong; ++i) {
    error_lsb.at(3 + static_cast<std::size_t>(d.random.below(6))) = d.sign() * d.severity;
  }
  return sensed_effect(
      [error_lsb, all = d.random.uniform() < 0.5, axis = d.axis()](Eigen::Vector3d& sensed) {
        for (std::size_t a = 0; a < kAxes; ++a) {
          if (!all && a != axis) {
            continue;
          }
          double& x = sensed[row(a)];
          const double code = std::clamp(std::round(x * kConverterLsbPerG) - kLow12, 0.0, 4095.0);
          const auto bits = static_cast<std::uint32_t>(code);
          for (std::size_t bit = 0; bit < error_lsb.size(); ++bit) {
            x += ((bits >> bit) & 1U) != 0 ? error_lsb.at(bit) / kConverterLsbPerG : 0;
          }
        }
      },
      &Parts::analog);
}

// The multiplexer's capacitor keeps some charge of the channel before: each axis holds a little of
// the one that was read before it, and the first one of the sample before.
Made channel_crosstalk(Draw d) {
  auto made = std::make_unique<Parts>();
  auto fresh = std::make_shared<bool>(true);
  made->placement = [fresh](const Placement& at) { *fresh = *fresh || !at.contiguous; };
  const std::size_t first = d.axis();
  const std::size_t step = d.random.uniform() < 0.5 ? 1 : 2;
  made->analog =
      [fresh, order = std::array{first, (first + step) % kAxes, (first + 2 * step) % kAxes},
       share = d.sign() * 0.004 * d.severity, kept = 0.0](SimulatedBlock& block) mutable {
        for (Eigen::Vector3d& sensed : block.sensed_g) {
          if (*fresh) {  // the samples before were left out: alike
            kept = sensed[row(order[kAxes - 1])];
            *fresh = false;
          }
          for (const std::size_t axis : order) {
            const double now = sensed[row(axis)];
            sensed[row(axis)] += share * (kept - now);
            kept = now;
          }
        }
      };
  return made;
}

// The ripple of a switching regulator lies near a multiple of the sample rate: what is seen is the
// difference, a slow line that wanders, and moves with the temperature.
Made beating_ripple(Draw d) {
  const double wander_hz = d.between_log(0.05, 0.5);
  const double memory_s = d.between_log(20, 200);
  return added_effect(
      [d, g = d.vector_of_mg(2 * d.severity), wander_hz, memory_s, base_hz = d.between_log(0.2, 6),
       hz_per_c = d.between(-0.05, 0.05), phase = d.between(0, kTwoPi), off_hz = 0.0,
       watch = Stopwatch{}](double time_s, double temperature_c) mutable -> Eigen::Vector3d {
        const double passed_s = watch.lap(time_s);
        const double keep = std::exp(-passed_s / memory_s);
        off_hz = keep * off_hz + wander_hz * std::sqrt(1 - keep * keep) * d.random.normal();
        const double f = base_hz + off_hz + hz_per_c * (temperature_c - 23);
        phase = std::fmod(phase + kTwoPi * f * passed_s, kTwoPi);
        return g * std::sin(phase);
      });
}

// A magnet near the nest pulls at the battery's steel can, and that bends the board. The field is
// fixed in the room and level or steep; steel is drawn alike either way, a magnetised can is not.
Made magnet_pull(Draw d) {
  return acting_at(&Parts::sensor,
                   [field = direction(d), can = direction(d), magnetised = d.random.uniform() < 0.5,
                    g = d.vector_of_mg(2 * d.severity)](SimulatedBlock& block) {
                     for (std::size_t i = 0; i < block.size(); ++i) {
                       const double along = can.dot(block.motion[i].rotation * field);
                       block.sensed_g[i] += g * (magnetised ? along : along * along);
                     }
                   });
}

// The cable turns the unit a little out of its nest: by how much depends on how far its outlet is
// turned from where the cable is held, at once or only when the cable is taut.
Made cable_pull(Draw d) {
  return motion_effect(
      [outlet = direction(d), held = direction(d), deg = 0.15 * d.severity,
       slack = d.random.uniform() < 0.5 ? -1.0 : d.between(-0.5, 0.5)](sim::MotionState& motion) {
        const Eigen::Vector3d out = motion.rotation.transpose() * outlet;
        const double pull = std::max(0.0, -out.dot(held) - slack) / (1 - slack);
        motion.rotation = motion.rotation * turn_by(deg * pull * out.cross(held));
      });
}

// A battery with play in its holder falls to whichever end is down and stays there until it is
// tipped over; where it lies it bends the board. On the shaker it rattles.
Made loose_battery(Draw d) {
  const Eigen::Vector3d slot = direction(d);
  return sensed_effect([slot, sticks_g = d.between(0.2, 0.9) * slot.cwiseAbs().maxCoeff(),
                        end = d.sign(),
                        g = d.vector_of_mg(1.5 * d.severity)](Eigen::Vector3d& sensed) mutable {
    const double along = slot.dot(sensed);
    if (std::abs(along) > sticks_g) {
      end = along > 0 ? 1 : -1;
    }
    sensed += end * g;
  });
}

// From some moment on the battery no longer holds the regulator up, and zero and gain follow it.
Made regulator_dropout(Draw d) {
  auto made = std::make_unique<Parts>();
  auto moment = std::make_shared<Moment>(Moment{d.between(0.2, 0.8)});
  auto length = std::make_shared<double>(0);
  made->recording = [moment, length](const RecordingPlan& plan) {
    moment->in(plan);
    *length = static_cast<double>(plan.length());
  };
  made->sensor = [moment, length, g = d.vector_of_mg(5 * d.severity),
                  loss = d.sign() * 0.002 * d.severity,
                  law = d.between(0.7, 3)](SimulatedBlock& block) {
    const auto from = static_cast<double>(moment->sample);
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double at = static_cast<double>(block.first_sample + i);
      if (at > from && *length > from) {
        const double sag = std::pow((at - from) / (*length - from), law);
        block.sensed_g[i] += sag * (g - loss * block.sensed_g[i]);
      }
    }
  };
  return made;
}

// The two bytes of a register are read while it changes: one is old and one is new. The twelve bits
// lie at the register's top, so that the low byte holds four of them.
Made torn_reads(Draw d) {
  auto made = std::make_unique<Parts>();
  auto fresh = std::make_shared<bool>(true);
  made->placement = [fresh](const Placement& at) { *fresh = *fresh || !at.contiguous; };
  const double chance = d.between_log(0.007, 0.07) * d.severity;
  made->firmware = [fresh, d, chance, new_low = d.random.uniform() < 0.5,
                    last = gt3x::Counts{}](SimulatedBlock& block) mutable {
    constexpr std::uint32_t kLow = 0xF;
    for (gt3x::Counts& counts : block.stored) {
      const gt3x::Counts now = counts;
      for (std::size_t a = 0; a < kAxes && !*fresh; ++a) {
        if (d.random.uniform() < chance) {
          const std::uint32_t low_from = bits_of(new_low ? now[a] : last[a]);
          const std::uint32_t high_from = bits_of(new_low ? last[a] : now[a]);
          counts[a] = twelve_bits((low_from & kLow) | (high_from & ~kLow));
        }
      }
      last = now;
      *fresh = false;
    }
  };
  return made;
}

// The case is ahead of the die when the temperature changes, and what is between them bends: the
// zero follows the difference, not the temperature.
Made thermal_gradient(Draw d) {
  return added_effect([g_per_c = d.vector_of_mg(0.5 * d.severity), lag_s = d.between_log(40, 400),
                       watch = Stopwatch{}, before_c = 0.0, inside_c = 0.0,
                       fresh = true](double time_s, double outside_c) mutable -> Eigen::Vector3d {
    const double passed_s = watch.lap(time_s);
    if (fresh) {
      inside_c = before_c = outside_c;
      fresh = false;
    } else if (passed_s > 0) {  // a first-order lag behind a straight line, exactly
      const double behind_c = (outside_c - before_c) / passed_s * lag_s;
      inside_c =
          outside_c - behind_c + (inside_c - before_c + behind_c) * std::exp(-passed_s / lag_s);
      before_c = outside_c;
    }
    return g_per_c * (outside_c - inside_c);
  });
}

// Once, or up to three times, the operator put the unit in another way than the list says. Only
// where it is known when the unit rests.
Made wrong_pose(Draw d) {
  auto made = std::make_unique<Parts>();
  std::vector<double> shares(d.severity <= 0 ? 0 : d.severity < 1 ? 1 : d.severity < 2 ? 2 : 3);
  for (double& share : shares) {
    share = d.random.uniform();
  }
  struct State {
    std::vector<RecordingPlan::Stretch> rests;
    bool wrong = false;
  };
  auto state = std::make_shared<State>();
  made->recording = [state, shares](const RecordingPlan& plan) {
    for (const double share : shares) {
      if (!plan.rests.empty()) {
        state->rests.push_back(
            plan.rests[static_cast<std::size_t>(share * static_cast<double>(plan.rests.size()))]);
      }
    }
  };
  made->placement = [state](const Placement& at) { state->wrong = state->wrong && !at.anew; };
  made->stimulus = [state, axis = d.axis(),
                    quarters = static_cast<double>(1 + d.random.below(3))](SimulatedBlock& block) {
    for (const RecordingPlan::Stretch& rest : state->rests) {
      state->wrong = state->wrong || (block.first_sample >= rest.first_sample &&
                                      block.first_sample < rest.first_sample + rest.samples);
    }
    if (!state->wrong || block.motion.empty()) {
      return;
    }
    // A turn about the vertical would not be seen: then it is the next axis.
    const double up = block.motion.front().rotation.col(2)[row(axis)];
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    turn[row(std::abs(up) > 0.9 ? (axis + 1) % kAxes : axis)] = 90 * quarters;
    for (sim::MotionState& motion : block.motion) {
      motion.rotation = turn_by(turn) * motion.rotation;
    }
  };
  return made;
}

// The memory or the bus loses bits now and then: one bit turns over, two nibbles of a number change
// places, or a few samples on end are nonsense.
Made bit_errors(Draw d) {
  return stored_effect(
      [d, law = d.random.below(3), left = std::uint64_t{0}](gt3x::Counts& counts) mutable {
        const bool hit = d.random.uniform() < 1e-3 * d.severity;
        std::int16_t& one = counts[d.axis()];
        const std::uint32_t bits = bits_of(one);
        if (law == 0 && hit) {
          one = twelve_bits(bits ^ (1U << static_cast<std::uint32_t>(d.random.below(12))));
        } else if (law == 1 && hit) {
          one = twelve_bits((bits & 0xF00U) | ((bits & 0xFU) << 4U) | ((bits >> 4U) & 0xFU));
        } else if (law == 2) {
          left = hit ? 1 + d.random.below(10) : left;
          if (left > 0) {
            --left;
            for (std::int16_t& x : counts) {
              x = twelve_bits(static_cast<std::uint32_t>(d.random.below(4096)));
            }
          }
        }
      });
}

// Vibration shifts the zero although rest does not bend it: damping that differs between the two
// directions rectifies. Each axis by its own vibration, or by all of it.
Made vibration_rectification(Draw d) {
  auto made = std::make_unique<Parts>();
  auto fresh = std::make_shared<bool>(true);
  made->placement = [fresh](const Placement& at) { *fresh = *fresh || at.anew; };
  made->sensor = [fresh, per_g = d.vector_of_mg(2 * d.severity), of_all = d.random.uniform() < 0.5,
                  tau_s = d.between(0.5, 2), watch = Stopwatch{},
                  mean = Eigen::Vector3d(Eigen::Vector3d::Zero()),
                  power = Eigen::Vector3d(Eigen::Vector3d::Zero())](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double follow = 1 - std::exp(-watch.lap(block.time_s[i]) / tau_s);
      if (*fresh) {
        mean = block.sensed_g[i];
        power.setZero();
        *fresh = false;
      }
      mean += follow * (block.sensed_g[i] - mean);
      const Eigen::Vector3d moving = block.sensed_g[i] - mean;
      power += follow * (moving.cwiseAbs2() - power);
      block.sensed_g[i] += of_all ? Eigen::Vector3d(per_g * power.sum())
                                  : Eigen::Vector3d(per_g.cwiseProduct(power));
    }
  };
  return made;
}

// A firmware that calibrates itself: after two seconds at rest it scales all axes towards a length
// of 1 g, and keeps that scale until the next rest.
Made self_calibration(Draw d) {
  return acting_at(
      &Parts::firmware,
      [share = std::min(1.0, 0.5 * d.severity), tau_s = d.between_log(1, 20), watch = Stopwatch{},
       still = 0, scale = 1.0,
       smooth = Eigen::Vector3d(Eigen::Vector3d::Zero())](SimulatedBlock& block) mutable {
        constexpr double kMoves_lsb = 12;
        constexpr int kStill = 200;
        constexpr double kSmooth = 0.03;  // per sample
        for (std::size_t i = 0; i < block.size(); ++i) {
          gt3x::Counts& counts = block.stored[i];
          const Eigen::Vector3d now(counts[0], counts[1], counts[2]);
          const double passed_s = watch.lap(block.time_s[i]);
          if ((now - smooth).cwiseAbs().maxCoeff() > kMoves_lsb) {
            still = 0;
            smooth = now;
          } else {
            ++still;
            smooth += kSmooth * (now - smooth);
          }
          if (still >= kStill && smooth.norm() > 0.5 * kConverterLsbPerG) {
            const double wanted = 1 + share * (kConverterLsbPerG / smooth.norm() - 1);
            scale += (1 - std::exp(-passed_s / tau_s)) * (wanted - scale);
          }
          for (std::int16_t& x : counts) {
            const long scaled = std::lround(scale * static_cast<double>(x));
            x = static_cast<std::int16_t>(std::clamp<long>(scaled, kLow12, kHigh12));
          }
        }
      });
}

// The converter's reference is noisy: all axes change together, each in proportion to its load.
// White, or of a corner below which it is.
Made reference_noise(Draw d) {
  const bool white = d.random.uniform() < 0.4;
  return acting_at(&Parts::sensor,
                   [d, share = 0.005 * d.severity, white, corner_hz = d.between_log(0.2, 15),
                    x = 0.0, watch = Stopwatch{}](SimulatedBlock& block) mutable {
                     for (std::size_t i = 0; i < block.size(); ++i) {
                       const double passed_s = watch.lap(block.time_s[i]);
                       const double keep = white ? 0 : std::exp(-kTwoPi * corner_hz * passed_s);
                       x = keep * x + std::sqrt(1 - keep * keep) * d.random.normal();
                       block.sensed_g[i] *= 1 + share * x;
                     }
                   });
}

// The shaker's table does not go straight: it moves sideways as well, alike at all frequencies,
// more the faster, or most at a resonance of its suspension.
Made transverse_shaker(Draw d) {
  return acting_at(
      &Parts::tone, [side = direction(d), most = 0.04 * d.severity, law = d.random.below(3),
                     resonance_hz = d.between(4, 35), width_hz = d.between(1, 6)](sim::Tone& tone) {
        const double f = tone.frequency_hz;
        const double off = (f - resonance_hz) / width_hz;
        const double share = law == 0 ? most : law == 1 ? most * f / 20 : most / (1 + off * off);
        const Eigen::Vector3d along = tone.direction_lab;
        const Eigen::Vector3d across = side - along * along.dot(side);
        tone.direction_lab += share * across.normalized();
      });
}

}  // namespace

std::vector<OutsideKind> serviced_kinds() {
  return {
      outside("stress_creep", Stage::sensor, stress_creep),
      outside("bit_weight", Stage::sensor, bit_weight),
      // At rest it is a matrix of cross-axis terms and is repaired like one.
      outside("channel_crosstalk", Stage::sensor, channel_crosstalk, "geometry"),
      // An electrical line, too, leads to the supply.
      outside("beating_ripple", Stage::sensor, beating_ripple, "line"),
      outside("magnet_pull", Stage::sensor, magnet_pull),
      outside("cable_pull", Stage::stimulus, cable_pull),
      outside("loose_battery", Stage::sensor, loose_battery),
      outside("regulator_dropout", Stage::sensor, regulator_dropout),
      outside("torn_reads", Stage::firmware, torn_reads),
      outside("thermal_gradient", Stage::sensor, thermal_gradient, "", false),
      outside("wrong_pose", Stage::stimulus, wrong_pose),
      outside("bit_errors", Stage::firmware, bit_errors),
      outside("vibration_rectification", Stage::sensor, vibration_rectification, "", false),
      outside("self_calibration", Stage::firmware, self_calibration),
      outside("reference_noise", Stage::sensor, reference_noise),
      outside("transverse_shaker", Stage::stimulus, transverse_shaker, "", false),
  };
}

}  // namespace sixpoint::gap::outside_parts

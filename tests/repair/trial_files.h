// Files of made units whose true motion is known, and the constants that people might apply to
// them: right ones, another unit's, withdrawn ones. Shares no code with what is under test: motion,
// sensor and firmware are written out here and in made_recording.h.
//
//   Trial trial(seed, number);
//   trial.write_file(memory.files, "in.gt3x");
//   trial.rms_mg(memory.files, "in.gt3x");   // against the true motion
//
// What a unit is like follows the units that were seen (shared/design/domain.md): zeros under
// `current` stand 0 to 0.14 g (X), 0.13 to 0.2 g (Y) and 0.1 to 0.14 g (Z) beside the stored ones,
// cross-axis sensitivity below 1 %, noise 2 to 4 mg. Another temperature than the jig's moves each
// zero by up to 10 mg (0.5 mg/C, datasheet, and 20 C).
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "base/random.h"
#include "calib/constants.h"
#include "repair/made_recording.h"

namespace sixpoint::tests {

struct TrialUnit {
  std::string serial;
  StoredConstants stored;  // of `legacy`
  PerAxis<double> lsb_per_g{};
  PerAxis<double> zero_lsb{};
  std::array<PerAxis<double>, 3> cross{};  // off the diagonal

  TrialUnit(Random& random, std::string its_serial) : serial(std::move(its_serial)) {
    const PerAxis<double> low_g = {0.0, 0.13, 0.10};
    const PerAxis<double> high_g = {0.14, 0.20, 0.14};
    for (std::size_t a = 0; a < kAxes; ++a) {
      lsb_per_g[a] = 250 * (1 + 0.02 * random.normal());
      const double legacy_lsb = 40 + 15 * random.normal();
      const double span = 2 * lsb_per_g[a] * (1 + 0.015 * random.normal());
      const double middle = legacy_lsb + 4 * random.normal();
      stored.zero_lsb[a] = static_cast<int>(std::lround(legacy_lsb));
      stored.positive_lsb[a] = static_cast<int>(std::lround(middle + span / 2));
      stored.negative_lsb[a] = static_cast<int>(std::lround(middle - span / 2));
      zero_lsb[a] = legacy_lsb + lsb_per_g[a] * random.uniform(low_g[a], high_g[a]);
    }
    for (std::size_t a = 0; a < kAxes; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        cross[a][b] = cross[b][a] = 0.004 * random.normal();
      }
    }
  }

  PerAxis<int> sense(const PerAxis<double>& g, const PerAxis<double>& warm_g, double noise_g,
                     Random& random) const {
    PerAxis<int> raw{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      double value_g = g[a] + warm_g[a] + noise_g * random.normal();
      for (std::size_t b = 0; b < kAxes; ++b) {
        value_g += cross[a][b] * g[b];
      }
      raw[a] = static_cast<int>(std::lround(zero_lsb[a] + value_g * lsb_per_g[a]));
    }
    return raw;
  }
};

// What a jig makes of a unit: 1.5 mg of zero and 0.15 % of sensitivity, as it states.
inline calib::ConstantsRecord jig_record(const TrialUnit& unit, Random& random) {
  calib::ConstantsRecord record;
  record.serial = unit.serial;
  record.filter = calib::FilterConfiguration::current;
  record.method = "six_pose";
  record.made_at = from_unix_seconds(1'700'000'000);
  for (std::size_t a = 0; a < kAxes; ++a) {
    record.calibration.sensitivity_g_per_lsb[a] =
        (1 + 0.0015 * random.normal()) / unit.lsb_per_g[a];
    record.calibration.zero_lsb[a] =
        unit.zero_lsb[a] + 0.0015 * random.normal() * unit.lsb_per_g[a];
    record.uncertainty.sensitivity_relative[a] = 0.0015;
    record.uncertainty.zero_mg[a] = 1.5;
    const double zero_lsb = record.calibration.zero_lsb[a];
    record.stored.zero_lsb[a] = static_cast<int>(std::lround(zero_lsb));
    record.stored.positive_lsb[a] = static_cast<int>(std::lround(zero_lsb + unit.lsb_per_g[a]));
    record.stored.negative_lsb[a] = static_cast<int>(std::lround(zero_lsb - unit.lsb_per_g[a]));
  }
  return record;
}

class Trial {
 public:
  // `few`: a file with one to three still periods, which hardly show what its constants do.
  Trial(std::uint64_t seed, std::uint64_t number, bool few = false)
      : random_(seed, number),
        unit_(random_, fmt::format("MOS2A{:08}", 10'000'000 + number)),
        other_(random_, fmt::format("MOS2A{:08}", 20'000'000 + number)),
        right_(jig_record(unit_, random_)),
        wrong_(jig_record(other_, random_)) {
    wrong_.serial = unit_.serial;  // a label on the wrong unit
    gravity_g_ = 1 + 0.001 * random_.normal();
    make_motion(few);
  }

  const TrialUnit& unit() const { return unit_; }
  const calib::ConstantsRecord& right() const { return right_; }
  const calib::ConstantsRecord& wrong() const { return wrong_; }

  // What the unit stored while it was worn.
  Status write_file(FileSystem& files, const std::string& path) {
    return recorded(unit_, unit_.serial, kWarm_mg).write(files, path);
  }

  // The same file after other software applied the right constants: new samples, the old header.
  Status write_corrected_file(FileSystem& files, const std::string& path) {
    MadeRecording made = recorded(unit_, unit_.serial, kWarm_mg);
    Bytes log;
    gt3x::append_record(log, gt3x::RecordType::parameters, made.start - 1, made.parameters());
    for (std::size_t second = 0; second * made.rate_hz < made.raw.size(); ++second) {
      std::vector<gt3x::Counts> samples;
      for (std::size_t i = second * made.rate_hz;
           i < std::min((second + 1) * made.rate_hz, made.raw.size()); ++i) {
        gt3x::Counts counts{};
        for (std::size_t a = 0; a < kAxes; ++a) {
          const double value_g = right_.calibration.sensitivity_g_per_lsb[a] *
                                 (made.raw[i][a] - right_.calibration.zero_lsb[a]);
          counts[a] = static_cast<std::int16_t>(std::lround(256 * value_g));
        }
        samples.push_back(counts);
      }
      Bytes payload;
      gt3x::append_activity(payload, samples);
      gt3x::append_record(log, gt3x::RecordType::activity,
                          made.start + static_cast<std::uint32_t>(second), payload);
    }
    return made.write(files, path, log);
  }

  // A calibration file of the other unit, under that unit's serial number or under this one's.
  Status write_swapped_calibration_file(FileSystem& files, const std::string& path,
                                        bool wrong_label) {
    const std::vector<PerAxis<double>> worn = std::move(motion_);
    motion_.clear();
    for (int pose = 0; pose < 26; ++pose) {
      stay(direction(), 12);
    }
    MadeRecording made = recorded(other_, wrong_label ? unit_.serial : other_.serial, kWarm_mg);
    motion_ = worn;
    return made.write(files, path);
  }

  // Root mean square of all axes of all samples against the true motion.
  double rms_mg(FileSystem& files, const std::string& path) const {
    const auto samples = samples_of(files, path);
    double sum = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        sum += std::pow(samples[i][a] / 256.0 - motion_.at(i)[a], 2);
      }
    }
    return 1000 * std::sqrt(sum / static_cast<double>(kAxes * samples.size()));
  }

 private:
  static constexpr double kWarm_mg = 10;

  PerAxis<double> direction() {
    PerAxis<double> up = {random_.normal(), random_.normal(), random_.normal()};
    const double length = std::hypot(up[0], up[1], up[2]);
    return {up[0] / length, up[1] / length, up[2] / length};
  }
  void stay(const PerAxis<double>& up, int seconds) {
    for (int i = 0; i < 30 * seconds; ++i) {
      motion_.push_back({gravity_g_ * up[0], gravity_g_ * up[1], gravity_g_ * up[2]});
    }
  }
  void move(int seconds) {
    const PerAxis<double> up = direction();
    const double turns = random_.uniform(0.2, 2.5);
    for (int i = 0; i < 30 * seconds; ++i) {
      PerAxis<double> g{};
      for (std::size_t a = 0; a < kAxes; ++a) {
        g[a] =
            up[a] + random_.uniform(0.2, 0.6) * std::sin(turns * i * 0.2 + static_cast<double>(a));
      }
      motion_.push_back(g);
    }
  }
  // Four to thirty still periods, half of them in the few directions that a worn unit has most
  // often.
  void make_motion(bool few) {
    const std::uint64_t still = few ? 1 + random_.below(3) : 4 + random_.below(27);
    std::vector<PerAxis<double>> usual;
    for (int i = 0; i < 6; ++i) {
      usual.push_back(direction());
    }
    for (std::uint64_t i = 0; i < still; ++i) {
      const bool is_usual = random_.below(2) == 0;
      stay(is_usual ? usual[random_.below(usual.size())] : direction(),
           6 + static_cast<int>(random_.below(15)));
      move(3 + static_cast<int>(random_.below(10)));
    }
  }
  MadeRecording recorded(const TrialUnit& unit, const std::string& serial, double warm_mg) {
    MadeRecording made;
    made.serial = serial;
    made.constants = unit.stored;
    PerAxis<double> warm_g{};
    for (double& value : warm_g) {
      value = random_.uniform(-warm_mg, warm_mg) / 1000;
    }
    const double noise_g = random_.uniform(0.002, 0.004);
    for (const PerAxis<double>& g : motion_) {
      made.raw.push_back(unit.sense(g, warm_g, noise_g, random_));
    }
    return made;
  }

  Random random_;
  TrialUnit unit_;
  TrialUnit other_;
  calib::ConstantsRecord right_;
  calib::ConstantsRecord wrong_;
  double gravity_g_ = 1;
  std::vector<PerAxis<double>> motion_;
};

}  // namespace sixpoint::tests

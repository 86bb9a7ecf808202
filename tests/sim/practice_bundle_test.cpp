// The effects against an oracle: bundles of an independent generator, with its labels.
#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <fstream>
#include <numbers>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/env.h"
#include "expect_result.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"
#include "shared_data.h"
#include "sim/scenario.h"

namespace sixpoint::sim {
namespace {

nlohmann::json read_json(const std::string& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

std::vector<std::vector<double>> read_csv(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    std::string cell;
    rows.emplace_back();
    while (std::getline(cells, cell, ',')) {
      rows.back().push_back(std::stod(cell));
    }
  }
  return rows;
}

struct Practice {
  nlohmann::json protocol;
  nlohmann::json effects;  // as a scenario has them
  std::vector<gt3x::Counts> counts;
  std::vector<std::vector<double>> temperature;
  std::vector<std::vector<double>> clock;

  Scenario scenario(bool with_effects) const {
    nlohmann::json json;
    json["seed"] = 3;
    json["protocol"] = protocol["segments"];
    // The log's noise is not the unit's: smoothed over half a minute.
    json["temperature"] = nlohmann::json::array();
    for (std::size_t i = 0; i < temperature.size(); i += 10) {
      const std::size_t low = i < 15 ? 0 : i - 15;
      const std::size_t high = std::min(temperature.size(), i + 16);
      double sum = 0;
      for (std::size_t k = low; k < high; ++k) {
        sum += temperature[k][1];
      }
      json["temperature"].push_back({temperature[i][0], sum / static_cast<double>(high - low)});
    }
    json["unit"] = {{"gain", {1, 1, 1}}, {"offset_g", {0, 0, 0}}, {"noise_mg", {3.9, 3.9, 5.5}}};
    json["seating_sd_deg"] = 0;
    json["effects"] = with_effects ? effects : nlohmann::json::array();
    auto parsed = parse_scenario(json.dump());
    EXPECT_TRUE(parsed) << parsed.error().what << " " << parsed.error().where;
    return parsed ? *parsed : Scenario{};
  }
};

Practice read_practice(const std::string& name) {
  const std::string folder = tests::shared_file("gap/practice/" + name);
  Practice practice;
  practice.protocol = read_json(folder + "/protocol.json");
  practice.effects = nlohmann::json::array();
  const nlohmann::json labels = read_json(tests::shared_file("gap/practice/labels.json"));
  for (const nlohmann::json& effect : labels[name]["effects"]) {
    practice.effects.push_back({{"name", effect["name"]}, {"parameters", effect["parameters"]}});
  }
  practice.temperature = read_csv(folder + "/temperature.csv");
  practice.clock = read_csv(folder + "/host_clock.csv");
  auto recording = gt3x::Recording::open(posix_env().files, folder + "/recording.gt3x");
  EXPECT_OK(recording);
  gt3x::SampleReader samples(*recording);
  for (;;) {
    auto item = samples.next();
    EXPECT_OK(item);
    if (!item || !*item) {
      break;
    }
    if ((*item)->kind == gt3x::SampleItem::Kind::recorded) {
      practice.counts.insert(practice.counts.end(), (*item)->counts.begin(), (*item)->counts.end());
    }
  }
  return practice;
}

double value(const gt3x::Counts& counts, std::size_t axis) { return counts[axis]; }

// Means of the dwells at rest, after the mount has settled, in mg; per axis. Dwells with samples
// that firmware made up (zeros, held values) are left out.
PerAxis<std::vector<double>> dwell_means(const std::vector<ProtocolSegment>& segments,
                                         const std::vector<gt3x::Counts>& counts,
                                         const std::vector<gt3x::Counts>& clean) {
  PerAxis<std::vector<double>> means;
  for (const ProtocolSegment& segment : segments) {
    if (segment.vibration) {
      continue;
    }
    // Ramps are cut into minutes: their temperature moves.
    constexpr std::uint64_t kPiece = 6000;
    for (std::uint64_t first = segment.first_sample; first < segment.first_sample + segment.samples;
         first += kPiece) {
      const std::uint64_t end = std::min(first + kPiece, segment.first_sample + segment.samples);
      bool made_up = false;
      PerAxis<double> sum{};
      double n = 0;
      for (std::uint64_t i = first + 300; i < end; ++i) {
        made_up = made_up || clean[i] == gt3x::Counts{} ||
                  (i > first + 303 && clean[i] == clean[i - 1] && clean[i] == clean[i - 2] &&
                   clean[i] == clean[i - 3]);
        n += 1;
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
          sum[axis] += value(counts[i], axis) / 0.256;
        }
      }
      for (std::size_t axis = 0; axis < kAxes && n > 0 && !made_up; ++axis) {
        means[axis].push_back(sum[axis] / n);
      }
    }
  }
  return means;
}

// Root mean square of what is left of `real` after the best gain and offset on `model`.
double rms_after_line(const std::vector<double>& real, const std::vector<double>& model) {
  const auto n = static_cast<Eigen::Index>(real.size());
  Eigen::MatrixXd basis(n, 2);
  Eigen::VectorXd target(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    basis(i, 0) = model[static_cast<std::size_t>(i)];
    basis(i, 1) = 1;
    target[i] = real[static_cast<std::size_t>(i)];
  }
  const Eigen::Vector2d solution = basis.colPivHouseholderQr().solve(target);
  return std::sqrt((target - basis * solution).squaredNorm() / static_cast<double>(n));
}

double worst_rms_mg(const Practice& practice, bool with_effects) {
  Scenario scenario = practice.scenario(with_effects);
  // Where firmware made samples up is drawn: the recording's own places are left out instead.
  std::erase_if(scenario.protocol->effects,
                [](const EffectSpec& effect) { return effect.kind->stage == Stage::firmware; });
  const auto simulated = run_protocol(*scenario.protocol);
  EXPECT_OK(simulated);
  const auto& segments = scenario.protocol->segments;
  // Made-up samples are looked for in the recording, and left out on both sides.
  const auto real = dwell_means(segments, practice.counts, practice.counts);
  const auto model = dwell_means(segments, *simulated, practice.counts);
  double worst = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    worst = std::max(worst, rms_after_line(real[axis], model[axis]));
  }
  return worst;
}

// Least squares amplitude and phase of a tone in stored counts, as one complex number in g.
std::complex<double> tone_of(const std::vector<gt3x::Counts>& counts, std::uint64_t first,
                             std::uint64_t samples, std::size_t axis, double frequency_hz) {
  std::complex<double> sum = 0;
  double mean = 0;
  for (std::uint64_t i = 0; i < samples; ++i) {
    mean += value(counts[first + i], axis) / static_cast<double>(samples);
  }
  for (std::uint64_t i = 0; i < samples; ++i) {
    const double angle = -2 * std::numbers::pi * frequency_hz * static_cast<double>(i) / 100;
    sum += (value(counts[first + i], axis) - mean) * std::polar(1.0, angle);
  }
  return sum * 2.0 / static_cast<double>(samples) / 256.0;
}

struct Noise {
  double sd_mg = 0;
  double lag1 = 0;
};
Noise noise_of(const std::vector<gt3x::Counts>& counts, std::uint64_t first, std::uint64_t samples,
               std::size_t axis) {
  double mean = 0;
  for (std::uint64_t i = 0; i < samples; ++i) {
    mean += value(counts[first + i], axis) / static_cast<double>(samples);
  }
  double variance = 0;
  double product = 0;
  for (std::uint64_t i = 0; i + 1 < samples; ++i) {
    const double a = value(counts[first + i], axis) - mean;
    variance += a * a;
    product += a * (value(counts[first + i + 1], axis) - mean);
  }
  return {std::sqrt(variance / static_cast<double>(samples)) / 0.256, product / variance};
}

const ProtocolSegment& segment_of(const Scenario& scenario, std::string_view name) {
  for (const ProtocolSegment& segment : scenario.protocol->segments) {
    if (segment.name == name) {
      return segment;
    }
  }
  ADD_FAILURE() << name;
  return scenario.protocol->segments.front();
}

struct Simulated {
  Practice practice;
  Scenario scenario;
  std::vector<gt3x::Counts> counts;
};
Simulated simulated_practice(const std::string& name) {
  Practice practice = read_practice(name);
  Scenario scenario = practice.scenario(true);
  auto counts = run_protocol(*scenario.protocol);
  EXPECT_OK(counts);
  return {std::move(practice), std::move(scenario), *std::move(counts)};
}

#define SIXPOINT_NEED_PRACTICE() SIXPOINT_NEED_SHARED("gap/practice/labels.json")

// With the label's parameters on, the model meets the means of every dwell at rest: what is left is
// seating of 0.01 degree (0.17 mg), the noise of a dwell's mean, and the log's smoothing.
TEST(PracticeBundles, LabelledEffectsExplainTheMeans) {
  SIXPOINT_NEED_PRACTICE();
  struct Case {
    const char* name;
    double least_without_mg;  // a floor for the gap that the effect leaves
  };
  for (const Case& c :
       {Case{"engineering/b0002", 0.6}, Case{"engineering/b0003", 0}, Case{"engineering/b0004", 0},
        Case{"engineering/b0005", 0}, Case{"engineering/b0006", 0}, Case{"engineering/b0009", 1},
        Case{"engineering/b0011", 100}, Case{"engineering/b0015", 0}, Case{"engineering/b0017", 0},
        Case{"engineering/b0018", 1}, Case{"engineering/b0019", 1}, Case{"engineering/b0021", 2},
        Case{"engineering/b0022", 1}, Case{"engineering/b0023", 0.6}, Case{"engineering/b0024", 2},
        Case{"production/b0009", 2}}) {
    const Practice practice = read_practice(c.name);
    const double with_mg = worst_rms_mg(practice, true);
    // A production bundle has 16 dwells or so, and noise on both sides.
    EXPECT_LT(with_mg, practice.protocol["segments"].size() > 50 ? 0.4 : 0.6)
        << c.name << " " << practice.effects;
    if (c.least_without_mg > 0) {
      EXPECT_GT(worst_rms_mg(practice, false), c.least_without_mg) << c.name;
    }
  }
}

// Signal and noise behind the label's low-pass: the tones' response and the noise's size and
// colour.
TEST(PracticeBundles, BandwidthShapesTonesAndNoise) {
  SIXPOINT_NEED_PRACTICE();
  const auto [practice, scenario, simulated] = simulated_practice("engineering/b0008");
  PerAxis<std::complex<double>> real_low{};
  PerAxis<std::complex<double>> model_low{};
  for (const ProtocolSegment& segment : scenario.protocol->segments) {
    if (segment.name != "shaker") {
      continue;
    }
    Eigen::Index axis = 0;
    (segment.rotation * segment.vibration->direction_lab).cwiseAbs().maxCoeff(&axis);
    const auto a = static_cast<std::size_t>(axis);
    const double frequency_hz = segment.vibration->frequency_hz;
    const auto real =
        tone_of(practice.counts, segment.first_sample, segment.samples, a, frequency_hz);
    const auto model = tone_of(simulated, segment.first_sample, segment.samples, a, frequency_hz);
    if (frequency_hz == 2) {
      real_low[a] = real / segment.vibration->amplitude_g;
      model_low[a] = model / segment.vibration->amplitude_g;
    }
    EXPECT_NEAR(std::abs(real / real_low[a]), std::abs(model / model_low[a]), 0.004)
        << frequency_hz << " Hz, axis " << a;
  }
  const ProtocolSegment& still = segment_of(scenario, "still");
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const Noise real = noise_of(practice.counts, still.first_sample, still.samples, axis);
    const Noise model = noise_of(simulated, still.first_sample, still.samples, axis);
    EXPECT_NEAR(real.sd_mg / model.sd_mg, 1, 0.1);  // the unit's noise is free within 10 %
    EXPECT_NEAR(real.lag1, model.lag1, 0.03);
    EXPECT_GT(real.lag1, 0.4);
  }
}

TEST(PracticeBundles, FloorVibrationHasItsSizeAndDirection) {
  SIXPOINT_NEED_PRACTICE();
  const auto [practice, scenario, simulated] = simulated_practice("engineering/b0007");
  const double frequency_hz = practice.effects[0]["parameters"]["frequency_hz"];
  const ProtocolSegment& still = segment_of(scenario, "still");
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double real =
        std::abs(tone_of(practice.counts, still.first_sample, still.samples, axis, frequency_hz));
    const double model =
        std::abs(tone_of(simulated, still.first_sample, still.samples, axis, frequency_hz));
    EXPECT_NEAR(real, model, 0.05 * model + 0.0001) << axis;
  }
}

// The generator's mount has a second mode that the label does not tell; the first one must fit.
TEST(PracticeBundles, SettlingTakesMostOfTheRinging) {
  SIXPOINT_NEED_PRACTICE();
  for (const char* name : {"engineering/b0005", "production/b0012", "production/b0018"}) {
    Practice practice = read_practice(name);
    for (nlohmann::json& effect : practice.effects) {
      if (effect["name"] == "settling") {
        effect["parameters"]["second_share"] = 0.27;
      }
    }
    const Scenario scenario = practice.scenario(true);
    const auto with = run_protocol(*scenario.protocol);
    const auto without = run_protocol(*practice.scenario(false).protocol);
    ASSERT_OK(with);
    ASSERT_OK(without);
    double before = 0;
    double after = 0;
    double floor = 0;
    for (const ProtocolSegment& segment : scenario.protocol->segments) {
      if (segment.name != "faces" && segment.name != "reseat") {
        continue;
      }
      const auto power = [&](const std::vector<gt3x::Counts>& model, std::uint64_t from) {
        double sum = 0;
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
          double bias = 0;
          for (std::uint64_t i = 500; i < 1000; ++i) {
            const std::uint64_t k = segment.first_sample + i;
            bias += (value(practice.counts[k], axis) - value(model[k], axis)) / 500;
          }
          for (std::uint64_t i = from; i < from + 60; ++i) {
            const std::uint64_t k = segment.first_sample + i;
            sum += std::pow(value(practice.counts[k], axis) - value(model[k], axis) - bias, 2);
          }
        }
        return sum;
      };
      before += power(*without, 0);
      after += power(*with, 0);
      floor += power(*without, 600);
    }
    EXPECT_LT(after - floor, 0.5 * (before - floor)) << name;
  }
}

TEST(PracticeBundles, SaturationCutsAtTheSameCounts) {
  SIXPOINT_NEED_PRACTICE();
  const auto [practice, scenario, simulated] = simulated_practice("engineering/b0016");
  for (const ProtocolSegment& segment : scenario.protocol->segments) {
    if (segment.name != "shaker_high" || segment.vibration->amplitude_g < 10) {
      continue;
    }
    Eigen::Index axis = 0;
    (segment.rotation * segment.vibration->direction_lab).cwiseAbs().maxCoeff(&axis);
    const auto a = static_cast<std::size_t>(axis);
    const auto span = [&](const std::vector<gt3x::Counts>& counts) {
      int low = 0;
      int high = 0;
      int at_limits = 0;
      for (std::uint64_t i = 0; i < segment.samples; ++i) {
        const int now = counts[segment.first_sample + i][a];
        low = std::min(low, now);
        high = std::max(high, now);
      }
      for (std::uint64_t i = 0; i < segment.samples; ++i) {
        const int now = counts[segment.first_sample + i][a];
        at_limits += now <= low + 1 || now >= high - 1 ? 1 : 0;
      }
      return std::pair(high - low, at_limits);
    };
    const auto [real_span, real_hits] = span(practice.counts);
    const auto [model_span, model_hits] = span(simulated);
    EXPECT_NEAR(static_cast<double>(real_span) / model_span, 1, 0.06);  // the unit's gain
    EXPECT_NEAR(real_hits, model_hits, 25);
  }
}

// The clock, by the recording's own host_clock.csv.
TEST(PracticeBundles, SamplingEffectsRunAsTheHostSaw) {
  SIXPOINT_NEED_PRACTICE();
  for (const char* name : {"engineering/b0012", "engineering/b0020"}) {
    const Practice practice = read_practice(name);
    const Scenario scenario = practice.scenario(true);
    const auto record = record_protocol(*scenario.protocol);
    ASSERT_OK(record);
    const ProtocolSegment& still = segment_of(scenario, "still");
    double real_s = 0;
    for (const auto& row : practice.clock) {
      const auto index = static_cast<std::uint64_t>(row[0]);
      if (index >= still.first_sample && index < still.first_sample + still.samples) {
        real_s = row[1] - still.host_start_s;
      }
    }
    const double model_s =
        record->sample_time_s[still.first_sample + still.samples - 100] - still.host_start_s;
    // Lost samples are a matter of chance: 72 of 120,000, with a standard deviation of 8.5.
    const double allowed_s = std::string(name) == "engineering/b0012" ? 0.005 : 0.4;
    EXPECT_NEAR(real_s, model_s, allowed_s) << name;
    EXPECT_GT(std::abs(real_s - 1199), 0.4) << name;
  }
}

TEST(PracticeBundles, FirmwareEffectsTakeTheirShare) {
  SIXPOINT_NEED_PRACTICE();
  // Whole seconds, and the generator's runs may overlap: three seconds are allowed.
  for (const char* name : {"engineering/b0015", "production/b0017"}) {
    const Practice practice = read_practice(name);
    const auto simulated = run_protocol(*practice.scenario(true).protocol);
    ASSERT_OK(simulated);
    const auto zeros = [](const std::vector<gt3x::Counts>& counts) {
      return std::count(counts.begin(), counts.end(), gt3x::Counts{});
    };
    EXPECT_NEAR(static_cast<double>(zeros(practice.counts)), static_cast<double>(zeros(*simulated)),
                310)
        << name;
  }
  const Practice practice = read_practice("engineering/b0017");
  const auto simulated = run_protocol(*practice.scenario(true).protocol);
  ASSERT_OK(simulated);
  const auto held = [](const std::vector<gt3x::Counts>& counts) {
    int count = 0;
    for (std::size_t i = 5; i < counts.size(); ++i) {
      bool same = true;
      for (std::size_t k = 1; k <= 5; ++k) {
        same = same && counts[i] == counts[i - k];
      }
      count += same ? 1 : 0;
    }
    return count;
  };
  EXPECT_NEAR(held(practice.counts), held(*simulated), 0.05 * held(practice.counts));
}

// Random effects: the same amount of scatter, not the same course.
TEST(PracticeBundles, RandomEffectsScatterAsMuch) {
  SIXPOINT_NEED_PRACTICE();
  {
    const Practice practice = read_practice("engineering/b0001");  // seating
    Scenario scenario = practice.scenario(true);
    const auto nominal = run_protocol(*practice.scenario(false).protocol);
    double model = 0;
    constexpr int kRuns = 6;
    const auto plain = dwell_means(scenario.protocol->segments, *nominal, practice.counts);
    for (int run = 0; run < kRuns; ++run) {
      scenario.protocol->seed = 100 + static_cast<std::uint64_t>(run);
      const auto seated = run_protocol(*scenario.protocol);
      ASSERT_OK(seated);
      const auto means = dwell_means(scenario.protocol->segments, *seated, practice.counts);
      model += rms_after_line(means[0], plain[0]) / kRuns;
    }
    const auto real = dwell_means(scenario.protocol->segments, practice.counts, practice.counts);
    EXPECT_NEAR(rms_after_line(real[0], plain[0]) / model, 1, 0.35);
  }
  const Practice practice = read_practice("engineering/b0013");  // random walk
  const Scenario scenario = practice.scenario(true);
  const auto simulated = run_protocol(*scenario.protocol);
  ASSERT_OK(simulated);
  const ProtocolSegment& still = segment_of(scenario, "still");
  const auto steps = [&](const std::vector<gt3x::Counts>& counts) {
    constexpr std::uint64_t kPiece = 1000;
    double power = 0;
    double n = 0;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      double before = 0;
      for (std::uint64_t i = 0; i + kPiece <= still.samples; i += kPiece) {
        double mean = 0;
        for (std::uint64_t k = 0; k < kPiece; ++k) {
          mean += value(counts[still.first_sample + i + k], axis) / 0.256 / kPiece;
        }
        power += i > 0 ? std::pow(mean - before, 2) : 0;
        n += i > 0 ? 1 : 0;
        before = mean;
      }
    }
    return std::sqrt(power / n);
  };
  // 357 steps each: 4 % standard error on either side.
  EXPECT_NEAR(steps(practice.counts) / steps(*simulated), 1, 0.2);
}

}  // namespace
}  // namespace sixpoint::sim

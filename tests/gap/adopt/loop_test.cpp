// The loop as a whole: units of a hidden population -> diagnosis -> adoption -> simulation with the
// scenario -> the gap again. Oracle: the hidden population, which this file alone knows; its units
// are made by tests/gap/made_bundle.h, which shares no code with the simulator or the diagnosis.
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/adopt/progress.h"
#include "gap/challenge/trials.h"
#include "gap/made_bundle.h"
#include "sim/bundle_writer.h"
#include "sim/scenario.h"

namespace sixpoint::gap {
namespace {

const UtcTime kNow = from_unix_seconds(1'400'000'000);

// Cross-axis terms yz, xz, xy of the hidden population.
const Eigen::Vector3d kHiddenMean(0.006, -0.004, 0.005);
constexpr double kHiddenSpread = 0.0012;

struct HiddenUnit {
  Eigen::Vector3d cross;
  RecordedBundle recorded;
};

HiddenUnit hidden_unit(std::mt19937_64& random, int number) {
  std::normal_distribution<double> normal;
  Eigen::Vector3d s = kHiddenMean;
  for (Eigen::Index i = 0; i < 3; ++i) {
    s[i] += kHiddenSpread * normal(random);
  }
  const tests::MadeForce force = [s](const Segment& segment, double) {
    const Eigen::Vector3d f = segment.rotation.col(2);
    return Eigen::Vector3d(f[0] + s[2] * f[1] + s[1] * f[2], f[1] + s[2] * f[0] + s[0] * f[2],
                           f[2] + s[1] * f[0] + s[0] * f[1]);
  };
  tests::MadeUnit unit;
  unit.seed = static_cast<unsigned>(100 + number);
  for (Eigen::Index i = 0; i < 3; ++i) {
    unit.gain[i] = 1 + 0.015 * normal(random);
    unit.offset_g[i] = 0.03 * normal(random);
  }
  Bundle bundle = tests::made_production(unit, force);
  bundle.protocol_serial = "H" + std::to_string(number);
  auto made = recorded_bundle(std::move(bundle), {});
  EXPECT_OK(made);
  return {s, *std::move(made)};
}

TEST(AdoptionLoop, TheGapShrinksAndTheMeanIsThatOfTheHiddenPopulation) {
  std::mt19937_64 random(2026);
  std::vector<HiddenUnit> units;
  for (int i = 0; i < 12; ++i) {
    units.push_back(hidden_unit(random, i));
  }
  constexpr std::size_t kLearning = 8;  // the others are new to the scenario
  std::vector<DocumentEvidence> documents;
  for (std::size_t i = 0; i < kLearning; ++i) {
    documents.push_back(evidence_of(units[i].recorded.diagnosis));
  }
  const auto learnt = adopt("", documents, kNow);
  ASSERT_OK(learnt);

  // The adopted mean, against the truth.
  std::size_t adopted = 0;
  Eigen::Vector3d adopted_mean = Eigen::Vector3d::Zero();
  for (const AdoptedEffect& effect : learnt->effects) {
    adopted += effect.decision.adopted() ? 1 : 0;
    if (effect.decision.name != "non_orthogonality") {
      EXPECT_FALSE(effect.decision.adopted()) << effect.decision.name;
      continue;
    }
    EXPECT_EQ(effect.decision.outcome, AdoptionOutcome::adopted);
    EXPECT_EQ(effect.decision.units(), kLearning);
    double square = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const MeanAndSpread& n = effect.decision.parameters[0].numbers[i];
      adopted_mean[static_cast<Eigen::Index>(i)] = n.mean;
      const double error = n.mean - kHiddenMean[static_cast<Eigen::Index>(i)];
      // Student's t of seven degrees of freedom: 3.5 in one of a hundred.
      EXPECT_LT(std::abs(error), 3.5 * n.standard_uncertainty) << i;
      // No more uncertain than eight units with that spread are: 0.0012 / sqrt(8), doubled.
      EXPECT_LT(n.standard_uncertainty, 2 * kHiddenSpread / std::sqrt(8.0)) << i;
      square += std::pow(n.spread.value_or(0), 2) / 3;
    }
    // 21 degrees of freedom: a relative uncertainty of 1 / sqrt(42), three times.
    EXPECT_NEAR(std::sqrt(square), kHiddenSpread, 0.47 * kHiddenSpread);
  }
  EXPECT_EQ(adopted, 1U);

  // The gap of units that it has not seen, by running the simulator again.
  auto history = adoption_history(learnt->text);
  ASSERT_OK(history);
  ProgressRecorder recorder(*std::move(history));
  for (std::size_t i = 0; i < units.size(); ++i) {
    ASSERT_OK(recorder.add(std::to_string(i), units[i].recorded));
  }
  const GapProgress progress = recorder.finish();
  EXPECT_EQ(progress.new_ones.bundles, units.size() - kLearning);
  // What is left of each is its own distance from the adopted mean: the truth says how much.
  double hidden2 = 0;
  double left2 = 0;
  for (std::size_t i = kLearning; i < units.size(); ++i) {
    hidden2 += units[i].cross.squaredNorm();
    left2 += (units[i].cross - adopted_mean).squaredNorm();
  }
  EXPECT_NEAR(progress.new_ones.closed.fraction.value(), 1 - left2 / hidden2, 0.03)
      << progress.brief();
  // In advance: the spread is 5.6 % of the mean's square, the mean of eight units adds an eighth of
  // that, and the mean square of twelve numbers is uncertain by 41 %, four times: 83 % at least.
  EXPECT_GT(progress.new_ones.closed.fraction.value(), 0.83) << progress.brief();
  EXPECT_LT(progress.new_ones.closed.fraction.value(), 1) << "the spread is left";
  RecordProperty("brief", progress.brief());

  // Units simulated from the scenario have what was adopted, each its own: the diagnosis finds it.
  std::vector<DocumentEvidence> simulated;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    nlohmann::ordered_json scenario = nlohmann::ordered_json::parse(learnt->text);
    scenario["seed"] = seed;
    const auto parsed = sim::parse_scenario(scenario.dump());
    ASSERT_OK(parsed);
    MemoryEnv memory;
    ASSERT_OK(sim::write_bundle(memory.files, "b", *parsed));
    const auto bundle = read_bundle(memory.files, "b");
    ASSERT_OK(bundle);
    const auto diagnosis = diagnose(*bundle);
    ASSERT_OK(diagnosis);
    simulated.push_back(evidence_of(*diagnosis));
    simulated.back().serial = "S" + std::to_string(seed);
  }
  for (const AdoptionDecision& decision : decide_adoption(simulated)) {
    EXPECT_EQ(decision.adopted(), decision.name == "non_orthogonality") << decision.name;
    if (decision.adopted()) {
      for (std::size_t i = 0; i < 3; ++i) {
        const MeanAndSpread& n = decision.parameters[0].numbers[i];
        EXPECT_NEAR(n.mean, kHiddenMean[static_cast<Eigen::Index>(i)], 0.0025) << i;
      }
    }
  }
}

// Effects of no list: two units of each kind, engineering protocol, twice the typical size. What is
// adopted, if anything, is of a family that was set before as the right one (trials.h).
TEST(AdoptionLoop, AnOutsideKindIsNotAdopted) {
  const TrialShares outside{.none = 0, .pair = 0, .outside = 1};
  for (const char* kind : {"supply_crosstalk", "magnet_pull", "stress_creep"}) {
    SCOPED_TRACE(kind);
    std::vector<DocumentEvidence> documents;
    for (std::uint64_t i = 0; i < 3; ++i) {
      const auto trial = draw_trial(77, i, sim::StandardProtocol::engineering, outside, {kind});
      ASSERT_OK(trial);
      MemoryEnv memory;
      ASSERT_OK(sim::write_bundle(memory.files, "b", trial->scenario));
      const auto bundle = read_bundle(memory.files, "b");
      ASSERT_OK(bundle);
      const auto diagnosis = diagnose(*bundle);
      ASSERT_OK(diagnosis);
      documents.push_back(evidence_of(*diagnosis));
    }
    const auto learnt = adopt("", documents, kNow);
    ASSERT_OK(learnt);
    for (const AdoptedEffect& effect : learnt->effects) {
      EXPECT_NE(effect.decision.name, kind);
      EXPECT_FALSE(effect.decision.adopted() && family_of(effect.decision.name) != family_of(kind))
          << effect.decision.name << ": " << effect.decision.brief();
    }
  }
}

}  // namespace
}  // namespace sixpoint::gap

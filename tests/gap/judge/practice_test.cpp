// The practice bundles: an independent generator's recordings with labels. Rates, not single cases:
// some effects can't be seen with the three-minute protocol, and then the right answer says so.
#include <algorithm>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/judge/diagnose.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

struct PracticeCase {
  std::string name;
  std::vector<std::string> truth;
  Diagnosis diagnosis;

  bool names(const std::string& effect) const {
    return std::any_of(diagnosis.effects.begin(), diagnosis.effects.end(),
                       [&](const EffectFinding& e) { return e.name == effect; });
  }
  bool not_observable(const std::string& effect) const {
    return std::any_of(diagnosis.not_observable.begin(), diagnosis.not_observable.end(),
                       [&](const auto& entry) { return entry.first == effect; });
  }
};

// The cases of one folder.
std::vector<PracticeCase> run_all(const char* folder) {
  std::vector<PracticeCase> cases;
  std::ifstream file(tests::shared_file("gap/practice/labels.json"));
  const auto labels = nlohmann::json::parse(file, nullptr, false);
  for (const auto& [name, label] : labels.items()) {
    if (!name.starts_with(folder)) {
      continue;
    }
    PracticeCase one;
    one.name = name;
    for (const auto& effect : label["effects"]) {
      one.truth.push_back(effect["name"]);
    }
    const auto bundle = read_bundle(posix_env().files, tests::shared_file("gap/practice/" + name));
    EXPECT_OK(bundle);
    if (!bundle) {
      continue;
    }
    auto diagnosis = diagnose(*bundle);
    EXPECT_OK(diagnosis);
    if (diagnosis) {
      one.diagnosis = *std::move(diagnosis);
      cases.push_back(std::move(one));
    }
  }
  return cases;
}

void judge(const std::vector<PracticeCase>& cases, std::size_t& seen, std::size_t& right) {
  for (const PracticeCase& c : cases) {
    const Diagnosis& d = c.diagnosis;
    if (c.truth.empty()) {
      EXPECT_EQ(d.verdict, Verdict::no_gap) << c.name << ": a false alarm: " << d.brief();
      continue;
    }
    // Nothing that is not there, whatever is named.
    for (const EffectFinding& e : d.effects) {
      EXPECT_NE(std::find(c.truth.begin(), c.truth.end(), e.name), c.truth.end())
          << c.name << " names " << e.name;
    }
    if (c.truth.size() == 1 && !(d.effects.empty() && !d.unknown.present)) {
      ++seen;
      right += !d.effects.empty() && d.effects.front().name == c.truth.front() ? 1 : 0;
    }
  }
}

TEST(Practice, Engineering) {
  SIXPOINT_NEED_SHARED("gap/practice/labels.json");
  const auto cases = run_all("engineering");
  ASSERT_EQ(cases.size(), 24U);
  const auto singles = std::count_if(cases.begin(), cases.end(),
                                     [](const PracticeCase& c) { return c.truth.size() == 1; });
  EXPECT_GE(singles, 18);
  std::size_t seen = 0;
  std::size_t right = 0;
  judge(cases, seen, right);
  EXPECT_EQ(static_cast<std::ptrdiff_t>(seen), singles)
      << "every single effect shows with the whole protocol";
  EXPECT_GE(static_cast<double>(right), 0.95 * static_cast<double>(seen));
  for (const PracticeCase& c : cases) {
    for (const std::string& effect : c.truth) {
      EXPECT_TRUE(c.names(effect)) << c.name << " lacks " << effect << ": " << c.diagnosis.brief();
    }
    const bool irreducible = c.names("seating") || c.names("random_walk");
    if (!c.truth.empty() && !irreducible) {
      EXPECT_GT(c.diagnosis.gap.closed_fraction, 0.9) << c.name;
    }
  }
}

TEST(Practice, Production) {
  SIXPOINT_NEED_SHARED("gap/practice/labels.json");
  const auto cases = run_all("production");
  ASSERT_EQ(cases.size(), 30U);
  std::size_t seen = 0;
  std::size_t right = 0;
  judge(cases, seen, right);
  EXPECT_GE(seen, 13U);
  EXPECT_GE(static_cast<double>(right), 0.95 * static_cast<double>(seen));
  for (const PracticeCase& c : cases) {
    // What needs heat, hours or a shaker can't be seen in three minutes at one temperature.
    for (const std::string& effect : c.truth) {
      if (effect == "offset_tempco" || effect == "saturation" || effect == "drift") {
        EXPECT_TRUE(c.not_observable(effect) || c.names(effect)) << c.name << ": " << effect;
      }
    }
  }
}

}  // namespace
}  // namespace sixpoint::gap

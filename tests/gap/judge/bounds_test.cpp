// EffectFinding::bound of effects that show in samples, against the simulator: below it nothing is
// named, above it the effect is. Oracle: sim/, which shares no code with gap/.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/explain/catalogue.h"
#include "gap/judge/diagnose.h"
#include "gap/simulated_bundle.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;

Result<Diagnosis> diagnosed(const char* protocol, std::uint64_t seed, const Json& effects) {
  SIXPOINT_ASSIGN(const Bundle bundle, tests::simulated({{"schema", "sixpoint/scenario/1"},
                                                         {"seed", seed},
                                                         {"protocol", protocol},
                                                         {"effects", effects}}));
  return diagnose(bundle);
}

std::optional<double> bound_of(const Diagnosis& diagnosis, const std::string& effect) {
  for (const EffectFinding& f : diagnosis.candidates) {
    if (f.name == effect) {
      return f.bound;
    }
  }
  return std::nullopt;
}

struct BoundCase {
  const char* protocol;
  const char* effect;
  const char* parameters;  // JSON; "SIZE" is the first parameter's
  // The first parameter over the bound at which the effect is hidden, and at which it shows.
  double hidden, shown;
  // Of a vector of this direction the bound is the length.
  Json direction = nullptr;
};
void PrintTo(const BoundCase& c, std::ostream* out) { *out << c.protocol << " " << c.effect; }

class Bounds : public testing::TestWithParam<BoundCase> {};

TEST_P(Bounds, TheEffectShowsAboveItAndIsHiddenBelow) {
  const BoundCase& c = GetParam();
  const auto nominal = diagnosed(c.protocol, 7, Json::array());
  ASSERT_OK(nominal);
  const std::optional<double> bound = bound_of(*nominal, c.effect);
  ASSERT_TRUE(bound);
  for (std::uint64_t seed = 31; seed < 33; ++seed) {
    for (const double times : {c.hidden, c.shown}) {
      Json size = times * *bound;
      if (!c.direction.is_null()) {
        size = c.direction;
        for (Json& component : size) {
          component = component.get<double>() * times * *bound;
        }
      }
      std::string parameters = c.parameters;
      parameters.replace(parameters.find("SIZE"), 4, size.dump());
      const auto d = diagnosed(c.protocol, seed,
                               {{{"name", c.effect}, {"parameters", Json::parse(parameters)}}});
      ASSERT_OK(d);
      const bool named = std::any_of(d->effects.begin(), d->effects.end(),
                                     [&](const EffectFinding& f) { return f.name == c.effect; });
      EXPECT_EQ(named, times == c.shown) << times << " times " << *bound << ": " << d->brief();
    }
  }
}

// A lower corner, a lower level and a slower mount show more. Sizes are further out where chance is
// larger.
std::vector<BoundCase> cases() {
  return {{"production", "floor_vibration", R"({"vector_mg": SIZE, "frequency_hz": 21.3})", 0.5, 2,
           Json{0.48, 0.6, 0.64}},
          {"production", "electrical_line", R"({"vector_mg": SIZE, "frequency_hz": 8.7})", 0.5, 2,
           Json{0.6, 0.8, 0}},
          {"production", "settling", R"({"amplitude": SIZE})", 0.4, 2},
          {"production", "bandwidth", R"({"corner_hz": SIZE})", 1.015, 0.98},
          {"production", "filter_mismatch", R"({"gain": SIZE, "offset_g": [0, 0, 0]})", 1.04, 0.96},
          {"production", "seating", R"({"sd_deg": SIZE})", 0.5, 2},
          {"production", "random_walk", R"({"mg_per_sqrt_s": SIZE})", 0.3, 2.5},
          {"production", "flicker", R"({"mg": SIZE})", 0.4, 2.5},
          {"production", "dropped_samples", R"({"rate": SIZE})", 0.01, 6},
          {"production", "duplicated_samples", R"({"rate": SIZE})", 0.01, 6},
          {"production", "charging_zeros", R"({"seconds": SIZE, "start_s": 71})", 0.85, 1.2},
          {"engineering", "jitter", R"({"rms_ms": SIZE})", 0.5, 3},
          {"engineering", "soft_mount", R"({"frequency_hz": SIZE})", 1.3, 0.9},
          {"engineering", "saturation", R"({"level_g": SIZE})", 1.1, 0.95}};
}

INSTANTIATE_TEST_SUITE_P(Samples, Bounds, testing::ValuesIn(cases()));

// A hold lasts a second at least, and always shows: its bound is its share of the recording.
TEST(Bounds, EveryEffectOfASizeHasOne) {
  const auto d = diagnosed("engineering", 7, Json::array());
  ASSERT_OK(d);
  for (const CatalogueEntry& entry : catalogue()) {
    const bool has_size =
        entry.name != "rounding_floor" && entry.name != "axis_rotation" && entry.name != "wrap";
    EXPECT_EQ(bound_of(*d, std::string(entry.name)).has_value(), has_size) << entry.name;
  }
}

}  // namespace
}  // namespace sixpoint::gap

// The table of undo_later_effects(), a row each; the numbers are worked out by hand.
#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

using tests::effect;

Findings measured(std::vector<EffectFinding> effects) {
  Findings found;
  found.effects = found.candidates = std::move(effects);
  return found;
}

const EffectFinding kLine = {.name = "floor_vibration",
                             .parameters = {{"vector_mg", {0.8, -1.6, 2.4}, {0.08, 0.16, 0.24}},
                                            {"frequency_hz", {20}, {0.002}}}};

TEST(UndoLaterEffects, AWrongModeIsDividedOut) {
  EffectFinding two_lines = kLine;
  two_lines.further_lines = {{{"vector_mg", {0.4, 0, 0}, {0.08, 0.08, 0.08}}}};
  Findings found = measured({{.name = "filter_mismatch", .parameters = {{"gain", {0.8}, {0.008}}}},
                             two_lines,
                             {.name = "settling", .parameters = {{"amplitude", {0.04}, {0.003}}}}});
  undo_later_effects(found);
  const NamedValue& ringing = effect(found, "settling")->parameters[0];
  EXPECT_DOUBLE_EQ(ringing.value[0], 0.05);
  EXPECT_NEAR(ringing.sd[0], std::hypot(0.003 / 0.8, 0.0125 * 0.04), 1e-12);
  const EffectFinding* line = effect(found, "floor_vibration");
  EXPECT_DOUBLE_EQ(line->parameters[0].value[1], -2);
  EXPECT_EQ(line->parameters[1].value[0], 20) << "a gain changes no frequency";
  EXPECT_DOUBLE_EQ(line->further_lines[0][0].value[0], 0.5);
  EXPECT_EQ(found.candidates[1].parameters[0].value, line->parameters[0].value);
}

TEST(UndoLaterEffects, AFastClockIsMultipliedIn) {
  EffectFinding hum = kLine;
  hum.name = "electrical_line";
  Findings found =
      measured({{.name = "clock_error", .parameters = {{"ppm", {-500}, {30}}}}, kLine, hum});
  undo_later_effects(found);
  for (const char* name : {"floor_vibration", "electrical_line"}) {
    const EffectFinding* line = effect(found, name);
    EXPECT_DOUBLE_EQ(line->parameters[1].value[0], 19.99);
    EXPECT_NEAR(line->parameters[1].sd[0], std::hypot(0.002 * 0.9995, 0.0006), 1e-12);
    EXPECT_EQ(line->parameters[0].value[0], 0.8);
  }
}

TEST(UndoLaterEffects, WithoutThemAllStays) {
  Findings found = measured({kLine});
  found.candidates.push_back({.name = "clock_error", .parameters = {{"ppm", {4000}, {30}}}});
  undo_later_effects(found);
  EXPECT_EQ(found.effects[0].parameters[0].value, kLine.parameters[0].value);
  EXPECT_EQ(found.effects[0].parameters[1].value[0], 20) << "a clock that is not accepted";
}

}  // namespace
}  // namespace sixpoint::gap

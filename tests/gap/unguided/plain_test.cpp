// Plain recordings: real files of others, with what their makers say of them as the oracle.
#include "gap/unguided/plain.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "gt3x/sample_reader.h"
#include "shared_data.h"
#include "sim/recording.h"

namespace sixpoint::gap {
namespace {

const EffectFinding* accepted(const Diagnosis& d, const std::string& name) {
  for (const EffectFinding& e : d.effects) {
    if (e.name == name) {
      return &e;
    }
  }
  return nullptr;
}

TEST(Plain, AffectedUnitsHaveTheWrongFilter) {
  for (const char* name :
       {"data/wgt3x-bt-affected/MOS2A45130450.gt3x", "data/wgt3x-bt-affected/MOS2A45130451.gt3x"}) {
    SIXPOINT_NEED_SHARED(name);
    const auto d = diagnose_plain(posix_env().files, tests::shared_file(name));
    ASSERT_OK(d);
    ASSERT_FALSE(d->effects.empty()) << name;
    const EffectFinding& mismatch = d->effects.front();
    EXPECT_EQ(mismatch.name, "filter_mismatch");
    // It alone closes the gap of 100 mg and more (16CPAN03).
    EXPECT_GT(mismatch.share_of_gap, 0.99) << name;
    EXPECT_GT(mismatch.probability_it_matters, 0.9) << name;
    EXPECT_EQ(d->gap.by_feature[0][0], d->gap.before_sigma);
    EXPECT_EQ(augmented_scenario(*d), nullptr) << "nothing says what was done to the unit";
    EXPECT_GT(d->not_observable.size(), 20U);
  }
}

TEST(Plain, UnaffectedUnitHasNoGap) {
  const char* name = "data/wgt3x-bt/MOS2E39180594.gt3x";
  SIXPOINT_NEED_SHARED(name);
  const auto d = diagnose_plain(posix_env().files, tests::shared_file(name));
  ASSERT_OK(d);
  EXPECT_EQ(accepted(*d, "filter_mismatch"), nullptr);
  EXPECT_EQ(d->verdict, Verdict::no_gap);
}

// PROVENANCE.md: drift about -0.16, -0.40, -0.43 mg/C, a chamber run at 0, 20 and 30 C.
TEST(Plain, ChamberRunHasTheVendorsDrift) {
  const char* name = "data/agdc/CPW1C48210013_baseline.agdc";
  SIXPOINT_NEED_SHARED(name);
  const auto d = diagnose_plain(posix_env().files, tests::shared_file(name));
  ASSERT_OK(d);
  const EffectFinding* tempco = accepted(*d, "offset_tempco");
  ASSERT_NE(tempco, nullptr);
  const auto& k = tempco->parameters.front().value;
  EXPECT_NEAR(k[0], -0.16, 0.06);
  EXPECT_NEAR(k[1], -0.40, 0.06);
  EXPECT_NEAR(k[2], -0.43, 0.06);
  EXPECT_GT(tempco->share_of_gap, 0.3);
  EXPECT_GT(tempco->probability_it_matters, 0.9);
  // 0 to 30 C at 0.4 mg/C are some 4 mg of rms. What the other poses' slopes foretell of a pose is
  // not all of it: the sensitivity moves with temperature too, by the direction.
  EXPECT_GT(d->gap.before_mg, 2);
  EXPECT_LT(d->gap.before_mg, 8);
  EXPECT_GT(d->gap.closed_fraction, 0.3);
  EXPECT_LT(d->gap.after_mg, d->gap.before_mg);
}

// Semi-synthetic: a mismatch of known size put into a real recording of a unit that has none. What
// the recording really holds - wear, movement, its own constants - stays.
TEST(Plain, KnownMismatchInARealRecordingIsFoundAndMeasured) {
  const char* name = "data/wgt3x-bt/MOS2E39180594.gt3x";
  SIXPOINT_NEED_SHARED(name);
  auto recording = gt3x::Recording::open(posix_env().files, tests::shared_file(name));
  ASSERT_OK(recording);
  const int rate_hz =
      static_cast<int>(std::lround(recording->info().sample_rate_hz().value_or(30)));
  std::vector<std::pair<UtcTime, std::vector<gt3x::Counts>>> seconds;
  gt3x::SampleReader reader(*recording);
  for (auto item = reader.next(); item && *item; item = reader.next()) {
    if ((*item)->kind == gt3x::SampleItem::Kind::recorded) {
      seconds.emplace_back(
          from_unix_seconds((*item)->unix_time),
          std::vector<gt3x::Counts>((*item)->counts.begin(), (*item)->counts.end()));
    }
  }
  ASSERT_GT(seconds.size(), 300U);
  const double scale = recording->info().accel_scale_lsb_per_g().value_or(256);
  struct Case {
    double gain;
    std::array<double, 3> offset_g;
    bool there;
  };
  int right = 0;
  const std::vector<Case> cases = {{1, {0, 0, 0}, false},
                                   {0.8, {0.15, -0.1, 0.2}, true},
                                   {0.86, {-0.12, 0.18, -0.1}, true},
                                   {0.92, {0.1, 0.1, -0.15}, true},
                                   {0.95, {-0.2, -0.15, 0.1}, true}};
  for (const Case& c : cases) {
    MemoryEnv memory;
    const sim::UnitTruth unit;
    Bytes log = sim::log_preamble(unit, seconds.front().first, rate_hz);
    for (const auto& [time, counts] : seconds) {
      std::vector<gt3x::Counts> changed = counts;
      for (gt3x::Counts& count : changed) {
        for (std::size_t a = 0; a < 3; ++a) {
          count[a] = static_cast<std::int16_t>(
              std::clamp(std::lround(c.gain * count[a] + c.offset_g[a] * scale), -2048L, 2047L));
        }
      }
      sim::append_second(log, time, changed, true);
    }
    auto writer = gt3x::RecordingWriter::create(memory.files, "made.gt3x");
    ASSERT_OK(writer);
    ASSERT_OK(writer->add("log.bin", std::move(log)));
    gt3x::Info info = sim::recording_info(unit, seconds.front().first,
                                          seconds.back().first + std::chrono::seconds(1), rate_hz);
    info.set("Acceleration Scale", fmt::format("{}", scale));
    ASSERT_OK(writer->add("info.txt", info.serialise()));
    ASSERT_OK(writer->commit());
    const auto d = diagnose_plain(memory.files, "made.gt3x");
    ASSERT_OK(d);
    const EffectFinding* found = accepted(*d, "filter_mismatch");
    EXPECT_EQ(found != nullptr, c.there) << c.gain << ": " << d->brief();
    right += (found != nullptr) == c.there ? 1 : 0;
  }
  EXPECT_EQ(right, 5);
}

// A unit that is never at rest: nothing is known of it, and that is no "no gap".
TEST(Plain, WithoutRestThereIsNoAnswer) {
  MemoryEnv memory;
  const auto scenario = sim::parse_scenario(
      R"({"seed": 4, "motions": [{"kind": "shaker", "duration_s": 60, "amplitude_g": 0.8}]})");
  ASSERT_OK(scenario);
  ASSERT_OK(sim::write_recording(memory.files, "a.gt3x", *scenario));
  const auto d = diagnose_plain(memory.files, "a.gt3x");
  ASSERT_OK(d);
  EXPECT_FALSE(d->usable());
  EXPECT_EQ(d->verdict, Verdict::unexplained);
  EXPECT_EQ(d->unknown.probability, 0.5);
  EXPECT_EQ(d->brief(), "nothing can be said: the recording holds no still period of four seconds");
}

TEST(Plain, MissingFileIsNoInput) {
  EXPECT_FAILS(diagnose_plain(posix_env().files, "/nonexistent/a.gt3x"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::gap

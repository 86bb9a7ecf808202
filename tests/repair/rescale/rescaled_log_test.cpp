#include "repair/rescale/rescaled_log.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/six_sides.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {
namespace {

gt3x::LogReader reader_of(const Bytes& log) {
  return gt3x::LogReader(std::make_unique<gt3x::MemorySource>(log));
}

// Zero bytes, noise and a record of a type that no program knows between the seconds.
tests::MadeRecording with_noise() {
  tests::MadeRecording made = tests::six_sides();
  made.between = [](std::size_t second) -> Bytes {
    Bytes bytes;
    if (second % 7 == 3) {
      bytes = {0, 0, 0, 0x55, 0x33};
    } else if (second % 7 == 5) {
      gt3x::append_record(bytes, static_cast<gt3x::RecordType>(99), 1'428'588'240, Bytes{1, 2});
    }
    return bytes;
  };
  return made;
}

TEST(RescaledLog, WithoutConstantsEveryByteComesOutAsItWentIn) {
  const Bytes log = with_noise().log();
  auto rescaled = RescaledLog::make(reader_of(log), {});
  ASSERT_OK(rescaled);
  EXPECT_EQ(gt3x::read_all(**rescaled, 1U << 20).value(), log);
  EXPECT_EQ((*rescaled)->tally().samples, 2100U);
  EXPECT_EQ((*rescaled)->tally().sample_records, 70U);
  EXPECT_EQ((*rescaled)->tally().changed_samples, 0U);
}

TEST(RescaledLog, SmallPiecesGiveTheSameBytes) {
  const Bytes log = with_noise().log();
  RescaledLogOptions options;
  options.fresh = tests::kTrue;
  options.first_constants = tests::kStored;
  auto whole = RescaledLog::make(reader_of(log), options).value();
  const Bytes expected = gt3x::read_all(*whole, 1U << 20).value();
  EXPECT_EQ(expected.size(), log.size());
  EXPECT_NE(expected, log);
  const std::vector<StillWindow> still = {{0, 120}};
  auto pieces = RescaledLog::make(reader_of(log), options).value();
  pieces->expect_still(still);
  Bytes got;
  Bytes piece(7);
  while (const std::size_t count = pieces->read(piece).value()) {
    got.insert(got.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
  }
  EXPECT_EQ(got, expected);
  const auto left_mg = pieces->still_error_mg(still);
  ASSERT_TRUE(left_mg);
  EXPECT_LT(*left_mg, 5) << "at rest the right constants give 1 g";
}

TEST(RescaledLog, TheMarkStandsBeforeTheFirstRecordAndTheRestIsAsItWas) {
  const Bytes log = with_noise().log();
  RescaledLogOptions options;
  options.mark = R"({"MetadataType":"SixpointRepair","Parsed":false,"JSON":null})";
  options.size = log.size();
  auto rescaled = RescaledLog::make(reader_of(log), options).value();
  const Bytes marked = gt3x::read_all(*rescaled, 1U << 20).value();
  EXPECT_EQ(rescaled->size(), marked.size());
  Bytes expected;
  gt3x::append_record(expected, gt3x::RecordType::metadata, 1'428'588'239, as_bytes(options.mark));
  expected.insert(expected.end(), log.begin(), log.end());
  EXPECT_EQ(marked, expected);
  // Survey knows it, packed anew or not.
  MemoryFiles files;
  ASSERT_OK(with_noise().write(files, "again.gt3x", marked));
  const auto found = survey(files, "again.gt3x");
  ASSERT_OK(found);
  EXPECT_TRUE(found->already_repaired);
}

TEST(RescaledLog, ALogWithoutAGoodRecordHasItsMarkToo) {
  RescaledLogOptions options;
  options.mark = "{}";
  options.size = 1;
  auto rescaled = RescaledLog::make(reader_of({0x55}), options).value();
  EXPECT_EQ(gt3x::read_all(*rescaled, 100).value().size(), rescaled->size());
}

TEST(RescaledLog, ARecordTooLongForSixteenBitsGoesOnInAnother) {
  tests::MadeRecording made = tests::six_sides();
  made.raw.resize(2000);
  std::vector<gt3x::Counts> samples;
  for (int i = 0; i < 14'000; ++i) {
    samples.push_back({static_cast<std::int16_t>(i % 2000), -3, 256});
  }
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, 7, made.parameters());
  Bytes payload;
  gt3x::append_activity(payload, samples);
  gt3x::append_record(log, gt3x::RecordType::activity, 8, payload);
  MemoryFiles files;
  ASSERT_OK(made.write(files, "long.gt3x", log));
  const auto found = survey(files, "long.gt3x");
  ASSERT_OK(found);
  RescaledLogOptions options;
  options.wide = true;
  options.size = found->log_bytes_wide;
  auto rescaled = RescaledLog::make(reader_of(log), options).value();
  const Bytes wide = gt3x::read_all(*rescaled, 1U << 20).value();
  EXPECT_EQ(rescaled->size(), wide.size());
  ASSERT_OK(made.write(files, "wide.gt3x", wide));
  EXPECT_EQ(tests::samples_of(files, "wide.gt3x"), samples);
}

// Two sets of constants, from one record to the next: each sample has the constants before it.
TEST(RescaledLog, ConstantsThatAlternateAreEachUndone) {
  const StoredConstants other = {{310, 300, 300}, {-210, -260, -200}, {50, 10, 50}};
  Bytes log;
  tests::MadeRecording made;
  std::vector<gt3x::Counts> expected;
  for (std::uint32_t second = 0; second < 40; ++second) {
    made.constants = second % 2 == 0 ? tests::kStored : other;
    gt3x::append_record(log, gt3x::RecordType::parameters, second, made.parameters());
    Bytes payload;
    const gt3x::Counts sample =
        tests::MadeRecording::store(made.constants, {static_cast<int>(second), 50, 250}, false);
    gt3x::append_activity(payload, std::vector<gt3x::Counts>(30, sample));
    gt3x::append_record(log, gt3x::RecordType::activity, second, payload);
    // The same raw counts under constants that read them as they are: 256 LSB/g, zero at 0.
    expected.insert(expected.end(), 30, {static_cast<std::int16_t>(second), 50, 250});
  }
  MemoryFiles files;
  RescaledLogOptions options;
  options.fresh = calib::Calibration{};
  options.fresh->sensitivity_g_per_lsb = {1.0 / 256, 1.0 / 256, 1.0 / 256};
  auto rescaled = RescaledLog::make(reader_of(log), options).value();
  ASSERT_OK(made.write(files, "out.gt3x", gt3x::read_all(*rescaled, 1U << 20).value()));
  const auto got = tests::samples_of(files, "out.gt3x");
  ASSERT_EQ(got.size(), expected.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      ASSERT_NEAR(got[i][a], expected[i][a], 1) << i;  // two raw counts may share a stored one
    }
  }
}

TEST(RescaledLog, TheUnitsOwnEpochsAreCounted) {
  Bytes log = tests::six_sides().log();
  gt3x::append_record(log, gt3x::RecordType::epoch, 9, Bytes{1});
  gt3x::append_record(log, gt3x::RecordType::epoch4, 9, Bytes{1});
  auto rescaled = RescaledLog::make(reader_of(log), {}).value();
  EXPECT_EQ(gt3x::read_all(*rescaled, 1U << 20).value(), log);
  EXPECT_EQ(rescaled->tally().epoch_records, 2U);
}

TEST(RescaledLog, RefusesConstantsThatDivideByZero) {
  RescaledLogOptions options;
  options.fresh = tests::kTrue;
  options.first_constants = StoredConstants{{1, 1, 1}, {1, 1, 1}, {0, 0, 0}};
  EXPECT_FALSE(RescaledLog::make(reader_of(Bytes{}), options));
}

// Where PARAMETERS change the scale, counts go out at the scale at which they came in.
TEST(RescaledLog, FollowsTheAccelerationScaleInForce) {
  const tests::MadeRecording made = tests::six_sides();
  RescaledLogOptions options;
  options.fresh = tests::kTrue;
  options.first_constants = tests::kStored;
  std::vector<StillWindow> still;
  for (const int side : {0, 1, 2, 4, 5}) {  // the scale changes while it lies on the fourth
    still.push_back({static_cast<std::uint64_t>(side) * 300 + 90, 120});
  }
  auto rescaled = RescaledLog::make(reader_of(tests::log_of_two_scales(made)), options).value();
  rescaled->expect_still(still);
  const Bytes out = gt3x::read_all(*rescaled, 1U << 20).value();
  const auto left_mg = rescaled->still_error_mg(still);
  ASSERT_TRUE(left_mg);
  EXPECT_LT(*left_mg, 5);
  // The last second of the second half, sample by sample, by the formula.
  auto log = reader_of(out);
  std::vector<gt3x::Counts> last;
  for (auto item = log.next(); item && *item; item = log.next()) {
    if ((*item)->record.is(gt3x::RecordType::activity)) {
      gt3x::unpack_activity((*item)->record.payload, last);
    }
  }
  ASSERT_EQ(last.size(), 30U);
  for (std::size_t i = 0; i < last.size(); ++i) {
    const PerAxis<int>& raw = made.raw[made.raw.size() - 30 + i];
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double g = tests::kTrue.sensitivity_g_per_lsb[a] * (raw[a] - tests::kTrue.zero_lsb[a]);
      const double stored_g = 2.0 * (raw[a] - tests::kStored.zero_lsb[a]) /
                              (tests::kStored.positive_lsb[a] - tests::kStored.negative_lsb[a]);
      if (std::abs(g * 512) < 2040 && std::abs(stored_g * 512) < 2040) {
        EXPECT_NEAR(last[i][a], g * 512, 1.6) << i << " axis " << a;
      }
    }
  }
}

}  // namespace
}  // namespace sixpoint::repair

#include "repair/triage/survey.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/six_sides.h"

namespace sixpoint::repair {
namespace {

TEST(Survey, SaysWhatTheFileHolds) {
  MemoryFiles files;
  const tests::MadeRecording made = tests::six_sides();
  ASSERT_OK(made.write(files, "in.gt3x"));
  const auto found = survey(files, "in.gt3x");
  ASSERT_OK(found);
  EXPECT_EQ(found->facts.serial, "MOS2A45130450");
  EXPECT_EQ(found->facts.firmware, "1.5.0");
  EXPECT_EQ(found->facts.calibration_time, from_unix_seconds(1'384'266'733));
  EXPECT_EQ(found->model, "wGT3X-BT");
  EXPECT_EQ(found->rate_hz, 30);
  EXPECT_EQ(found->accel_scale_lsb_per_g, 256);
  EXPECT_TRUE(found->accel_scale_known);
  EXPECT_EQ(found->constants, std::vector{tests::kStored});
  EXPECT_FALSE(found->constants_problem);
  EXPECT_FALSE(found->already_repaired);
  // 70 seconds of 30 samples; packed 135 bytes a second, wide 180.
  EXPECT_EQ(found->samples, 2100U);
  EXPECT_EQ(found->sample_records, 70U);
  EXPECT_EQ(found->duration_s, 70);
  EXPECT_EQ(found->log_bytes, made.log().size());
  EXPECT_EQ(found->log_bytes_wide, made.log().size() + 70 * (180 - 135));
  EXPECT_FALSE(found->beyond_12_bits);
  std::uint64_t clipped = 0;
  for (const gt3x::Counts& counts : made.stored()) {
    clipped += std::ranges::any_of(counts, [](int c) { return c == -2048 || c == 2047; }) ? 1 : 0;
  }
  EXPECT_EQ(found->clipped_samples, clipped);
  // The stored constants are 0.1 to 0.2 g off what the sensor is, so 1 g is not 1 g at rest.
  EXPECT_GE(found->magnitude.blocks, 6U);
  EXPECT_GT(found->magnitude.mean_mg, 50);
  EXPECT_GE(found->magnitude.worst_mg, found->magnitude.mean_mg);
}

TEST(Survey, NamesWhatIsMissing) {
  MemoryFiles files;
  EXPECT_FAILS(survey(files, "none"), ErrorCode::no_input);
  tests::MadeRecording made;
  ASSERT_OK(made.write(files, "empty.gt3x"));
  const auto empty = survey(files, "empty.gt3x");
  ASSERT_OK(empty);
  EXPECT_EQ(empty->samples, 0U);
  EXPECT_TRUE(empty->constants_problem);

  made = tests::six_sides();
  made.constants.negative_lsb[1] = made.constants.positive_lsb[1];
  ASSERT_OK(made.write(files, "equal.gt3x"));
  const auto equal = survey(files, "equal.gt3x");
  ASSERT_OK(equal);
  ASSERT_TRUE(equal->constants_problem) << "a division by zero in Eq. 1-3";
  EXPECT_EQ(equal->constants_problem->where, "equal.gt3x");

  made.rate_hz = 0;
  made.raw.clear();
  ASSERT_OK(made.write(files, "no-rate.gt3x", Bytes{}));
  EXPECT_FAILS(survey(files, "no-rate.gt3x"), ErrorCode::bad_data);
}

TEST(Survey, KnowsTheMarkAndWideRecords) {
  MemoryFiles files;
  tests::MadeRecording made = tests::six_sides();
  made.activity2 = true;
  auto writer = gt3x::RecordingWriter::create(files, "marked.gt3x").value();
  ASSERT_OK(writer.add("log.bin", made.log()));
  gt3x::Info info;
  info.set("Serial Number", made.serial);
  info.set("Sample Rate", "30");
  ASSERT_OK(writer.add("info.txt", info.serialise()));
  ASSERT_OK(writer.add(kRepairMark, "{}"));
  ASSERT_OK(writer.commit());
  const auto found = survey(files, "marked.gt3x");
  ASSERT_OK(found);
  EXPECT_TRUE(found->already_repaired);
  EXPECT_TRUE(found->constants.empty()) << "its counts no longer come from its PARAMETERS";
  EXPECT_EQ(found->log_bytes_wide, found->log_bytes) << "wide already";
}

}  // namespace
}  // namespace sixpoint::repair

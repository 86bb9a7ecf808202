#include "repair/triage/survey.h"

#include <fmt/format.h>
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

TEST(Survey, ThousandsOfSetsOfConstantsAreOneProblem) {
  tests::MadeRecording made = tests::six_sides();
  made.between = [set = made](std::size_t second) mutable {
    Bytes bytes;
    for (int i = 0; i < 100; ++i) {
      set.constants.zero_lsb = {static_cast<int>(second), i, 0};
      gt3x::append_record(bytes, gt3x::RecordType::parameters, 7, set.parameters());
    }
    return bytes;
  };
  MemoryFiles files;
  ASSERT_OK(made.write(files, "hostile.gt3x"));
  const auto found = survey(files, "hostile.gt3x");
  ASSERT_OK(found);
  ASSERT_TRUE(found->constants_problem);
  EXPECT_NE(found->constants_problem->what.find("sets of constants"), std::string::npos);
  EXPECT_LE(found->constants.size(), kMaxSetsOfConstants + 1);
}

TEST(Survey, TwoFirmwareVersionsAreBothKept) {
  tests::MadeRecording made = tests::six_sides();
  gt3x::ParameterValues values = gt3x::parse_parameters(made.parameters())->values;
  values[gt3x::kParameterFirmwareVersion] = *gt3x::encode_firmware("1.8.0");
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, 7, gt3x::encode_parameters(values));
  const Bytes rest = made.log();
  log.insert(log.end(), rest.begin(), rest.end());
  MemoryFiles files;
  ASSERT_OK(made.write(files, "two.gt3x", log));
  auto found = survey(files, "two.gt3x");
  ASSERT_OK(found);
  EXPECT_EQ(found->facts.firmware, "1.5.0");
  EXPECT_EQ(found->facts.other_firmware, "1.8.0");
  made.firmware = "1.8";  // the same, in other words
  ASSERT_OK(made.write(files, "one.gt3x", log));
  found = survey(files, "one.gt3x");
  ASSERT_OK(found);
  EXPECT_EQ(found->facts.other_firmware, "");
}

TEST(Survey, AScaleThatCannotBeIsSaid) {
  MemoryFiles files;
  const tests::MadeRecording made = tests::six_sides();
  gt3x::ParameterValues values = gt3x::parse_parameters(made.parameters())->values;
  for (const double scale : {256.0, 0.0}) {
    for (const char* line : {"256.0", "256,0", "0", "NaN"}) {
      values[gt3x::kParameterAccelScale] = gt3x::encode_float(scale);
      Bytes log;
      gt3x::append_record(log, gt3x::RecordType::parameters, 7, gt3x::encode_parameters(values));
      const std::string path = fmt::format("{}-{}.gt3x", scale, line);
      auto writer = gt3x::RecordingWriter::create(files, path).value();
      ASSERT_OK(writer.add("log.bin", log));
      ASSERT_OK(writer.add("info.txt",
                           fmt::format("Serial Number: MOS2A1\r\nFirmware: 1.5.0\r\nSample Rate: "
                                       "30\r\nAcceleration Scale: {}\r\n",
                                       line)));
      ASSERT_OK(writer.commit());
      const auto found = survey(files, path);
      ASSERT_OK(found);
      EXPECT_EQ(found->accel_scale_lsb_per_g, 256) << path;
      const std::size_t wrong =
          (scale == 0 ? 1 : 0) + (std::string_view(line).starts_with("256") ? 0 : 1);
      EXPECT_EQ(found->notes.size(), wrong) << path;
    }
  }
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

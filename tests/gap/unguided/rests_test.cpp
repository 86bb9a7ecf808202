// Recordings of blocks whose means, slopes and noise are chosen here.
#include "gap/unguided/rests.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

using gt3x::Counts;
using gt3x::RecordType;
using gt3x::tests::kStart;

constexpr int kRate_hz = 30;                      // of made_info()
constexpr const char* kSerial = "MOS2A45130450";  // made_info()'s serial

// Seconds of one log, one behind the other.
class Log {
 public:
  using Sample = std::function<Counts(int i)>;  // i: the sample's number within the stretch

  Log& seconds(int n, const Sample& sample, RecordType type = RecordType::activity2) {
    for (int second = 0; second < n; ++second) {
      std::vector<Counts> samples;
      for (int i = 0; i < kRate_hz; ++i) {
        samples.push_back(sample(second * kRate_hz + i));
      }
      Bytes payload;
      if (type == RecordType::activity) {
        gt3x::append_activity(payload, samples);
      } else if (type == RecordType::activity2) {
        gt3x::append_activity2(payload, samples);
      } else {
        gt3x::append_activity3(payload, samples);
      }
      gt3x::append_record(bytes_, type, now_++, payload);
    }
    return *this;
  }
  Log& record(RecordType type, const Bytes& payload) {
    gt3x::append_record(bytes_, type, now_, payload);
    return *this;
  }
  Log& skip(std::uint32_t seconds) {
    now_ += seconds;
    return *this;
  }
  Log& break_last_checksum() {
    bytes_.back() ^= 0xFFU;
    return *this;
  }
  Result<RecordingRests> rests(const std::vector<std::pair<std::string, std::string>>& entries = {},
                               const std::string& info = gt3x::tests::made_info()) const {
    MemoryEnv memory;
    SIXPOINT_ASSIGN(auto out, gt3x::RecordingWriter::create(memory.files, "unit.gt3x"));
    SIXPOINT_CHECK(out.add("log.bin", bytes_));
    SIXPOINT_CHECK(out.add("info.txt", std::string_view(info)));
    for (const auto& [name, text] : entries) {
      SIXPOINT_CHECK(out.add(name, std::string_view(text)));
    }
    SIXPOINT_CHECK(out.commit());
    return read_rests(memory.files, "unit.gt3x");
  }

 private:
  Bytes bytes_;
  std::uint32_t now_ = kStart;
};

std::int16_t lsb(double value) { return static_cast<std::int16_t>(std::lround(value)); }

// Z up, one LSB up and down about the mean: sd 1 LSB, 3.9 mg.
Counts still(int i) {
  const int sign = i % 2 == 0 ? 1 : -1;
  return {lsb(10 + sign), lsb(-20 - sign), lsb(256 + sign)};
}
// X is `amplitude_lsb` above and below its mean by turns: its sd.
Log::Sample humming(int amplitude_lsb) {
  return [amplitude_lsb](int i) {
    return Counts{lsb(i % 2 == 0 ? amplitude_lsb : -amplitude_lsb), 0, 256};
  };
}
// X rises by `lsb_per_sample` on top of one LSB up and down.
Log::Sample rising(double lsb_per_sample) {
  return [lsb_per_sample](int i) {
    return Counts{lsb(lsb_per_sample * i + (i % 2 == 0 ? 1 : -1)), 0, 256};
  };
}
std::size_t count(const Log& log) {
  const auto recording = log.rests();
  EXPECT_OK(recording);
  return recording ? recording->rests.size() : 0;
}

TEST(Rests, FourSecondsAreABlockWithItsTimeAndMean) {
  const auto recording = Log().seconds(12, still).rests();
  ASSERT_OK(recording);
  ASSERT_EQ(recording->rests.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Rest& rest = recording->rests[i];
    EXPECT_EQ(rest.time_s, static_cast<double>(kStart + 4 * i));
    EXPECT_LT((rest.mean_g - Eigen::Vector3d(10, -20, 256) / 256).norm(), 1e-12);
    EXPECT_TRUE(rest.quiet);
    EXPECT_FALSE(rest.temperature_c);
  }
  EXPECT_EQ(count(Log().seconds(3, still)), 0U) << "not four seconds";
}

TEST(Rests, PackedAndPlainRecordsGiveTheSame) {
  const auto packed = Log().seconds(8, still, RecordType::activity).rests();
  const auto plain = Log().seconds(8, still, RecordType::activity2).rests();
  ASSERT_OK(packed);
  ASSERT_OK(plain);
  ASSERT_EQ(packed->rests.size(), 2U);
  ASSERT_EQ(plain->rests.size(), 2U);
  EXPECT_EQ(packed->rests[1].mean_g, plain->rests[1].mean_g);
}

TEST(Rests, HeaderIsReadAndTheFirstParametersSayWhenItWasCalibrated) {
  gt3x::ParameterValues later = gt3x::tests::made_parameters();
  later[gt3x::kParameterCalibrationTime] = 1'400'000'000;
  const auto recording =
      Log()
          .record(RecordType::parameters, gt3x::encode_parameters(gt3x::tests::made_parameters()))
          .seconds(4, still)
          .record(RecordType::parameters, gt3x::encode_parameters(later))
          .rests();
  ASSERT_OK(recording);
  EXPECT_EQ(recording->serial, kSerial);
  EXPECT_EQ(recording->firmware, "1.5.0");
  ASSERT_TRUE(recording->calibration_time);
  EXPECT_EQ(*recording->calibration_time, from_unix_seconds(1'384'266'733));
  const auto without = Log().seconds(4, still).rests();
  ASSERT_OK(without);
  EXPECT_FALSE(without->calibration_time);
}

TEST(Rests, ScaleOfTheParametersHoldsFromThereOn) {
  gt3x::ParameterValues values = gt3x::tests::made_parameters();
  values[gt3x::kParameterAccelScale] = gt3x::encode_float(512);
  const auto recording = Log()
                             .seconds(4, still)
                             .record(RecordType::parameters, gt3x::encode_parameters(values))
                             .seconds(4, still)
                             .rests();
  ASSERT_OK(recording);
  ASSERT_EQ(recording->rests.size(), 2U);
  EXPECT_NEAR(recording->rests[0].mean_g[2], 1, 1e-12);
  EXPECT_NEAR(recording->rests[1].mean_g[2], 0.5, 1e-12);
}

// The paper's Step 2 has 0.5 mg per sample: 0.128 LSB.
TEST(Rests, BlockThatMovesIsNone) {
  EXPECT_EQ(count(Log().seconds(4, rising(0.10))), 1U);
  EXPECT_EQ(count(Log().seconds(4, rising(0.15))), 0U);
  EXPECT_EQ(count(Log().seconds(4, rising(-0.15))), 0U);
}

// 9 mg are 2.3 LSB, 40 mg are 10.2 LSB.
TEST(Rests, HumIsARestThatIsNotQuietAndShakingIsNone) {
  const auto quiet = Log().seconds(4, humming(2)).rests();
  const auto hum = Log().seconds(4, humming(3)).rests();
  const auto loud = Log().seconds(4, humming(10)).rests();
  ASSERT_OK(quiet);
  ASSERT_OK(hum);
  ASSERT_OK(loud);
  ASSERT_EQ(quiet->rests.size(), 1U);
  ASSERT_EQ(hum->rests.size(), 1U);
  ASSERT_EQ(loud->rests.size(), 1U);
  EXPECT_TRUE(quiet->rests[0].quiet);
  EXPECT_FALSE(hum->rests[0].quiet);
  EXPECT_FALSE(loud->rests[0].quiet);
  EXPECT_LT((loud->rests[0].mean_g - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12) << "means count";
  EXPECT_EQ(count(Log().seconds(4, humming(11))), 0U);
}

TEST(Rests, ZerosAndARepeatedValueAreNoMeasurement) {
  EXPECT_EQ(count(Log().seconds(4, [](int) { return Counts{}; })), 0U);
  EXPECT_EQ(count(Log().seconds(4, [](int) { return Counts{3, 4, 256}; })), 0U);
}

TEST(Rests, BlockNeverSpansAGapADamageOrAnEmptyRecord) {
  EXPECT_EQ(count(Log().seconds(2, still).seconds(2, still)), 1U);
  EXPECT_EQ(count(Log().seconds(2, still).skip(1).seconds(2, still)), 0U);
  EXPECT_EQ(count(Log().seconds(2, still).record(RecordType::activity2, {}).seconds(2, still)), 0U);
  EXPECT_EQ(count(Log().seconds(3, still).break_last_checksum().seconds(2, still)), 0U);
  // Other records lie between samples everywhere.
  EXPECT_EQ(count(Log().seconds(2, still).record(RecordType::lux, {7, 0}).seconds(2, still)), 1U);
  const auto behind = Log().seconds(2, still).skip(100).seconds(4, still).rests();
  ASSERT_OK(behind);
  ASSERT_EQ(behind->rests.size(), 1U);
  EXPECT_EQ(behind->rests[0].time_s, kStart + 102) << "the grid begins again";
}

constexpr const char* kThermometer =
    R"({"tempLow": 10, "tempHigh": 40, "mcuTempLow": 100, "mcuTempHigh": 400,
        "adxlTempLow": 1000, "adxlTempHigh": 1300})";

Bytes temperature(std::uint8_t sensor, int adc) {
  return {sensor, static_cast<std::uint8_t>(adc & 0xFF), static_cast<std::uint8_t>(adc >> 8)};
}

// Of the processor 10 C to 40 C are 100 to 400, of the accelerometer 1000 to 1300.
TEST(Rests, AccelerometersThermometerReplacesTheProcessors) {
  const Log log = Log()
                      .seconds(4, still)
                      .record(RecordType::temperature, temperature(0, 250))
                      .seconds(4, still)
                      .record(RecordType::temperature, temperature(1, 1100))
                      .seconds(4, still)
                      .record(RecordType::temperature, temperature(0, 300))
                      .seconds(4, still);
  const auto recording = log.rests({{"temperature_calibration.json", kThermometer}});
  ASSERT_OK(recording);
  ASSERT_EQ(recording->rests.size(), 4U);
  EXPECT_FALSE(recording->rests[0].temperature_c) << "nothing was said yet";
  EXPECT_NEAR(recording->rests[1].temperature_c.value_or(0), 25, 1e-9);
  EXPECT_NEAR(recording->rests[2].temperature_c.value_or(0), 20, 1e-9);
  EXPECT_NEAR(recording->rests[3].temperature_c.value_or(0), 20, 1e-9) << "its own once it has one";
  const auto without = log.rests();
  ASSERT_OK(without);
  ASSERT_EQ(without->rests.size(), 4U);
  EXPECT_FALSE(without->rests[3].temperature_c) << "readings without a calibration are no degrees";
}

TEST(Rests, RawCountsWithoutACalibrationAreOf256) {
  const auto recording = Log().seconds(4, still, RecordType::activity3).rests();
  ASSERT_OK(recording);
  ASSERT_EQ(recording->rests.size(), 1U);
  EXPECT_LT((recording->rests[0].mean_g - Eigen::Vector3d(10, -20, 256) / 256).norm(), 1e-12);
  const auto nonsense =
      Log().seconds(4, still, RecordType::activity3).rests({{"calibration.json", "{]"}});
  ASSERT_OK(nonsense);
  EXPECT_EQ(nonsense->rests.size(), 1U);
}

TEST(Rests, CalibrationThatWasAppliedAlreadyIsNotAppliedAgain) {
  // Applied, it would make 0.5 g of 1 g on Z. The sensitivities are in hundredths of LSB/g.
  const auto calibration = [](bool applied) {
    return std::string(R"({"calibrationMethod": 2, "isCalibrated": )") +
           (applied ? "true" : "false") +
           R"(, "offsetX_30": 0, "offsetY_30": 0, "offsetZ_30": 128, "sensitivityXX_30": 25600,
              "sensitivityYY_30": 25600, "sensitivityZZ_30": 25600, "sensitivityXY_30": 0,
              "sensitivityXZ_30": 0, "sensitivityYZ_30": 0})";
  };
  for (const bool applied : {true, false}) {
    const auto recording = Log()
                               .seconds(4, still, RecordType::activity3)
                               .rests({{"calibration.json", calibration(applied)}});
    ASSERT_OK(recording);
    ASSERT_EQ(recording->rests.size(), 1U);
    EXPECT_NEAR(recording->rests[0].mean_g.z(), applied ? 1 : 0.5, 1e-12);
  }
}

TEST(Rests, Refuses) {
  MemoryEnv memory;
  EXPECT_FAILS(read_rests(memory.files, "nowhere.gt3x"), ErrorCode::no_input);
  const Log log = Log().seconds(4, still);
  for (const char* rate : {"0", "-30", "abc", "100000"}) {
    SCOPED_TRACE(rate);
    const auto refused = log.rests({}, gt3x::tests::made_info(rate));
    EXPECT_FAILS(refused, ErrorCode::bad_data);
    EXPECT_EQ(refused.error().where, "unit.gt3x");
  }
  EXPECT_FAILS(log.rests({{"calibration.json", std::string(2 << 20, ' ')}}), ErrorCode::bad_data);
}

TEST(Rests, OldFormWithoutALogIsRefused) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  EXPECT_FAILS(read_rests(posix_env().files, tests::shared_file("data/nhanes/NEO1B34100019.gt3x")),
               ErrorCode::bad_data);
}

// Oracle: the vendor's calibrated CSV of the same minute, whose noisiest axis has 0.24 g and more
// in every four seconds.
TEST(Rests, WornUnitNeverRests) {
  SIXPOINT_NEED_SHARED("data/agdc/WRIST_rawLSB_032Hz_test.agdc");
  const auto recording =
      read_rests(posix_env().files, tests::shared_file("data/agdc/WRIST_rawLSB_032Hz_test.agdc"));
  ASSERT_OK(recording);
  EXPECT_EQ(recording->serial, "CPW1Z12345678");
  EXPECT_TRUE(recording->rests.empty());
}

// Oracle: the vendor's CSV of the accelerometer's temperature, a row every four seconds.
TEST(Rests, ChamberRunsTemperaturesAreTheVendors) {
  SIXPOINT_NEED_SHARED("data/agdc/CPW1C48210013_baseline.agdc");
  const std::string folder = tests::shared_file("data/agdc/");
  const auto recording = read_rests(posix_env().files, folder + "CPW1C48210013_baseline.agdc");
  ASSERT_OK(recording);
  std::ifstream csv(folder +
                    "Csv_Calibrated/CPW1C48210013_baseline_temperature_ADXL_calibrated.csv");
  std::vector<std::pair<double, double>> rows;
  std::string line;
  std::getline(csv, line);
  while (std::getline(csv, line)) {
    rows.emplace_back(std::stod(line), std::stod(line.substr(line.find(',') + 1)));
  }
  ASSERT_GT(rows.size(), 3000U);
  // 3.5 h are 3150 blocks; the chamber's fan spoils few.
  EXPECT_GT(recording->rests.size(), 2000U);
  EXPECT_LE(recording->rests.size(), 3300U);
  double last_s = 0;
  std::size_t row = 0;
  for (const Rest& rest : recording->rests) {
    EXPECT_GE(rest.time_s, last_s + 4) << "in order, not one over the other";
    last_s = rest.time_s;
    while (row + 1 < rows.size() && rows[row + 1].first <= rest.time_s) {
      ++row;
    }
    // The reading before the block, or the one within it.
    const double before_c = rows[row].second;
    const double within_c = rows[std::min(row + 1, rows.size() - 1)].second;
    ASSERT_TRUE(rest.temperature_c);
    EXPECT_LT(std::min(std::abs(*rest.temperature_c - before_c),
                       std::abs(*rest.temperature_c - within_c)),
              1e-9)
        << rest.time_s;
    EXPECT_NEAR(rest.mean_g.norm(), 1, 0.05) << "one g, in raw counts by the vendor's calibration";
  }
}

}  // namespace
}  // namespace sixpoint::gap

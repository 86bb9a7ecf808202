#include "gt3x/forms/agdc.h"

#include <cmath>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gt3x/sample_reader.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

Result<std::string> text_of(Recording& recording, const std::string& name) {
  SIXPOINT_ASSIGN(const auto source, recording.open_entry(name));
  SIXPOINT_ASSIGN(const Bytes bytes, read_all(*source, 1 << 20));
  return std::string(bytes.begin(), bytes.end());
}

// The rows of a CSV below `header` lines, as numbers.
std::vector<std::vector<double>> rows_of(const std::string& path, int header) {
  std::ifstream in(path);
  std::string line;
  std::vector<std::vector<double>> rows;
  for (int i = 0; std::getline(in, line); ++i) {
    if (i < header || line.empty()) {
      continue;
    }
    std::vector<double> row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) {
      row.push_back(std::stod(cell));
    }
    rows.push_back(row);
  }
  return rows;
}

// Oracles: the vendor's raw and calibrated CSV of the same recording.
TEST(Agdc, RawCountsAndCalibratedValuesEqualTheVendors) {
  SIXPOINT_NEED_SHARED("data/agdc/WRIST_rawLSB_032Hz_test.agdc");
  const std::string folder = sixpoint::tests::shared_file("data/agdc/");
  auto recording = Recording::open(posix_env().files, folder + "WRIST_rawLSB_032Hz_test.agdc");
  ASSERT_OK(recording);
  const auto raw = rows_of(folder + "WRIST_rawLSB_032Hz.csv", 11);
  const auto calibrated = rows_of(folder + "WRIST_rawCalibrated_032Hz.csv", 11);
  const auto json = text_of(*recording, "calibration.json");
  ASSERT_OK(json);
  const auto calibration = parse_agdc_calibration(*json, 32);
  ASSERT_OK(calibration);
  EXPECT_EQ(calibration->method, 2);
  ASSERT_TRUE(calibration->constants);
  EXPECT_EQ(calibration->constants->negative_lsb, (PerAxis<int>{-256, -256, -256}));
  SampleReader reader(*recording);
  std::size_t row = 0;
  double worst_g = 0;
  for (;;) {
    const auto item = reader.next();
    ASSERT_OK(item);
    if (!*item) {
      break;
    }
    for (const Counts& counts : (*item)->counts) {
      ASSERT_LT(row, raw.size());
      const auto g = calibration->apply(counts);
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        ASSERT_EQ(counts[axis], raw[row][axis]) << "row " << row;
        worst_g = std::max(worst_g, std::abs(g[axis] - calibrated[row][axis]));
      }
      ++row;
    }
  }
  EXPECT_EQ(row, raw.size());
  EXPECT_EQ(row, calibrated.size());
  EXPECT_LT(worst_g, 1e-12);
}

// Oracles: the vendor's CSVs of the temperature readings and of the degrees made from them.
TEST(Agdc, TemperaturesEqualTheVendors) {
  SIXPOINT_NEED_SHARED("data/agdc/CPW1C48210013_baseline.agdc");
  const std::string folder = sixpoint::tests::shared_file("data/agdc/");
  auto recording = Recording::open(posix_env().files, folder + "CPW1C48210013_baseline.agdc");
  ASSERT_OK(recording);
  const auto die_adc =
      rows_of(folder + "Csv_ADC/CPW1C48210013_baseline_temperature_ADXL_ADC.csv", 1);
  const auto processor_adc =
      rows_of(folder + "Csv_ADC/CPW1C48210013_baseline_temperature_MCU_ADC.csv", 1);
  const auto die_c =
      rows_of(folder + "Csv_Calibrated/CPW1C48210013_baseline_temperature_ADXL_calibrated.csv", 1);
  const auto processor_c =
      rows_of(folder + "Csv_Calibrated/CPW1C48210013_baseline_temperature_MCU_calibrated.csv", 1);
  const auto json = text_of(*recording, "temperature_calibration.json");
  ASSERT_OK(json);
  const auto calibration = parse_temperature_calibration(*json);
  ASSERT_OK(calibration);
  auto log = recording->open_log();
  ASSERT_OK(log);
  std::size_t row = 0;
  for (;;) {
    const auto item = log->next();
    ASSERT_OK(item);
    if (!*item) {
      break;
    }
    if ((*item)->kind != LogItem::Kind::record || !(*item)->record.is(RecordType::temperature)) {
      continue;
    }
    ASSERT_LT(row, die_adc.size());
    const auto reading = parse_temperature((*item)->record.payload);
    ASSERT_OK(reading);
    ASSERT_EQ((*item)->record.unix_time, die_adc[row][0]);
    ASSERT_EQ(reading->accelerometer_adc, die_adc[row][1]);
    ASSERT_EQ(reading->processor_adc, processor_adc[row][1]);
    EXPECT_NEAR(calibration->accelerometer_c(*reading->accelerometer_adc), die_c[row][1], 1e-9);
    EXPECT_NEAR(calibration->processor_c(*reading->processor_adc), processor_c[row][1], 1e-9);
    ++row;
  }
  EXPECT_EQ(row, die_adc.size());
}

// Of samples that are in g, coefficients say how they became so, where they are there at all.
TEST(Agdc, WhatWasAppliedAlreadyNeedsNoCoefficients) {
  const auto bare = parse_agdc_calibration(R"({"isCalibrated":true})", 32);
  ASSERT_OK(bare);
  EXPECT_TRUE(bare->already_applied);
  EXPECT_FALSE(bare->constants);
  std::string json = R"({"isCalibrated":true,"calibrationMethod":2)";
  for (const char* key :
       {"offsetX", "offsetY", "offsetZ", "sensitivityXX", "sensitivityYY", "sensitivityZZ",
        "sensitivityXY", "sensitivityXZ", "sensitivityYZ", "zeroGOffsetX", "zeroGOffsetY",
        "zeroGOffsetZ", "positiveZeroGOffsetX", "positiveZeroGOffsetY", "positiveZeroGOffsetZ",
        "negativeZeroGOffsetX", "negativeZeroGOffsetY", "negativeZeroGOffsetZ"}) {
    json += std::string(",\"") + key + "_32\":250";
  }
  const auto full = parse_agdc_calibration(json + "}", 32);
  ASSERT_OK(full);
  ASSERT_TRUE(full->constants);
  EXPECT_EQ(full->constants->zero_lsb, (PerAxis<int>{250, 250, 250}));
  EXPECT_FAILS(parse_agdc_calibration(R"({"isCalibrated":false,"calibrationMethod":2})", 32),
               ErrorCode::bad_data);
}

TEST(Agdc, Refuses) {
  for (const char* wrong : {"", "[]", "{}", "{\"offsetX_32\": \"a\"}", "{\"offsetX_32\": 1e999}"}) {
    EXPECT_FAILS(parse_agdc_calibration(wrong, 32), ErrorCode::bad_data);
    EXPECT_FAILS(parse_temperature_calibration(wrong), ErrorCode::bad_data);
  }
  EXPECT_FAILS(parse_agdc_calibration(std::string(100'000, '['), 32), ErrorCode::bad_data);
  EXPECT_FAILS(
      parse_temperature_calibration(R"({"tempLow":1,"tempHigh":2,"mcuTempLow":5,"mcuTempHigh":5,)"
                                    R"("adxlTempLow":1,"adxlTempHigh":2})"),
      ErrorCode::bad_data);
  EXPECT_FAILS(parse_temperature({}), ErrorCode::bad_data);
  // Whatever else it holds: the vendor's public reader knows method 2 alone.
  for (const char* method : {"1", "3", "null", "\"2\"", "2.0e300"}) {
    std::string json = R"({"isCalibrated":false,"calibrationMethod":)" + std::string(method);
    for (const char* key : {"offsetX", "offsetY", "offsetZ", "sensitivityXX", "sensitivityYY",
                            "sensitivityZZ", "sensitivityXY", "sensitivityXZ", "sensitivityYZ"}) {
      json += std::string(",\"") + key + "_32\":25000";
    }
    EXPECT_FAILS(parse_agdc_calibration(json + "}", 32), ErrorCode::bad_data);
    const std::size_t at = json.find("false");
    EXPECT_OK(parse_agdc_calibration(json.replace(at, 5, "true") + "}", 32));
  }
  EXPECT_FAILS(parse_temperature(Bytes(4, 0)), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gt3x

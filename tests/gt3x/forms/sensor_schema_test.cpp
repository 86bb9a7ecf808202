#include "gt3x/forms/sensor_schema.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gt3x/forms/parameters.h"

namespace sixpoint::gt3x {
namespace {

struct MadeColumn {
  const char* label;
  std::uint8_t flags;
  std::uint8_t first_bit;
  std::uint8_t bits;
  double scale;
};

Bytes made_schema(const std::vector<MadeColumn>& columns) {
  Bytes payload = {7, 0, static_cast<std::uint8_t>(columns.size()), 0, 0, 0};
  for (const MadeColumn& column : columns) {
    payload.insert(payload.end(), {column.flags, column.first_bit, column.bits});
    const std::uint32_t scale = encode_float(column.scale);
    for (unsigned shift = 0; shift < 32; shift += 8) {
      payload.push_back(static_cast<std::uint8_t>(scale >> shift));
    }
    std::string label = column.label;
    label.resize(16, ' ');
    payload.insert(payload.end(), label.begin(), label.end());
  }
  return payload;
}

const std::vector<MadeColumn> kColumns = {
    {"A", 3, 0, 16, 2048},  // big-endian, signed
    {"B", 2, 16, 16, 0},    // little-endian, signed, as stored
    {"C", 0, 32, 8, 2},     // unsigned
    {"Temperature", 3, 40, 16, 1},
    {"", 0, 56, 8, 0},
    {"D", 2, 64, 32, 0},
};

TEST(SensorSchema, EveryKindOfColumn) {
  const auto schema = parse_sensor_schema(made_schema(kColumns));
  ASSERT_OK(schema);
  EXPECT_EQ(schema->id, 7);
  EXPECT_EQ(schema->sample_bytes, 12U);
  EXPECT_EQ(schema->labels(), (std::vector<std::string>{"A", "B", "C", "Temperature", "D"}));
  const Bytes data = {7, 0, 0x04, 0x00, 0xFE, 0xFF, 0xFF, 0x00, 0x05, 0x77, 0xFD, 0xFF, 0xFF, 0xFF};
  const auto samples = parse_sensor_data(*schema, data);
  ASSERT_OK(samples);
  ASSERT_EQ(samples->size(), 1U);
  EXPECT_EQ(samples->front(), (std::vector<double>{0.5, -2, 127.5, 26, -3}));
}

// The vendor's public description (SensorData.md) compares the label without regard to case.
TEST(SensorSchema, TemperatureIsKnownInCapitalsAndSmallLetters) {
  for (const char* label : {"Temperature", "temperature", "TEMPERATURE", "Temperatur"}) {
    const auto schema = parse_sensor_schema(made_schema({{label, 3, 0, 16, 1}}));
    ASSERT_OK(schema);
    const double plus_c = std::string(label) == "Temperatur" ? 0 : 21;
    EXPECT_EQ(parse_sensor_data(*schema, Bytes{7, 0, 0, 5}).value(),
              (std::vector<std::vector<double>>{{5 + plus_c}}))
        << label;
  }
}

TEST(SensorSchema, WhatCannotBeIsRefused) {
  const Bytes whole = made_schema(kColumns);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    SCOPED_TRACE(size);
    EXPECT_FAILS(parse_sensor_schema(std::span(whole).first(size)), ErrorCode::bad_data);
  }
  EXPECT_FAILS(parse_sensor_schema(made_schema({})), ErrorCode::bad_data);
  EXPECT_FAILS(parse_sensor_schema(made_schema({{"A", 0, 4, 16, 1}})), ErrorCode::bad_data);
  EXPECT_FAILS(parse_sensor_schema(made_schema({{"A", 0, 0, 12, 1}})), ErrorCode::bad_data);
  EXPECT_FAILS(parse_sensor_schema(made_schema({{"A", 0, 0, 0, 1}})), ErrorCode::bad_data);
  EXPECT_FAILS(parse_sensor_schema(made_schema(std::vector<MadeColumn>(65, kColumns[0]))),
               ErrorCode::bad_data);
  const auto schema = parse_sensor_schema(whole);
  ASSERT_OK(schema);
  EXPECT_FAILS(parse_sensor_data(*schema, Bytes{7}), ErrorCode::bad_data);
  EXPECT_FAILS(schema_of_sensor_data(Bytes{7}), ErrorCode::bad_data);
  EXPECT_FAILS(parse_sensor_data(*schema, Bytes{8, 0}), ErrorCode::bad_data);
  EXPECT_FAILS(parse_sensor_data(*schema, Bytes(2 + 11, 0)), ErrorCode::bad_data);
  EXPECT_TRUE(parse_sensor_data(*schema, Bytes{7, 0})->empty());
}

}  // namespace
}  // namespace sixpoint::gt3x

#include "gt3x/forms/parameters.h"

#include <cmath>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

// Oracle: values of the vendor's public description of PARAMETERS (4.1 V, 256, 333.87, 21, 16.384).
TEST(Parameters, PublishedFloats) {
  EXPECT_EQ(decode_float(0x09400000), 256.0);
  EXPECT_EQ(decode_float(0x05540000), 21.0);
  EXPECT_NEAR(decode_float(0x03419581), 4.1, 0.005);  // published with one decimal
  EXPECT_NEAR(decode_float(0x095377AE), 333.87, 5e-3);
  EXPECT_NEAR(decode_float(0x05418937), 16.384, 1e-5);
  EXPECT_EQ(encode_float(256.0), 0x09400000U);
  EXPECT_EQ(encode_float(21.0), 0x05540000U);
  EXPECT_EQ(encode_float(16.384), 0x05418937U);
}

TEST(Parameters, FloatsAtTheEdges) {
  EXPECT_EQ(encode_float(0), 0U);
  EXPECT_EQ(encode_float(1e-9), 0U);
  EXPECT_EQ(encode_float(std::nan("")), 0U);
  EXPECT_EQ(decode_float(0), 0.0);
  EXPECT_EQ(encode_float(std::numeric_limits<double>::max()), 0x007FFFFFU);
  EXPECT_EQ(encode_float(-std::numeric_limits<double>::infinity()), 0x00800000U);
  EXPECT_EQ(decode_float(0x007FFFFF), std::numeric_limits<double>::max());
  for (const double value : {-1.0, 0.5, -0.75, 341.0, -1e30, 1.0 / 1024}) {
    EXPECT_NEAR(decode_float(encode_float(value)), value, std::abs(value) * 3e-7) << value;
  }
}

TEST(Parameters, RoundTrip) {
  const StoredConstants constants{{326, 287, 303}, {-201, -268, -192}, {61, 4, 61}};
  ParameterValues values;
  set_constants(values, constants);
  values[kParameterCalibrationTime] = 1'384'266'733;
  values[kParameterFirmwareVersion] = 0x01050000;
  values[kParameterAccelScale] = encode_float(256);
  values[{7, 9}] = 0xDEADBEEF;
  const Bytes payload = encode_parameters(values);
  const auto parsed = parse_parameters(payload);
  ASSERT_OK(parsed);
  EXPECT_EQ(parsed->constants, constants);
  EXPECT_EQ(to_iso8601(parsed->calibration_time.value()), "2013-11-12T14:32:13Z");
  EXPECT_EQ(parsed->accel_scale_lsb_per_g, 256.0);
  EXPECT_EQ(parsed->firmware, "1.5.0");
  EXPECT_EQ(parsed->values, values);
  EXPECT_FALSE(parsed->has_zero_range());
  EXPECT_EQ(encode_parameters(parsed->values), payload);
}

// Entries that stand twice: with one value they count, with two neither does, whichever comes last.
TEST(Parameters, AnEntryWithTwoValuesIsNotUsed) {
  ParameterValues values;
  set_constants(values, {{326, 287, 303}, {-201, -268, -192}, {61, 4, 61}});
  values[kParameterCalibrationTime] = 1'384'266'733;
  values[kParameterFirmwareVersion] = 0x01050000;
  values[kParameterAccelScale] = encode_float(256);
  const Bytes once = encode_parameters(values);
  Bytes twice = once;
  twice.insert(twice.end(), once.begin(), once.end());
  const auto same = parse_parameters(twice);
  ASSERT_OK(same);
  EXPECT_TRUE(same->doubled.empty());
  EXPECT_TRUE(same->constants && same->calibration_time && same->firmware);
  const auto without = [&](const ParameterKey& key, bool first) {
    const Bytes other = encode_parameters({{key, 7}});
    Bytes both = first ? other : once;
    const Bytes& rest = first ? once : other;
    both.insert(both.end(), rest.begin(), rest.end());
    auto parsed = parse_parameters(both);
    EXPECT_OK(parsed);
    EXPECT_EQ(parsed->doubled, std::set{key});
    return *std::move(parsed);
  };
  for (const bool first : {false, true}) {
    EXPECT_FALSE(without(kParameterCalibrationTime, first).calibration_time);
    EXPECT_FALSE(without(kParameterFirmwareVersion, first).firmware);
    EXPECT_FALSE(without(kParameterAccelScale, first).accel_scale_lsb_per_g);
    EXPECT_FALSE(without({kParameterUnitSpace, kParameterZero}, first).constants);
  }
}

TEST(Parameters, SomeOfTheNineAgreeOrNot) {
  const StoredConstants constants{{326, 287, 303}, {-201, -268, -192}, {61, 4, 61}};
  const auto agree = [&](const ParameterValues& values) {
    const auto parsed = parse_parameters(encode_parameters(values));
    return parsed && parsed->agrees_with(constants);
  };
  EXPECT_TRUE(agree({})) << "none of them";
  ParameterValues values;
  set_constants(values, constants);
  EXPECT_TRUE(agree(values));
  values.erase({kParameterUnitSpace, kParameterZero});
  EXPECT_TRUE(agree(values));
  values[{kParameterUnitSpace, kParameterNegative}] = static_cast<std::uint32_t>(-202);
  EXPECT_FALSE(agree(values));
  Bytes payload = encode_parameters({{{kParameterUnitSpace, kParameterZero}, 61}});
  const Bytes other = encode_parameters({{{kParameterUnitSpace, kParameterZero}, 62}});
  payload.insert(payload.begin(), other.begin(), other.end());
  EXPECT_FALSE(parse_parameters(payload)->agrees_with(constants)) << "twice";
}

TEST(Parameters, MissingOrImpossibleConstantsAreAbsent) {
  ParameterValues values;
  set_constants(values, {{300, 300, 300}, {-200, -200, -200}, {50, 50, 50}});
  ParameterValues missing = values;
  missing.erase({1, 16});
  EXPECT_FALSE(parse_parameters(encode_parameters(missing))->constants);
  ParameterValues outside = values;
  outside[{1, 4}] = 2048;
  EXPECT_FALSE(parse_parameters(encode_parameters(outside))->constants);
  ParameterValues equal = values;
  equal[{1, 7}] = static_cast<std::uint32_t>(-200);
  EXPECT_TRUE(parse_parameters(encode_parameters(equal))->has_zero_range());
  EXPECT_FALSE(parse_parameters({})->constants);
  const Bytes odd(9, 0);
  EXPECT_FAILS(parse_parameters(odd), ErrorCode::bad_data);
}

TEST(Parameters, FirmwareVersions) {
  EXPECT_EQ(decode_firmware(0x01090002), "1.9.2");
  EXPECT_EQ(encode_firmware("1.9.2"), 0x01090002U);
  EXPECT_EQ(encode_firmware("1.1.37"), 0x01010025U);
  for (const char* wrong : {"", "1", "1.2", "1.2.", "1.2.3.4", "1.256.0", "a.b.c", "1.2.70000"}) {
    EXPECT_FALSE(encode_firmware(wrong)) << wrong;
  }
}

}  // namespace
}  // namespace sixpoint::gt3x

#include "mocks/firmware/virtual_settings.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::mocks {
namespace {

// The string of the command line's contract.
constexpr const char* kContract =
    "seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,positive_lsb=311/310/287,"
    "negative_lsb=-204/-216/-234,zero_lsb=54/47/26,true_sensitivity_lsb_per_g=237.7/251.8/242.3,"
    "true_zero_lsb=49.9/95.8/60.8,jig=auto";

// The same unit measured another time; without a noise of its own, the same to the last digit.
TEST(VirtualSettings, NoiseHasASeedOfItsOwn) {
  const auto plain = parse_virtual_settings("seed=7", 1);
  const auto again = parse_virtual_settings("seed=7,noise=3", 1);
  ASSERT_OK(plain);
  ASSERT_OK(again);
  EXPECT_EQ(plain->unit.seed, 7U);
  EXPECT_EQ(again->unit.seed, 3U);
  EXPECT_EQ(plain->unit.truth.serial, again->unit.truth.serial);
  EXPECT_EQ(plain->unit.truth.current.zero_lsb, again->unit.truth.current.zero_lsb);
  EXPECT_FAILS(parse_virtual_settings("noise=x", 1), ErrorCode::usage);
}

TEST(VirtualSettings, ReadsTheContractsExample) {
  const auto settings = parse_virtual_settings(kContract, 1);
  ASSERT_OK(settings);
  const sim::UnitTruth& truth = settings->unit.truth;
  EXPECT_EQ(truth.serial, "MOS2A45130007");
  EXPECT_EQ(truth.firmware, "1.5.0");
  EXPECT_EQ(to_iso8601(truth.calibrated), "2013-11-12T00:00:00Z");
  EXPECT_EQ(truth.constants, (StoredConstants{{311, 310, 287}, {-204, -216, -234}, {54, 47, 26}}));
  EXPECT_EQ(truth.current.sensitivity_lsb_per_g, (PerAxis<double>{237.7, 251.8, 242.3}));
  EXPECT_EQ(truth.current.zero_lsb, (PerAxis<double>{49.9, 95.8, 60.8}));
  EXPECT_TRUE(settings->with_jig);
  EXPECT_EQ(settings->unit.seed, 7U);
}

TEST(VirtualSettings, WhatIsLeftOutComesFromTheSeed) {
  const auto one = parse_virtual_settings("", 5);
  const auto same = parse_virtual_settings("seed=5", 1);
  const auto other = parse_virtual_settings("seed=6", 1);
  ASSERT_OK(one);
  EXPECT_EQ(one->unit.truth.current, same->unit.truth.current);
  EXPECT_NE(one->unit.truth.current, other->unit.truth.current);
  EXPECT_FALSE(one->with_jig);
}

TEST(VirtualSettings, SaysWhatIsGivenTwice) {
  const auto twice = parse_virtual_settings("seed=7,seed=8", 1);
  EXPECT_FAILS(twice, ErrorCode::usage);
  EXPECT_EQ(twice.error().what, "virtual unit: seed is given twice");
}

TEST(VirtualSettings, RefusesWhatItDoesNotKnow) {
  for (const char* text : {"speed=7",
                           "seed",
                           "seed=",
                           "seed=-1",
                           "seed=7x",
                           "seed=1,seed=1",
                           "serial=",
                           "serial=MOS 1",
                           "serial=ABCDEFGHIJKLMNOPQ",
                           "firmware=beta",
                           "calibrated=yesterday",
                           "calibrated=1950-01-01",
                           "positive_lsb=1/2",
                           "positive_lsb=1/2/3/4",
                           "positive_lsb=1/2/x",
                           "positive_lsb=1/2/3.5",
                           "positive_lsb=1/2/9999",
                           "true_zero_lsb=nan/1/1",
                           "true_sensitivity_lsb_per_g=0/1/1",
                           "jig=yes",
                           "pace=slow",
                           "battery_mv=-3",
                           "temperature_c=hot",
                           "positive_lsb=1/1/1,negative_lsb=1/1/1",
                           "interfaces=hid",
                           "interfaces=",
                           "seed=7,,jig=auto"}) {
    SCOPED_TRACE(text);
    EXPECT_FAILS(parse_virtual_settings(text, 1), ErrorCode::usage);
  }
}

TEST(VirtualSettings, AWordThatIsNoSettingIsNamedAsItWasGiven) {
  EXPECT_EQ(parse_virtual_settings("foo", 1).error().what,
            "virtual unit: foo is not a setting of the form key=value");
}

TEST(VirtualSettings, TheSchemeOpens) {
  device::TransportRegistry registry;
  register_virtual(registry);
  MemoryEnv env;
  const auto link = registry.open(std::string("virtual:") + kContract, env.env);
  ASSERT_OK(link);
  EXPECT_NE(link->jig, nullptr);
  EXPECT_NE(link->bulk, nullptr);
  EXPECT_FAILS(registry.open("virtual:x=1", env.env), ErrorCode::usage);
  EXPECT_FAILS(registry.open("usb:1", env.env), ErrorCode::usage);
  EXPECT_FAILS(registry.open("virtual", env.env), ErrorCode::usage);
}

TEST(VirtualSettings, AUnitOfFilesAloneIsNotOpened) {
  const auto settings = parse_virtual_settings("seed=7,interfaces=storage", 1);
  ASSERT_OK(settings);
  EXPECT_TRUE(settings->storage_only);
  EXPECT_FALSE(parse_virtual_settings("interfaces=all", 1)->storage_only);
  EXPECT_OK(parse_openable_settings("seed=7,interfaces=all", 1));
  const auto refused = parse_openable_settings("seed=7,interfaces=storage", 1);
  EXPECT_FAILS(refused, ErrorCode::usage);
  EXPECT_NE(refused.error().hint.find("drive:FOLDER"), std::string::npos);
}

TEST(VirtualSettings, ReadsHowTheJigTiltsAndTheSensorIsTurned) {
  const auto settings =
      parse_virtual_settings("jig_tilt_deg=0.1/-0.2/0,misalignment_deg=1/2/-3", 1);
  ASSERT_OK(settings);
  EXPECT_EQ(settings->unit.jig_tilt_deg, (PerAxis<double>{0.1, -0.2, 0}));
  EXPECT_EQ(settings->unit.misalignment_deg, (PerAxis<double>{1, 2, -3}));
  for (const char* text :
       {"jig_tilt_deg=0.1/0.2", "jig_tilt_deg=11/0/0", "misalignment_deg=a/0/0"}) {
    EXPECT_FAILS(parse_virtual_settings(text, 1), ErrorCode::usage);
  }
}

}  // namespace
}  // namespace sixpoint::mocks

#include <gtest/gtest.h>

#include "gap/explain/catalogue.h"
#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

TEST(ProtocolKind, ThreeMinutesOfFaces) {
  Bundle bundle = tests::made_production({});
  const ProtocolKind kind = protocol_kind(bundle);
  EXPECT_EQ(kind.name, "production");
  for (const unsigned has : {kPoses, kMoves, kRepeats, kHostClock}) {
    EXPECT_NE(kind.abilities & has, 0U) << has;
  }
  for (const unsigned lacks : {kShaker, kTemperature, kSoak, kLongRecord, kHours, kBothWays}) {
    EXPECT_EQ(kind.abilities & lacks, 0U) << lacks;
  }
  bundle.host_clock = {};
  bundle.segments.resize(5);
  const ProtocolKind less = protocol_kind(bundle);
  EXPECT_EQ(less.name, "other") << "five faces";
  EXPECT_EQ(less.abilities & (kPoses | kHostClock | kRepeats), 0U);
}

TEST(ProtocolKind, ShakerAndTemperatureAreEngineering) {
  Bundle bundle = tests::made_production({});
  Segment tone = bundle.segments.front();
  tone.vibration = Vibration{Eigen::Vector3d::UnitZ(), 20, 6};
  tone.host_start_s = bundle.segments.back().host_start_s + 16;
  bundle.segments.push_back(tone);
  bundle.temperature = {};
  for (std::size_t i = 12; i < 18; ++i) {
    bundle.segments[i].temperature_start_c = bundle.segments[i].temperature_end_c = 40;
  }
  const ProtocolKind kind = protocol_kind(bundle);
  EXPECT_EQ(kind.name, "engineering");
  EXPECT_NE(kind.abilities & kHighShaker, 0U);
  EXPECT_EQ(kind.abilities & kFullScale, 0U) << "6 g clip nothing";
  EXPECT_NE(kind.abilities & kSoak, 0U) << "six faces at 23 and 40 C";
}

}  // namespace
}  // namespace sixpoint::gap

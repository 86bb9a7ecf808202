#include "sim/standard_protocol.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "shared_data.h"

namespace sixpoint::sim {
namespace {

using Protocol = std::vector<ProtocolSegment>;

Protocol named(const Protocol& protocol, const std::string& name) {
  Protocol found;
  std::copy_if(protocol.begin(), protocol.end(), std::back_inserter(found),
               [&](const ProtocolSegment& segment) { return segment.name == name; });
  return found;
}

// "+x": which axis of the unit points up; "?" where it is none.
std::string face_of(const Eigen::Matrix3d& rotation) {
  const Eigen::Vector3d up = rotation.col(2);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    if (std::abs(std::abs(up[axis]) - 1) < 1e-12) {
      return std::string(up[axis] > 0 ? "+" : "-") + "xyz"[axis];
    }
  }
  return "?";
}

std::vector<std::string> faces_of(const Protocol& protocol) {
  std::vector<std::string> faces;
  for (const ProtocolSegment& segment : protocol) {
    faces.push_back(face_of(segment.rotation));
  }
  return faces;
}

const std::set<std::string> kSixFaces = {"+x", "-x", "+y", "-y", "+z", "-z"};

std::set<std::string> set_of(const std::vector<std::string>& list) {
  return {list.begin(), list.end()};
}

double end_s(const ProtocolSegment& segment) {
  return segment.host_start_s + static_cast<double>(segment.samples) / 100;
}

// The two protocols, of several seeds.
std::vector<Protocol> drawn() {
  std::vector<Protocol> list;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    list.push_back(draw_protocol(StandardProtocol::production, seed));
    list.push_back(draw_protocol(StandardProtocol::engineering, seed));
  }
  return list;
}

TEST(StandardProtocol, NamesAreThoseOfTheCommandLine) {
  EXPECT_EQ(to_string(StandardProtocol::production), "production");
  EXPECT_EQ(parse_standard_protocol("engineering"), StandardProtocol::engineering);
  EXPECT_FALSE(parse_standard_protocol("Production"));
  EXPECT_FALSE(parse_standard_protocol(""));
}

// Oracle: what the header says: samples follow each other without holes, time goes on, and every
// pose is a rotation.
TEST(StandardProtocol, SegmentsFollowOneAnother) {
  for (const Protocol& protocol : drawn()) {
    std::uint64_t next = 0;
    double ended_s = 0;
    for (const ProtocolSegment& segment : protocol) {
      EXPECT_EQ(segment.first_sample, next);
      EXPECT_GE(segment.host_start_s, ended_s - 1e-3);
      EXPECT_NEAR(segment.rotation.determinant(), 1, 1e-12);
      EXPECT_LT(
          (segment.rotation * segment.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(),
          1e-12);
      EXPECT_EQ(segment.vibration.has_value(), segment.kind == SegmentKind::vibration);
      next = segment.first_sample + segment.samples;
      ended_s = end_s(segment);
    }
  }
}

// Oracle: six faces, the same in reverse order, and six placements after the unit was taken off;
// 10 s each: three minutes of recording.
TEST(StandardProtocol, ProductionIsSixFacesThereAndBackAndSixReseated) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Protocol protocol = draw_protocol(StandardProtocol::production, seed);
    ASSERT_EQ(protocol.size(), 18U);
    const auto there = faces_of(named(protocol, "faces"));
    auto back = faces_of(named(protocol, "faces_reversed"));
    std::reverse(back.begin(), back.end());
    EXPECT_EQ(set_of(there), kSixFaces);
    EXPECT_EQ(back, there);
    EXPECT_EQ(set_of(faces_of(named(protocol, "reseat"))), kSixFaces);
    for (std::size_t i = 0; i < protocol.size(); ++i) {
      EXPECT_EQ(protocol[i].samples, 1000U);
      EXPECT_EQ(protocol[i].kind, SegmentKind::still);
      EXPECT_EQ(protocol[i].commanded_c, (std::array<double, 2>{23, 23}));
      if (i > 0) {
        // A jig turns in seconds; taking the unit off and putting it back takes a person longer.
        const double pause_s = protocol[i].host_start_s - end_s(protocol[i - 1]);
        EXPECT_GT(pause_s, protocol[i].name == "reseat" ? 10 : 2);
        EXPECT_LT(pause_s, protocol[i].name == "reseat" ? 30 : 10);
      }
    }
  }
}

// Oracle: the shaker's stroke of 10 mm: a sine of that amplitude has (2 pi f)^2 0.01 m / 9.80665
// m/s2 in g, 0.161 at 2 Hz and 0.644 at 4 Hz; from 7 Hz on the protocol's 1 g limits.
TEST(StandardProtocol, TheShakerGoesThroughItsTonesOnEachAxis) {
  const Protocol protocol = draw_protocol(StandardProtocol::engineering, 3);
  const Protocol shaker = named(protocol, "shaker");
  ASSERT_EQ(shaker.size(), 24U);
  constexpr std::array<double, 8> kTones_hz = {2, 4, 7, 11, 16, 22, 30, 40};
  constexpr std::array<double, 8> kAmplitudes_g = {0.161, 0.6441, 1, 1, 1, 1, 1, 1};
  for (std::size_t i = 0; i < shaker.size(); ++i) {
    ASSERT_TRUE(shaker[i].vibration);
    EXPECT_EQ(shaker[i].vibration->frequency_hz, kTones_hz[i % 8]);
    EXPECT_NEAR(shaker[i].vibration->amplitude_g, kAmplitudes_g[i % 8], 1e-4);
    EXPECT_EQ(shaker[i].samples, 1000U);
    // The axis that points up is shaken.
    EXPECT_EQ(face_of(shaker[i].rotation), std::string("+") + "xyz"[i / 8]);
    EXPECT_EQ(shaker[i].vibration->direction_lab, Eigen::Vector3d(0, 0, 1));
  }
  const Protocol high = named(protocol, "shaker_high");
  ASSERT_EQ(high.size(), 6U);
  for (std::size_t i = 0; i < high.size(); ++i) {
    EXPECT_EQ(high[i].vibration->frequency_hz, i % 2 == 0 ? 20 : 19.3);
    EXPECT_EQ(high[i].vibration->amplitude_g, i % 2 == 0 ? 6 : 11);
  }
}

// Oracle: each face at four yaws, a quarter of a turn apart.
TEST(StandardProtocol, YawsAreSixFacesTimesFour) {
  const Protocol yaws = named(draw_protocol(StandardProtocol::engineering, 3), "yaw");
  ASSERT_EQ(yaws.size(), 24U);
  std::map<std::string, std::vector<Eigen::Matrix3d>> of_face;
  for (const ProtocolSegment& segment : yaws) {
    of_face[face_of(segment.rotation)].push_back(segment.rotation);
  }
  EXPECT_EQ(of_face.size(), 6U);
  for (const auto& [face, rotations] : of_face) {
    ASSERT_EQ(rotations.size(), 4U) << face;
    // Where the laboratory's x lies in the unit: four directions that cancel.
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      sum += rotations[i].col(0);
      for (std::size_t k = 0; k < i; ++k) {
        EXPECT_GT((rotations[i] - rotations[k]).norm(), 1) << face;
      }
    }
    EXPECT_LT(sum.norm(), 1e-12) << face;
  }
}

// Oracle: 18 points that are even over the sphere: their mean is the centre, and the mean of n n'
// is a third of the identity.
TEST(StandardProtocol, ObliquePosesAreEvenOverTheSphere) {
  const Protocol oblique = named(draw_protocol(StandardProtocol::engineering, 3), "oblique");
  ASSERT_EQ(oblique.size(), 18U);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double closest_deg = 180;
  for (std::size_t i = 0; i < oblique.size(); ++i) {
    const Eigen::Vector3d up = oblique[i].rotation.col(2);
    mean += up / 18;
    second += up * up.transpose() / 18;
    for (std::size_t k = 0; k < i; ++k) {
      const double cosine = std::clamp(up.dot(oblique[k].rotation.col(2)), -1.0, 1.0);
      closest_deg = std::min(closest_deg, std::acos(cosine) * 180 / M_PI);
    }
  }
  EXPECT_LT(mean.norm(), 0.05);
  EXPECT_LT((second - Eigen::Matrix3d::Identity() / 3).cwiseAbs().maxCoeff(), 0.05);
  EXPECT_GT(closest_deg, 30);
}

// Oracle: the header: twenty still minutes; ramps up and down at two rates with holds; six faces at
// two temperatures; 75 minutes of recording in about three hours.
TEST(StandardProtocol, EngineeringHasTheStillMinutesRampsAndSoaks) {
  const Protocol protocol = draw_protocol(StandardProtocol::engineering, 3);
  const Protocol still = named(protocol, "still");
  ASSERT_EQ(still.size(), 1U);
  EXPECT_EQ(still[0].samples, 120'000U);
  for (const char* name : {"ramp_up", "ramp_down"}) {
    std::set<double> rates_c_per_min;
    bool holds = false;
    for (const ProtocolSegment& segment : named(protocol, name)) {
      const double minutes = static_cast<double>(segment.samples) / 6000;
      const double rate = (segment.commanded_c[1] - segment.commanded_c[0]) / minutes;
      EXPECT_EQ(segment.kind, SegmentKind::ramp);
      holds = holds || rate == 0;
      if (rate != 0) {
        EXPECT_EQ(rate > 0, std::string(name) == "ramp_up");
        rates_c_per_min.insert(std::round(1e6 * std::abs(rate)));
      }
    }
    EXPECT_EQ(rates_c_per_min.size(), 2U) << name;
    EXPECT_TRUE(holds) << name;
  }
  std::map<double, std::vector<std::string>> soaks;
  for (const ProtocolSegment& segment : named(protocol, "soak")) {
    EXPECT_EQ(segment.kind, SegmentKind::soak);
    EXPECT_EQ(segment.samples, 3000U);
    EXPECT_EQ(segment.commanded_c[0], segment.commanded_c[1]);
    soaks[segment.commanded_c[0]].push_back(face_of(segment.rotation));
  }
  ASSERT_EQ(soaks.size(), 2U);
  for (const auto& [temperature_c, faces] : soaks) {
    EXPECT_EQ(faces.size(), 6U);
    EXPECT_EQ(set_of(faces), kSixFaces) << temperature_c;
  }
  const ProtocolSegment& last = protocol.back();
  EXPECT_NEAR(static_cast<double>(last.first_sample + last.samples) / 6000, 75, 1);
  EXPECT_NEAR(end_s(last) / 3600, 3, 0.5);
}

TEST(StandardProtocol, TheSeedDrawsOrderAndPauses) {
  const Protocol first = draw_protocol(StandardProtocol::production, 1);
  const Protocol again = draw_protocol(StandardProtocol::production, 1);
  std::set<std::vector<std::string>> orders;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    orders.insert(faces_of(named(draw_protocol(StandardProtocol::production, seed), "faces")));
  }
  EXPECT_GT(orders.size(), 5U);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].host_start_s, again[i].host_start_s);
    EXPECT_EQ(first[i].rotation, again[i].rotation);
  }
  EXPECT_EQ(draw_protocol(StandardProtocol::production, 1, 30)[0].samples, 300U);
}

// Oracle: a bundle of an independent generator. The same names, kinds, lengths, temperatures and
// tones in the same order; order of the poses, pauses and phases are drawn.
TEST(StandardProtocol, IsTheProtocolOfThePracticeBundles) {
  SIXPOINT_NEED_SHARED("gap/practice/labels.json");
  const struct {
    StandardProtocol protocol;
    const char* bundle;
  } rows[] = {{StandardProtocol::engineering, "gap/practice/engineering/b0001"},
              {StandardProtocol::production, "gap/practice/production/b0009"}};
  for (const auto& row : rows) {
    std::ifstream file(tests::shared_file(std::string(row.bundle) + "/protocol.json"));
    const auto segments = nlohmann::json::parse(file)["segments"];
    const Protocol protocol = draw_protocol(row.protocol, 1);
    ASSERT_EQ(protocol.size(), segments.size()) << row.bundle;
    for (std::size_t i = 0; i < protocol.size(); ++i) {
      SCOPED_TRACE(std::string(row.bundle) + " " + std::to_string(i));
      const auto& other = segments[i];
      EXPECT_EQ(protocol[i].name, other["name"]);
      EXPECT_EQ(to_string(protocol[i].kind), other["kind"]);
      EXPECT_EQ(protocol[i].first_sample, other["first_sample"]);
      EXPECT_EQ(protocol[i].samples, other["samples"]);
      const auto& celsius = other["temperature_c"];
      EXPECT_EQ(protocol[i].commanded_c[0], celsius.is_array() ? celsius[0] : celsius);
      EXPECT_EQ(protocol[i].commanded_c[1], celsius.is_array() ? celsius[1] : celsius);
      ASSERT_EQ(protocol[i].vibration.has_value(), other.contains("vibration"));
      if (protocol[i].vibration) {
        EXPECT_EQ(protocol[i].vibration->frequency_hz, other["vibration"]["frequency_hz"]);
        EXPECT_NEAR(protocol[i].vibration->amplitude_g,
                    other["vibration"]["amplitude_g"].get<double>(), 1e-4);
      }
    }
  }
}

ProtocolSegment chamber(double start_s, double duration_s, double from_c, double to_c) {
  ProtocolSegment segment;
  segment.host_start_s = start_s;
  segment.samples = static_cast<std::uint64_t>(duration_s * 100);
  segment.commanded_c = {from_c, to_c};
  return segment;
}

// Oracle: the step response of a lag of one minute: what is left of a difference falls by e^(-1/60)
// every second.
TEST(StandardProtocol, TheUnitFollowsTheChamberWithALagOfAMinute) {
  // From 20 to 40 C in the five minutes that the chamber takes; then it holds 40 C.
  const auto points = unit_temperature({chamber(0, 600, 20, 20), chamber(900, 1200, 40, 40)}, 100);
  ASSERT_EQ(points.size(), 2101U);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].host_time_s, static_cast<double>(i) + 0.5) << "one a second";
  }
  for (std::size_t i = 0; i < 600; ++i) {
    EXPECT_NEAR(points[i].temperature_c, 20, 1e-9);
  }
  for (std::size_t i = 910; i < 1500; ++i) {
    const double left_c = 40 - points[i].temperature_c;
    EXPECT_NEAR((40 - points[i + 1].temperature_c) / left_c, std::exp(-1.0 / 60), 1e-6) << i;
  }
  EXPECT_NEAR(points.back().temperature_c, 40, 1e-5);
}

// Oracle: a lag of one minute behind a ramp is one minute of the ramp: 1.5 C at 1.5 C a minute.
TEST(StandardProtocol, BehindARampTheUnitIsAMinuteLate) {
  const auto points = unit_temperature({chamber(0, 1200, 15, 45)}, 100);
  for (std::size_t i = 600; i < 1190; ++i) {
    const double chamber_c = 15 + points[i].host_time_s * 1.5 / 60;
    EXPECT_NEAR(chamber_c - points[i].temperature_c, 1.5, 0.02) << i;
  }
}

TEST(StandardProtocol, WithoutSegmentsThereIsNoTemperature) {
  EXPECT_TRUE(unit_temperature({}, 100).empty());
}

}  // namespace
}  // namespace sixpoint::sim

// The kinds outside the catalogue that occur in service: does each do what its form says? The
// oracle is the form itself, in closed form, for many draws. Nothing here diagnoses them: they have
// to stay blind.
#include <Eigen/Geometry>
#include <algorithm>
#include <bitset>
#include <cmath>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "gap/challenge/made_rig.h"
#include "gap/challenge/outside.h"

namespace sixpoint::gap {
namespace {

using tests::expect_some;
using tests::forms_where;
using tests::kForms;
using tests::kLsbPerG;
using tests::kRate_hz;
using tests::Matrix3d;
using tests::pose;
using tests::Rig;
using tests::Vector3d;

TEST(OutsideServiced, StressCreepFollowsTheLoadAndForgets) {
  std::set<int> half_times_s;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("stress_creep", form);
    rig.place(pose({0, 0, 1}));
    rig.record(1000);
    EXPECT_LT(rig.change(999).norm(), 1e-12);  // has lain like that for ever
    rig.place(pose({0, 0, -1}), 0);
    rig.record(60'000);
    const double at_once = rig.change(0).z();
    EXPECT_LE(std::abs(at_once), 2 * 2e-3 + 1e-9);  // 2 mg/g, two g
    EXPECT_NEAR(rig.change(0).head<2>().norm(), 0, 1e-9);
    EXPECT_LT(std::abs(rig.change(3000).z()), std::abs(at_once));
    const double half = at_once / 2;
    std::size_t i = 0;
    while (i < 59'999 && std::abs(rig.change(i).z()) > std::abs(half)) {
      ++i;
    }
    half_times_s.insert(static_cast<int>(i / 100));
    rig.place(pose({0, 0, -1}), 20'000);
    rig.record(1);
    EXPECT_LT(std::abs(rig.change(0).z()), 1e-3 * std::abs(at_once) + 1e-12);
  }
  EXPECT_GT(half_times_s.size(), 10U);
  EXPECT_GE(*half_times_s.begin(), 3);  // 5 s x ln 2
}

TEST(OutsideServiced, BitWeightStepsWhereABitTurnsOver) {
  std::set<std::size_t> steps;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("bit_weight", form);
    std::set<long> values;
    double last = std::nan("");
    std::size_t turns = 0;
    for (int code = -300; code < 300; ++code) {
      const double g = code / kLsbPerG;
      Matrix3d stretched = Matrix3d::Zero();  // no pose: all three axes at this code
      stretched.col(2) = Vector3d(g, g, g);
      rig.place(stretched);
      const Vector3d change = rig.change_here() * kLsbPerG;
      const double most = change.cwiseAbs().maxCoeff();
      const double now = change.sum();
      values.insert(std::lround(1e6 * now));
      EXPECT_LE(most, 2 + 1e-9);
      if (!std::isnan(last) && std::abs(now - last) > 1e-9) {
        EXPECT_EQ((code + 2048) % 8, 0) << code;  // bit 3 is the lowest that may be wrong
        ++turns;
      }
      last = now;
    }
    EXPECT_GE(values.size(), 2U);
    EXPECT_LE(values.size(), 4U);
    steps.insert(turns);
  }
  EXPECT_GE(steps.size(), 4U);
}

TEST(OutsideServiced, CrosstalkIsOneCrossTermPerAxisAtRest) {
  std::set<std::string> patterns;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Matrix3d terms;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      Rig rig("channel_crosstalk", form);
      rig.place(pose(Vector3d::Unit(axis)));
      rig.record(10);
      terms.col(axis) = rig.change(9);
    }
    std::string pattern;
    for (Eigen::Index row = 0; row < 3; ++row) {
      EXPECT_NEAR(terms.row(row).sum(), 0, 3e-5);  // what it gains of one it loses of its own
      EXPECT_NEAR(std::abs(terms(row, row)), 4e-3, 3e-5);
      for (Eigen::Index column = 0; column < 3; ++column) {
        if (column != row && std::abs(terms(row, column)) > 1e-3) {
          pattern += std::to_string(column) + (terms(row, column) > 0 ? "+" : "-");
        }
      }
    }
    EXPECT_EQ(pattern.size(), 6U);
    patterns.insert(pattern);
  }
  EXPECT_EQ(patterns.size(), 4U);  // two directions of the scan, two signs
  // One channel comes from the sample before: on a step it is late by one sample.
  Rig rig("channel_crosstalk", 3);
  rig.place(pose({0, 0, 1}));
  rig.record(200, 1.0, 10);
  int late = 0;
  for (std::size_t i = 1; i < 200; ++i) {
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      const double now = rig.change(i)[axis];
      late += std::abs(now) > 1e-4 ? 1 : 0;
    }
  }
  EXPECT_GT(late, 50);
}

TEST(OutsideServiced, BeatingRippleIsASlowLineThatWanders) {
  std::set<int> frequencies;
  int wanders = 0;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("beating_ripple", form);
    rig.place(pose({0, 0, 1}));
    std::array<int, 2> crossings{};
    for (int& count : crossings) {
      rig.record(20'000);
      Eigen::Index axis = 0;
      double most = 0;
      for (std::size_t i = 0; i < 20'000; ++i) {
        most = std::max(most, rig.change(i).cwiseAbs().maxCoeff(&axis));
      }
      EXPECT_LE(most, 2e-3 + 1e-9);
      EXPECT_GE(most, 1.5e-3);
      for (std::size_t i = 1; i < 20'000; ++i) {
        count += rig.change(i)[axis] * rig.change(i - 1)[axis] < 0 ? 1 : 0;
      }
      EXPECT_LT(count, 400 * 9);  // below 9 Hz in 200 s
    }
    frequencies.insert(crossings[0] / 100);
    wanders += std::abs(crossings[0] - crossings[1]) > 4 ? 1 : 0;
  }
  EXPECT_GT(frequencies.size(), 8U);
  EXPECT_GT(wanders, kForms / 2);
}

TEST(OutsideServiced, MagnetPullsByHowTheUnitStandsInTheRoom) {
  expect_some(forms_where("magnet_pull", [](Rig& rig) {
    const auto zero = [&](const Matrix3d& rotation) {
      rig.place(rotation);
      const Vector3d change = rig.change_here();
      EXPECT_LT((change - rig.change_here()).norm(), 1e-15);  // constant in a pose
      EXPECT_LE(change.cwiseAbs().maxCoeff(), 2e-3 + 1e-12);
      return change;
    };
    const Vector3d a = zero(pose({0, 0, 1}));
    const Vector3d b = zero(pose({0, 0, 1}, 90));
    const Vector3d turned = zero(pose({0, 0, 1}, 180));
    EXPECT_GT((a - b).norm() + (a - turned).norm(), 1e-7);  // not by gravity alone
    EXPECT_LT(a.cross(b).norm(), 1e-12);                    // always along one direction
    // Seen through a point, a magnet turns its sign and steel does not.
    const Matrix3d point = -pose({0, 0, 1});
    return (zero(point) + a).norm() < 1e-12;
  }));
}

TEST(OutsideServiced, CableTurnsTheUnitByPoseAlone) {
  expect_some(forms_where("cable_pull", [](Rig& rig) {
    const auto tipped_deg = [&](const Matrix3d& rotation) {
      rig.place(rotation);
      const auto& block = rig.record(1);
      const Matrix3d error = rotation.transpose() * block.motion[0].rotation;
      EXPECT_LT((error * error.transpose() - Matrix3d::Identity()).norm(), 1e-12);
      return Eigen::AngleAxisd(error).angle() * 180 / std::numbers::pi;
    };
    double least = 1;
    double most = 0;
    for (int i = 0; i < 60; ++i) {
      const double z = 1 - (2.0 * i + 1) / 60;
      const Vector3d up(std::sqrt(1 - z * z) * std::cos(2.4 * i),
                        std::sqrt(1 - z * z) * std::sin(2.4 * i), z);
      const double deg = tipped_deg(pose(up, 50.0 * i));
      EXPECT_LE(deg, 0.15 + 1e-6);
      EXPECT_NEAR(deg, tipped_deg(pose(up, 50.0 * i)), 1e-9);  // again and again
      least = std::min(least, deg);
      most = std::max(most, deg);
    }
    EXPECT_GT(most, 0.04);
    return least < 1e-7;
  }));
}

TEST(OutsideServiced, LooseBatteryLiesAtOneOfTwoEndsAndRemembers) {
  int remembers = 0;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("loose_battery", form);
    const auto zero = [&](const Vector3d& up) {
      rig.place(pose(up));
      return rig.change_here();
    };
    const Vector3d first = zero({1, 0, 0});
    EXPECT_NEAR(first.cwiseAbs().maxCoeff(), 1.5e-3, 1e-12);
    bool other = false;
    for (const Vector3d& up : {Vector3d(-1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, -1, 0),
                               Vector3d(0, 0, 1), Vector3d(0, 0, -1)}) {
      const Vector3d now = zero(up);
      EXPECT_TRUE((now - first).norm() < 1e-12 || (now + first).norm() < 1e-12);
      other = other || (now + first).norm() < 1e-12;
    }
    EXPECT_TRUE(other);
    for (const Vector3d& up : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
      for (const Vector3d& from : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
        zero(from);
        const Vector3d one = zero(up);
        zero(-from);
        remembers += from != up && (zero(up) + one).norm() < 1e-12 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(remembers, kForms / 4);
}

TEST(OutsideServiced, RegulatorLetsGoAtAMomentAndGoesOn) {
  constexpr std::size_t kSamples = 20'000;
  std::set<std::size_t> moments;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("regulator_dropout", form);
    rig.plan({kRate_hz, kSamples, {}});
    rig.place(pose({0, 0, 1}));
    rig.record(kSamples);
    std::size_t start = 0;
    while (start < kSamples && rig.change(start).norm() == 0) {
      ++start;
    }
    EXPECT_GE(start, kSamples / 5);
    EXPECT_LE(start, kSamples * 4 / 5 + 2);
    for (std::size_t i = start + 100; i < kSamples; i += 100) {
      EXPECT_GT(rig.change(i).norm(), rig.change(i - 100).norm());
    }
    EXPECT_LE(rig.change(kSamples - 1).cwiseAbs().maxCoeff(), 5e-3 + 2e-3 + 1e-9);
    EXPECT_GE(rig.change(kSamples - 1).cwiseAbs().maxCoeff(), 5e-3 - 2e-3 - 1e-5);
    moments.insert(start / 1000);
  }
  EXPECT_GT(moments.size(), 6U);
}

TEST(OutsideServiced, TornReadsMixTwoNeighbours) {
  std::set<int> rates;
  std::array<int, 2> new_high_old_low{};
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("torn_reads", form);
    rig.place(pose({0, 0, 1}));
    std::vector<gt3x::Counts> counts;
    for (std::int16_t i = 0; i < 20'000; ++i) {
      const auto odd = static_cast<std::int16_t>(i % 4 == 3);
      counts.push_back({static_cast<std::int16_t>(255 + odd), static_cast<std::int16_t>(-odd),
                        static_cast<std::int16_t>(100 + odd)});
    }
    const auto stored = rig.store(counts);
    int torn = 0;
    bool high_first = false;
    for (std::size_t i = 0; i < stored.size(); ++i) {
      const gt3x::Counts& now = stored[i];
      EXPECT_TRUE(now[0] == 240 || now[0] == 255 || now[0] == 256 || now[0] == 271) << now[0];
      EXPECT_TRUE(now[1] == -16 || now[1] == -1 || now[1] == 0 || now[1] == 15) << now[1];
      EXPECT_TRUE(now[2] == 100 || now[2] == 101) << now[2];
      torn += now[0] != counts[i][0] ? 1 : 0;
      // 255 to 256: the new low and the old high make 240.
      high_first = high_first || (counts[i][0] == 256 && now[0] == 271);
    }
    EXPECT_GT(torn, 40);  // half of the samples follow a change
    EXPECT_LT(torn, 800);
    rates.insert(torn / 50);
    ++new_high_old_low.at(high_first ? 1 : 0);
  }
  EXPECT_GT(rates.size(), 6U);
  EXPECT_GT(new_high_old_low[0], 5);
  EXPECT_GT(new_high_old_low[1], 5);
}

TEST(OutsideServiced, GradientFollowsTheRateOfTheTemperature) {
  std::set<int> lags;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("thermal_gradient", form);
    rig.place(pose({0, 0, 1}));
    rig.record(1000);
    EXPECT_LT(rig.change(999).norm(), 1e-12);  // constant temperature: nothing
    rig.ramp_c_per_s = 0.01;
    rig.place(pose({0, 0, 1}), 10'000);
    rig.record(10);
    const Vector3d rising = rig.change(9);  // 0.5 mg/C x 0.01 C/s x lag
    const double lag_s = rising.cwiseAbs().maxCoeff() / (0.5e-3 * 0.01);
    EXPECT_GE(lag_s, 40 - 1);
    EXPECT_LE(lag_s, 400 + 1);
    lags.insert(static_cast<int>(lag_s / 20));
    rig.ramp_c_per_s = -0.01;
    rig.record(1);
    rig.place(pose({0, 0, 1}), 10'000);
    rig.record(10);
    EXPECT_LT((rig.change(9) + rising).norm(), 0.01 * rising.norm());
    rig.ramp_c_per_s = 0;
    rig.record(1);
    rig.place(pose({0, 0, 1}), 10'000);
    rig.record(10);
    EXPECT_LT(rig.change(9).norm(), 1e-3 * rising.norm());
  }
  EXPECT_GT(lags.size(), 6U);
}

TEST(OutsideServiced, WrongPosesAreOneToThree) {
  constexpr std::size_t kRests = 18;
  constexpr std::size_t kEach = 1000;
  std::set<std::size_t> where;
  for (const auto& [severity, most] : {std::pair{0.5, 1}, std::pair{1.5, 2}, std::pair{2.5, 3}}) {
    for (std::uint64_t form = 0; form < kForms; ++form) {
      Rig rig("wrong_pose", form, severity);
      sim::RecordingPlan plan{kRate_hz, kRests * kEach, {}};
      for (std::size_t i = 0; i < kRests; ++i) {
        plan.rests.push_back({i * kEach, kEach});
      }
      rig.plan(plan);
      int wrong = 0;
      for (std::size_t i = 0; i < kRests; ++i) {
        const Matrix3d wanted = pose(Vector3d::Unit(static_cast<Eigen::Index>(i % 3)), 30);
        rig.place(wanted);
        const auto& block = rig.record(kEach);
        const double off = (block.true_g[kEach - 1] - wanted.col(2)).norm();
        EXPECT_TRUE(off < 1e-12 || off > 1.4) << off;  // a quarter turn at least
        EXPECT_NEAR(block.true_g[kEach - 1].norm(), 1, 1e-12);
        if (off > 1) {
          ++wrong;
          where.insert(i);
        }
      }
      EXPECT_GE(wrong, 1);
      EXPECT_LE(wrong, most);
    }
  }
  EXPECT_GT(where.size(), 10U);
}

TEST(OutsideServiced, BitErrorsAreFewAndStayWithinTwelveBits) {
  std::array<int, 3> laws{};
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("bit_errors", form);
    rig.place(pose({0, 0, 1}));
    const gt3x::Counts usual = {5, -20, 0x0B3};
    const auto stored = rig.store(std::vector<gt3x::Counts>(20'000, usual));
    int wrong = 0;
    int one_bit = 0;
    int nibbles = 0;
    for (const gt3x::Counts& counts : stored) {
      if (counts == usual) {
        continue;
      }
      ++wrong;
      int bits = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_GE(counts[axis], -2048);
        EXPECT_LE(counts[axis], 2047);
        const auto differ = static_cast<unsigned>(counts[axis] ^ usual[axis]) & 0xFFFU;
        bits += static_cast<int>(std::bitset<12>(differ).count());
      }
      one_bit += bits == 1 ? 1 : 0;
      nibbles += counts == gt3x::Counts{0x50, -20, 0x0B3} ||
                         counts == gt3x::Counts{5, -50, 0x0B3} ||
                         counts == gt3x::Counts{5, -20, 0x03B}
                     ? 1
                     : 0;
    }
    EXPECT_GT(wrong, 3);
    EXPECT_LT(wrong, 300);
    ++laws.at(one_bit == wrong ? 0 : nibbles == wrong ? 1 : 2);
  }
  for (const int count : laws) {
    EXPECT_GT(count, 4);
  }
}

TEST(OutsideServiced, VibrationShiftsTheZeroAndRestDoesNot) {
  int of_all = 0;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    const auto shift = [form](double tone_g) {
      Rig rig("vibration_rectification", form);
      rig.place(pose({0, 0, 1}));
      rig.record(2000, tone_g, 19.5);
      Vector3d mean = Vector3d::Zero();
      for (std::size_t i = 1600; i < 2000; ++i) {
        mean += rig.change(i) / 400;
      }
      return mean;
    };
    EXPECT_LT(shift(0).norm(), 1e-12);
    const Vector3d one = shift(1);
    // 2 mg per g^2 of mean square: half a g^2 in a tone of 1 g.
    EXPECT_LE(one.cwiseAbs().maxCoeff(), 1e-3 * 1.05);
    EXPECT_GT(one.norm(), 0);
    EXPECT_NEAR((shift(2) - 4 * one).norm(), 0, 0.02 * one.norm() + 1e-9);
    of_all += one.head<2>().norm() > 1e-6 ? 1 : 0;
  }
  expect_some(of_all);
}

TEST(OutsideServiced, SelfCalibrationPullsARestTowardsOneG) {
  std::set<int> speeds;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("self_calibration", form, 1);  // half of the way
    rig.place(pose({0, 0, 1}));
    const auto stored = rig.store(std::vector<gt3x::Counts>(12'000, {0, 0, 276}));
    EXPECT_EQ(stored[150][2], 276);  // two seconds of rest first
    EXPECT_EQ(stored.back()[2], 266);
    std::size_t half = 0;
    while (stored[half][2] > 271) {
      ++half;
    }
    speeds.insert(static_cast<int>(half / 50));
    // What it has learnt it keeps into the next pose: 236 x 266 / 276.
    rig.place(pose({0, 0, -1}));
    EXPECT_EQ(rig.store({{0, 0, -236}})[0][2], -227);
    // While it moves it learns nothing.
    Rig moved("self_calibration", form, 1);
    moved.place(pose({0, 0, 1}));
    std::vector<gt3x::Counts> waves;
    for (int i = 0; i < 3000; ++i) {
      waves.push_back({static_cast<std::int16_t>(i % 2 == 0 ? 40 : -40), 0, 276});
    }
    EXPECT_EQ(moved.store(waves), waves);
  }
  EXPECT_GT(speeds.size(), 8U);
}

TEST(OutsideServiced, ReferenceNoiseIsCommonAndGrowsWithTheLoad) {
  int white = 0;
  for (std::uint64_t form = 0; form < kForms; ++form) {
    Rig rig("reference_noise", form);
    rig.place(pose({0.6, 0, 0.8}));
    rig.record(50'000);
    double square = 0;
    double product = 0;
    for (std::size_t i = 1; i < 50'000; ++i) {
      const Vector3d now = rig.change(i);
      EXPECT_NEAR(now.y(), 0, 1e-12);
      EXPECT_NEAR(now.x() * 0.8, now.z() * 0.6, 1e-12);
      square += now.squaredNorm() / 50'000;
      product += now.dot(rig.change(i - 1)) / 50'000;
    }
    EXPECT_NEAR(std::sqrt(square), 5e-3, 1e-3);
    white += product / square < 0.05 ? 1 : 0;
  }
  EXPECT_GT(white, kForms / 6);
  EXPECT_LT(white, kForms * 5 / 6);
}

TEST(OutsideServiced, ShakerMovesSidewaysAsWell) {
  std::array<int, 3> laws{};  // alike, rising, resonant
  for (std::uint64_t form = 0; form < kForms; ++form) {
    const Rig rig("transverse_shaker", form);
    std::vector<double> across;
    for (double f = 2; f <= 40; f += 1) {
      const sim::Tone tone = rig.tone(f);
      EXPECT_NEAR(tone.direction_lab.z(), 1, 1e-12);  // along the axis it is what was commanded
      EXPECT_EQ(tone.amplitude_g, 1);
      across.push_back(tone.direction_lab.head<2>().norm());
    }
    const auto [least, most] = std::minmax_element(across.begin(), across.end());
    EXPECT_LE(*most, 0.08 + 1e-12);
    EXPECT_GE(*most, 0.03);
    const bool alike = *most - *least < 1e-12;
    const bool rising = !alike && std::abs(across.back() - 20 * across.front()) < 1e-9;
    ++laws.at(alike ? 0 : rising ? 1 : 2);
  }
  for (const int count : laws) {
    EXPECT_GT(count, 4);
  }
}

}  // namespace
}  // namespace sixpoint::gap

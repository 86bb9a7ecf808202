#include "gt3x/log/samples.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace sixpoint::gt3x {
namespace {

// Oracle: the worked example of the vendor's public description of ACTIVITY.
TEST(Samples, PublishedActivityExample) {
  const Bytes payload = {0x00, 0x60, 0x08, 0xEB, 0xD0, 0x07, 0x00,
                         0x9E, 0xBF, 0x00, 0x70, 0x08, 0xEB, 0xF0};
  std::vector<Counts> samples;
  unpack_activity(payload, samples);
  EXPECT_EQ(samples, (std::vector<Counts>{{8, 6, -323}, {9, 7, -321}, {8, 7, -321}}));
  Bytes packed;
  append_activity(packed, samples);
  EXPECT_EQ(packed, payload);
}

TEST(Samples, RoundTripsAtEveryLengthAndLimit) {
  Random random(1);
  for (std::size_t count = 0; count < 40; ++count) {
    std::vector<Counts> samples(count);
    for (auto& sample : samples) {
      for (auto& value : sample) {
        value = static_cast<std::int16_t>(static_cast<int>(random.below(4096)) - 2048);
      }
    }
    if (count > 1) {
      samples.front() = {kMin12, kMax12, -1};
      samples.back() = {kMax12, kMin12, 0};
    }
    std::vector<Counts> back;
    Bytes packed;
    append_activity(packed, samples);
    EXPECT_EQ(packed.size(), (count * 9 + 1) / 2);
    unpack_activity(packed, back);
    EXPECT_EQ(back, samples);
    packed.clear();
    append_activity3(packed, samples);
    unpack_activity3(packed, back);
    EXPECT_EQ(back, samples);
    packed.clear();
    append_activity2(packed, samples);
    EXPECT_EQ(packed.size(), count * 6);
    unpack_activity2(packed, back);
    EXPECT_EQ(back, samples);
  }
}

// Every count at every place of a group, whatever way the machine works on groups. Oracle: the bits
// one by one, most significant first, as the vendor describes them.
TEST(Samples, EveryCountOnEveryAxisIsItsBits) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    std::vector<Counts> samples;
    for (int count = kMin12; count <= kMax12; ++count) {
      Counts sample = {-1, 5, 1234};
      sample[axis] = static_cast<std::int16_t>(count);
      samples.push_back(sample);
      samples.push_back({0, -2048, 2047});
      samples.push_back({-2048, 2047, 0});
    }
    for (const PerAxis<std::size_t>& order : {PerAxis<std::size_t>{1, 0, 2}, {0, 1, 2}}) {
      std::vector<bool> bits;
      for (const Counts& sample : samples) {
        for (const std::size_t a : order) {
          for (int bit = 11; bit >= 0; --bit) {
            bits.push_back((static_cast<unsigned>(sample[a]) >> bit & 1U) != 0);
          }
        }
      }
      Bytes payload((bits.size() + 7) / 8);
      for (std::size_t i = 0; i < bits.size(); ++i) {
        payload[i / 8] =
            static_cast<std::uint8_t>(payload[i / 8] | (bits[i] ? 0x80U >> (i % 8) : 0));
      }
      std::vector<Counts> back;
      Bytes packed = {0xA5};
      if (order[0] == 1) {
        unpack_activity(payload, back);
        append_activity(packed, samples);
      } else {
        unpack_activity3(payload, back);
        append_activity3(packed, samples);
      }
      ASSERT_EQ(back, samples);
      ASSERT_EQ(packed.front(), 0xA5) << "appended, not replaced";
      packed.erase(packed.begin());
      ASSERT_EQ(packed, payload);
    }
  }
}

TEST(Samples, RangeIsThatOfAllAxes) {
  const CountRange none = range_of({});
  EXPECT_GT(none.low, none.high);
  const std::vector<Counts> samples = {{3, -7, 0}, {4, 1, 2047}, {-2048, 0, 0}};
  EXPECT_EQ(range_of(samples).low, -2048);
  EXPECT_EQ(range_of(samples).high, 2047);
  EXPECT_EQ(range_of(std::span(samples).first(1)).low, -7);
  EXPECT_EQ(range_of(std::span(samples).first(1)).high, 3);
}

TEST(Samples, WideValuesSurviveOnlyInSixteenBits) {
  const std::vector<Counts> samples = {{32767, -32768, 300}};
  std::vector<Counts> back;
  Bytes packed;
  append_activity2(packed, samples);
  EXPECT_EQ(packed, (Bytes{0xFF, 0x7F, 0x00, 0x80, 0x2C, 0x01}));
  unpack_activity2(packed, back);
  EXPECT_EQ(back, samples);
  packed.clear();
  append_activity(packed, samples);
  unpack_activity(packed, back);
  EXPECT_EQ(back, (std::vector<Counts>{{kMax12, kMin12, 300}}));
  packed.clear();
  append_activity(packed, std::vector<Counts>(50, samples[0]));
  unpack_activity(packed, back);
  EXPECT_EQ(back, std::vector<Counts>(50, {kMax12, kMin12, 300}));
}

TEST(Samples, ShortPayloadsGiveWholeSamplesOnly) {
  const Bytes bytes(16, 0x11);
  for (std::size_t size = 0; size <= bytes.size(); ++size) {
    std::vector<Counts> samples;
    unpack_activity(std::span(bytes).first(size), samples);
    EXPECT_EQ(samples.size(), size * 2 / 9);
    unpack_activity2(std::span(bytes).first(size), samples);
    EXPECT_EQ(samples.size(), size / 6);
  }
}

}  // namespace
}  // namespace sixpoint::gt3x

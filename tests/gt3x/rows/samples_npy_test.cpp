#include "gt3x/rows/samples_npy.h"

#include <cstring>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

struct Array {
  std::string header;
  std::string data;
  RawCsvTally tally;

  template <class Value>
  std::vector<Value> values() const {
    std::vector<Value> out(data.size() / sizeof(Value));
    std::memcpy(out.data(), data.data(), out.size() * sizeof(Value));
    return out;
  }
};

// By the format's description: magic, version 1.0, two bytes of length, a dictionary, data.
Array array_of(Recording& recording, const RawCsvOptions& options) {
  std::string bytes;
  Array array;
  const auto tally = write_samples_npy(recording, options, [&](std::string_view piece) -> Status {
    bytes += piece;
    return {};
  });
  EXPECT_OK(tally);
  array.tally = tally.value_or(RawCsvTally{});
  EXPECT_EQ(bytes.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  const auto length = static_cast<std::size_t>(static_cast<unsigned char>(bytes.at(8))) +
                      static_cast<std::size_t>(static_cast<unsigned char>(bytes.at(9))) * 256;
  EXPECT_EQ((10 + length) % 64, 0U);
  array.header = bytes.substr(10, length);
  EXPECT_EQ(array.header.back(), '\n');
  array.data = bytes.substr(10 + length);
  return array;
}

Array array_of(const Bytes& log, const RawCsvOptions& options) {
  MemoryEnv memory;
  EXPECT_OK(tests::put_recording(memory.files, "f", log));
  auto recording = Recording::open(memory.files, "f");
  EXPECT_OK(recording);
  return array_of(*recording, options);
}

TEST(SamplesNpy, HoldsARowPerSamplePeriod) {
  Bytes log = tests::made_log(2);
  tests::append_second(log, 4, 31);  // two seconds are missing, and a sample is too many
  const Array g = array_of(log, {});
  EXPECT_THAT(g.header, testing::HasSubstr("'descr': '<f4', 'fortran_order': False, "
                                           "'shape': (150, 3)"));
  const auto values = g.values<float>();
  ASSERT_EQ(values.size(), 450U);
  for (std::size_t i = 0; i < 60; ++i) {
    const Counts sample = tests::samples_of(static_cast<std::uint32_t>(i / 30))[i % 30];
    for (std::size_t a = 0; a < kAxes; ++a) {
      ASSERT_EQ(values[i * 3 + a], static_cast<float>(sample[a]) / 256) << i;
    }
  }
  EXPECT_EQ(values[60 * 3], values[59 * 3]) << "filled";
  EXPECT_EQ(g.tally.filled, 60U);

  RawCsvOptions raw;
  raw.raw_lsb = true;
  const Array lsb = array_of(log, raw);
  EXPECT_THAT(lsb.header, testing::HasSubstr("'descr': '<i2'"));
  const auto counts = lsb.values<std::int16_t>();
  ASSERT_EQ(counts.size(), 450U);
  EXPECT_EQ(counts[120 * 3], tests::samples_of(4)[0][0]);
  raw.fill = false;
  EXPECT_EQ(array_of(log, raw).values<std::int16_t>().size(), 91U * 3);
}

// Oracle: the CSV, which equals the vendor's, to half of its last digit.
TEST(SamplesNpy, IsTheCsvOfARealRecording) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1H30182785_2019-09-17.gt3x");
  auto recording = Recording::open(
      posix_env().files, sixpoint::tests::shared_file("data/gt9x/TAS1H30182785_2019-09-17.gt3x"));
  ASSERT_OK(recording);
  const auto values = array_of(*recording, {}).values<float>();
  std::string csv;
  ASSERT_OK(write_raw_csv(*recording, {}, [&](std::string_view piece) -> Status {
    csv += piece;
    return {};
  }));
  ASSERT_EQ(values.size(), 240'500U * 3);
  std::size_t at = csv.find("Accelerometer Z\r\n") + 17;
  for (const float value : values) {
    ASSERT_NEAR(value, std::strtod(csv.c_str() + at, nullptr), 0.000501);
    at = csv.find_first_of(",\n", at) + 1;
  }
}

TEST(SamplesNpy, RefusesAsTheCsvDoes) {
  MemoryEnv memory;
  ASSERT_OK(tests::put_recording(memory.files, "f", tests::made_log(0)));
  auto recording = Recording::open(memory.files, "f");
  ASSERT_OK(recording);
  EXPECT_FAILS(write_samples_npy(*recording, {}, [](std::string_view) { return Status{}; }),
               ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gt3x

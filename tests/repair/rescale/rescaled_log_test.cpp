#include "repair/rescale/rescaled_log.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "repair/six_sides.h"

namespace sixpoint::repair {
namespace {

gt3x::LogReader reader_of(const Bytes& log) {
  return gt3x::LogReader(std::make_unique<gt3x::MemorySource>(log));
}

// Zero bytes, noise and a record of a type that no program knows between the seconds.
tests::MadeRecording with_noise() {
  tests::MadeRecording made = tests::six_sides();
  made.between = [](std::size_t second) -> Bytes {
    Bytes bytes;
    if (second % 7 == 3) {
      bytes = {0, 0, 0, 0x55, 0x33};
    } else if (second % 7 == 5) {
      gt3x::append_record(bytes, static_cast<gt3x::RecordType>(99), 1'428'588'240, Bytes{1, 2});
    }
    return bytes;
  };
  return made;
}

TEST(RescaledLog, WithoutConstantsEveryByteComesOutAsItWentIn) {
  const Bytes log = with_noise().log();
  auto rescaled = RescaledLog::make(reader_of(log), {});
  ASSERT_OK(rescaled);
  EXPECT_EQ(gt3x::read_all(**rescaled, 1U << 20).value(), log);
  EXPECT_EQ((*rescaled)->tally().samples, 2100U);
  EXPECT_EQ((*rescaled)->tally().sample_records, 70U);
  EXPECT_EQ((*rescaled)->tally().changed_samples, 0U);
}

TEST(RescaledLog, SmallPiecesGiveTheSameBytes) {
  const Bytes log = with_noise().log();
  RescaledLogOptions options;
  options.fresh = tests::kTrue;
  options.first_constants = tests::kStored;
  auto whole = RescaledLog::make(reader_of(log), options).value();
  const Bytes expected = gt3x::read_all(*whole, 1U << 20).value();
  EXPECT_EQ(expected.size(), log.size());
  EXPECT_NE(expected, log);
  auto pieces = RescaledLog::make(reader_of(log), options).value();
  Bytes got;
  Bytes piece(7);
  while (const std::size_t count = pieces->read(piece).value()) {
    got.insert(got.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
  }
  EXPECT_EQ(got, expected);
  EXPECT_LT(pieces->still_error().mean_mg, 5) << "at rest the right constants give 1 g";
}

TEST(RescaledLog, RefusesConstantsThatDivideByZero) {
  RescaledLogOptions options;
  options.fresh = tests::kTrue;
  options.first_constants = StoredConstants{{1, 1, 1}, {1, 1, 1}, {0, 0, 0}};
  EXPECT_FALSE(RescaledLog::make(reader_of(Bytes{}), options));
}

}  // namespace
}  // namespace sixpoint::repair
